"""`identify`: fit the declared model to recordings; parameters with standard errors, error on every recording."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from shake_ros.cli import fitting
from shake_ros.cli.declared import MODELS
from shake_ros.cli.progress import Bar
from shake_ros.core.discovery.closing import FittedModel, identify
from shake_ros.data.results import IDENTIFY_SCHEMA, model_json, write_folder, write_json
from shake_ros.report.text import error_lines, parameter_lines
from shake_ros.settings import save_table


def main(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    command = argparse.ArgumentParser(prog="identify", description=__doc__)
    fitting.add_arguments(command, hold_needed=False)
    given = command.parse_args(list(arguments))
    fitting.check_output(given.out, given.force)
    declared = MODELS[given.model]
    declared.changed(given.set)  # a wrong name is told before the work
    learn, hold = fitting.read_records(given.learn, given.hold, declared.driven_by)
    table = declared.table(given.config, given.set, learn)
    with Bar("identify") as bar:
        model = identify(table, declared.free(), learn, hold, bar, declared.model)
    names = [list(dict.fromkeys(r.name for r in records)) for records in (learn, hold)]
    write_folder(given.out, lambda folder: _fill(folder, model, names, given.model), force=given.force)
    print("\n".join(parameter_lines(model.parameters) + error_lines(model)))
    return 0


def _fill(folder: Path, model: FittedModel, names: list[list[str]], kind: str) -> None:
    content = {"schema": IDENTIFY_SCHEMA, "model": kind, "recordings": dict(zip(("learn", "hold"), names, strict=True))}
    write_json(folder / "report.json", {**content, **model_json(model)})
    save_table(folder / "table.yaml", model.table, f"Fitted to {', '.join(names[0])} by identify.")
