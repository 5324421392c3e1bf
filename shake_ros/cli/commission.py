"""commission: the guided way on a new table, each step shown and released by the operator."""

from __future__ import annotations

import argparse
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path

from shake_ros.api.commission import commission
from shake_ros.cli.fitting import change
from shake_ros.cli.live import live, live_arguments
from shake_ros.core.quantities import ShakeError
from shake_ros.data.results import check_folder

METHOD = """\
A gentle motion under a loop that knows nothing; the model fitted to it; observer and gains for that model; a higher
level, and again, until the full motion has been run with gains of its own; at the highest level close_loop seeks what
the model lacks. With --live this is done on the table of the running graph (./shake lab), whose interlock gets each
level's limits. Before each run its largest values and those limits are shown, and Enter releases it; the limits grow
with the level. DIR gets table.yaml, controller.yaml, observer.yaml, interlock.yaml, commission.html, commission.json
and the recordings. Exit code 1 where it ended before the last step, with the reason on the last line."""


def parser() -> argparse.ArgumentParser:
    """The command line."""
    p = argparse.ArgumentParser(
        prog="commission",
        description="Bring a table into service step by step, a simulated one or that of a running graph.",
        epilog=METHOD,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    p.add_argument("--table", default="bergamo", help="the table as it is declared (default: bergamo)")
    p.add_argument(
        "--set", nargs="+", action="extend", default=[], metavar="KEY=VALUE", help="where the simulated table differs"
    )
    p.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder for table, gains and evidence")
    p.add_argument("--config", default="default", help="config/commission/NAME.yaml or a file (default: default)")
    p.add_argument("--delay", type=int, default=1, help="samples by which a command acts late (default: 1)")
    live_arguments(p)
    p.add_argument("--yes", action="store_true", help="release every step, for scripts")
    p.add_argument("--force", action="store_true", help="replace an existing DIR")
    return p


def asked(text: str) -> bool:
    """Show a step and ask the operator."""
    print(text, flush=True)
    try:
        return input("Enter releases it, anything else ends here: ").strip() == ""
    except EOFError:
        raise ShakeError("commission: nobody at the terminal releases the step (--yes releases all)") from None


def shown(text: str) -> bool:
    """Show a step that is released beforehand."""
    print(text, flush=True)
    return True


def main(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    given = parser().parse_args(list(arguments))
    if given.delay < 0:
        raise ShakeError(f"--delay {given.delay}: samples, 0 or more")
    check_folder(given.out, given.force)
    with live(given) as table:
        found = commission(
            given.table,
            set=dict(map(change, given.set)),
            settings=given.config,
            delay=given.delay,
            live=table,
            release=shown if given.yes else asked,
        )
    print(found.frame)
    if found.steps:
        found.report(given.out, given.force, f"./shake commission {shlex.join(arguments)}")
        print(f"written: {given.out}")
    if not found.complete:
        print(f"ended: {found.reason}", file=sys.stderr)
    return 0 if found.complete else 1
