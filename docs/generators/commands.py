"""The command line, from the parsers' own help."""

from __future__ import annotations

import importlib
import io
import os
from contextlib import redirect_stdout, suppress

from shake_ros.entry_points import COMMANDS, NODES


def help_of(name: str) -> str:
    """What `./shake NAME --help` prints."""
    out = io.StringIO()
    with redirect_stdout(out), suppress(SystemExit):
        command = COMMANDS[name]
        getattr(importlib.import_module(command.module), command.function)(["--help"])
    return out.getvalue().strip()


def pages() -> dict[str, str]:
    """One page with every command."""
    os.environ["COLUMNS"] = "90"  # the parsers fold their lines to it
    text = ["# Command line", "", "`./shake NAME …`, `python -m shake_ros NAME …` and `ros2 run shake_ros NAME …`"]
    text += ["run the same entry points. Exit codes: 0 done; 2 wrong arguments or input, with one line on standard"]
    text += ["error that says which; 1 anything else. Nothing is overwritten without `--force`.", "", "## Nodes", ""]
    text += ["Parameters: `./shake NAME --ros-args -p parameter:=value`, listed on [their page](nodes.md).", ""]
    text += ["| node | |", "|---|---|", *(f"| `{name}` | {entry.line} |" for name, entry in NODES.items()), ""]
    for name, entry in COMMANDS.items():
        line = entry.line[0].upper() + entry.line[1:]
        text += [f"## `{name}`", "", f"{line}.", "", "```text", help_of(name), "```", ""]
    return {"commands.md": "\n".join(text)}
