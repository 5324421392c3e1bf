"""`close_loop`: find the residual of the declared model, trace it to an effect, add it, report before and after."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from shake_ros.cli import fitting
from shake_ros.cli.progress import Bar
from shake_ros.cli.tracking import tracking
from shake_ros.core.discovery.closing import ClosedLoop, close_loop
from shake_ros.core.discovery.judging import Policy
from shake_ros.core.identification.axis_model import position_errors
from shake_ros.core.identification.diagnosis import Diagnosis, diagnose
from shake_ros.core.identification.recordings import Record
from shake_ros.core.loop.benefit import Benefit
from shake_ros.data.results import close_loop_json, diagnosis_json, write_folder, write_json
from shake_ros.declared import recordings_to_make
from shake_ros.report.close_loop_page import close_loop_page
from shake_ros.report.text import close_loop_lines, diagnosis_lines, tracking_lines
from shake_ros.settings import save_table


def main(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    command = argparse.ArgumentParser(prog="close_loop", description=__doc__)
    fitting.add_arguments(command, hold_needed=True)
    given = command.parse_args(list(arguments))
    fitting.check_output(given.out, given.force)
    chosen = fitting.declare(given)
    declared = chosen.declared
    learn, hold = fitting.read_records(given.learn, given.hold, declared.driven_by)
    table = chosen.start(learn)
    with Bar("close_loop") as bar:
        result = close_loop(
            table, declared.free(), declared.candidates(), learn, hold, Policy(), bar, declared.model, declared.late()
        )
        bar("tracking with the model before and after", 1.0)
        benefit = tracking(result)
        bar("residuals and what would help", 1.0)
        found = diagnose(result.final.fit, learn, hold, recordings_to_make(), declared.model)
    write_folder(
        given.out, lambda folder: fill(folder, result, found, benefit, learn, hold, given.model), force=given.force
    )
    worth = tracking_lines(benefit) if benefit else []
    print("\n".join([*close_loop_lines(result), *worth, *diagnosis_lines(found)]))
    if given.model == "axis":
        for name, before in position_errors(result.baseline.table, learn + hold).items():
            after = position_errors(result.final.table, [r for r in learn + hold if r.name == name])[name]
            print(f"position of the free run, {name}: {1e3 * before:.3f} → {1e3 * after:.3f} mm rms")
    print(f"report: {given.out / 'report.html'}")
    return 0


def fill(
    folder: Path,
    result: ClosedLoop,
    found: Diagnosis,
    benefit: Benefit | None,
    learn: list[Record],
    hold: list[Record],
    model: str,
) -> None:
    """Write report.json, diagnosis.json, tracking.json, report.html and table.yaml into a folder."""
    names = [list(dict.fromkeys(r.name for r in records)) for records in (learn, hold)]
    write_json(folder / "report.json", close_loop_json(result, *names, model))
    write_json(folder / "diagnosis.json", diagnosis_json(found))
    if benefit:
        write_json(folder / "tracking.json", {"reference": benefit.reference, **benefit.errors()})
    added = ", ".join(s.chosen.candidate.effect for s in result.search.steps) or "nothing to add"
    save_table(folder / "table.yaml", result.final.table, f"Fitted to {', '.join(names[0])} by close_loop: {added}.")
    page = close_loop_page(result, learn, hold, found, benefit)
    (folder / "report.html").write_text(page, encoding="utf-8")
