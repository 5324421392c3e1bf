"""`close_loop`: find the residual of the declared model, trace it to an effect, add it, report before and after."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from shake_ros.api.close_loop import SEARCHES, Discovery, close_loop
from shake_ros.cli import fitting
from shake_ros.cli.reporting import add_figures, reporting
from shake_ros.core.identification.models import MODELS
from shake_ros.core.plant.parameters import FULL_LAYOUT
from shake_ros.core.quantities import ShakeError
from shake_ros.report.slow_changes import position_lines, slow_change_lines
from shake_ros.report.text import (
    close_loop_lines,
    diagnosis_lines,
    identified_lines,
    predictable_lines,
    tracking_lines,
)


def main(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    command = argparse.ArgumentParser(prog="close_loop", description=__doc__)
    fitting.add_arguments(command, validation_needed=True)
    add_figures(command)
    command.add_argument(
        "--tune", action="store_true", help="make controller.yaml and observer.yaml for the found table"
    )
    command.add_argument(
        "--minutes",
        type=float,
        metavar="N",
        help="end the search after N minutes with the best answer so far; judging it may take a quarter more",
    )
    command.add_argument(
        "--test", type=Path, nargs="+", default=[], metavar="BAG", help="recordings that no decision sees: test data"
    )
    command.add_argument(
        "--search",
        choices=SEARCHES,
        default=SEARCHES[0],
        help="one effect after the other by free runs, or sets of effects at once by prediction errors (model full)",
    )
    given = command.parse_args(list(arguments))
    if given.tune and MODELS[given.model].layout is not FULL_LAYOUT:
        raise ShakeError(f"--tune: needs a valve and hydraulics, which the model {given.model} does not have")
    found = close_loop(
        *fitting.inputs(given),
        test=fitting.read_set(given, given.test),
        minutes=given.minutes,
        tune=given.tune,
        search=given.search,
    )
    found.report(given.out, given.force, **reporting("close_loop", given, arguments))
    text = list[str]()
    with found.failures.step("text"):
        text.extend(lines(found, given.force))
    print("\n".join(text))
    page = given.out / "report.html"
    print(f"report: {page if page.exists() else given.out / 'report.json'}")
    for failure in found.failures:
        print(f"shake_ros close_loop: {failure}", file=sys.stderr)
    return 1 if len(found.failures) else 0


def lines(found: Discovery, force: bool) -> Iterator[str]:
    """The report for a terminal, line by line. force : whether gains under which the loop rings were written."""
    if found.tuned:
        yield str(found.tuned)
        if not found.tuned.sound and not force:
            yield "controller.yaml and observer.yaml are not written: the loop rings (--force writes them)"
    yield from close_loop_lines(found.closed)
    if found.diagnosis:
        yield from predictable_lines(found.closed, found.diagnosis)
    yield from identified_lines(found.told, found.data)
    if found.tracking:
        yield from tracking_lines(found.tracking)
    if found.diagnosis:
        yield from diagnosis_lines(found.diagnosis)
    yield from slow_change_lines(found.own)
    yield from position_lines(found.position_error, found.forecast_error)
