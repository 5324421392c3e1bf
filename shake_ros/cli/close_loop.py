"""`close_loop`: find the residual of the declared model, trace it to an effect, add it, report before and after."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from shake_ros.api.close_loop import close_loop
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
    given = command.parse_args(list(arguments))
    if given.tune and MODELS[given.model].layout is not FULL_LAYOUT:
        raise ShakeError(f"--tune: needs a valve and hydraulics, which the model {given.model} does not have")
    found = close_loop(*fitting.inputs(given), minutes=given.minutes, tune=given.tune)
    found.report(given.out, given.force, **reporting("close_loop", given, arguments))
    tracking = tracking_lines(found.tracking) if found.tracking else []
    told = identified_lines(found.told, found.data)
    if found.tuned:
        print(found.tuned)
        if not found.tuned.sound and not given.force:
            print("controller.yaml and observer.yaml are not written: the loop rings (--force writes them)")
    predictable = predictable_lines(found.closed, found.diagnosis)
    lines = [*close_loop_lines(found.closed), *predictable, *told, *tracking, *diagnosis_lines(found.diagnosis)]
    own = [*slow_change_lines(found.own), *position_lines(found.position_error, found.forecast_error)]
    print("\n".join([*lines, *own]))
    print(f"report: {given.out / 'report.html'}")
    return 0
