"""`identify`: fit the declared model to recordings; parameters with standard errors, error on every recording."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from shake_ros.cli import fitting
from shake_ros.cli.progress import Bar
from shake_ros.core.discovery.closing import FittedModel, identify, identify_inverse
from shake_ros.core.identification.axis_model import InverseDynamics, position_errors
from shake_ros.core.identification.diagnosis import Diagnosis, diagnose
from shake_ros.core.identification.recordings import Record
from shake_ros.core.quantities import ShakeError
from shake_ros.data.results import IDENTIFY_SCHEMA, diagnosis_json, model_json, write_folder, write_json
from shake_ros.declared import recordings_to_make
from shake_ros.report.identify_page import identify_page
from shake_ros.report.text import diagnosis_lines, error_lines, parameter_lines
from shake_ros.settings import save_table


def main(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    command = argparse.ArgumentParser(prog="identify", description=__doc__)
    fitting.add_arguments(command, hold_needed=False)
    command.add_argument(
        "--method",
        choices=("free_run", "inverse_dynamics"),
        default="free_run",
        help="what is fitted: the error of the free run, or (model axis) that of the force (default: free_run)",
    )
    given = command.parse_args(list(arguments))
    if given.method == "inverse_dynamics" and given.model != "axis":
        raise ShakeError(f"--method inverse_dynamics: needs --model axis, not {given.model}")
    fitting.check_output(given.out, given.force)
    chosen = fitting.declare(given)
    declared = chosen.declared
    learn, hold = fitting.read_records(given.learn, given.hold, declared.driven_by)
    table = chosen.start(learn)
    if given.method == "inverse_dynamics":
        model = identify_inverse(table, declared.free(), learn, hold)
        blocks = InverseDynamics(learn).blocks()
        found = diagnose(model.fit, learn, hold, recordings_to_make(), declared.model, blocks)
        return _finish(given, model, found, learn, hold)
    with Bar("identify") as bar:
        bar.span(0.0, 0.85)
        model = identify(table, declared.free(), learn, hold, bar, declared.model, declared.late())
        bar.span(0.85, 1.0)
        bar("residuals and what would help", 0.0)
        found = diagnose(model.fit, learn, hold, recordings_to_make(), declared.model)
    return _finish(given, model, found, learn, hold)


def _finish(
    given: argparse.Namespace, model: FittedModel, found: Diagnosis, learn: list[Record], hold: list[Record]
) -> int:
    """Write the results and print them."""
    names = [list(dict.fromkeys(r.name for r in records)) for records in (learn, hold)]
    extra = {"position_error": position_errors(model.table, learn + hold)} if given.model == "axis" else {}
    write_folder(given.out, lambda folder: _fill(folder, model, found, names, given.model, extra), force=given.force)
    print("\n".join(parameter_lines(model.parameters) + error_lines(model) + diagnosis_lines(found)))
    for name, error in extra.get("position_error", {}).items():
        print(f"position of the free run, {name}: {1e3 * error:.3f} mm rms")
    print(f"report: {given.out / 'report.html'}")
    return 0


def _fill(
    folder: Path, model: FittedModel, found: Diagnosis, names: list[list[str]], kind: str, extra: Mapping[str, Any]
) -> None:
    content = {"schema": IDENTIFY_SCHEMA, "model": kind, "recordings": dict(zip(("learn", "hold"), names, strict=True))}
    write_json(folder / "report.json", {**content, **model_json(model), **extra})
    write_json(folder / "diagnosis.json", diagnosis_json(found))
    (folder / "report.html").write_text(identify_page(model, found, *names), encoding="utf-8")
    save_table(folder / "table.yaml", model.table, f"Fitted to {', '.join(names[0])} by identify.")
