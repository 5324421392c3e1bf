"""`identify`: fit the declared model to recordings; parameters with standard errors, error on every recording."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from shake_ros.api.identify import METHODS, identify
from shake_ros.cli import fitting
from shake_ros.cli.reporting import add_figures, reporting
from shake_ros.report.slow_changes import position_lines, slow_change_lines
from shake_ros.report.text import diagnosis_lines, error_lines, identified_lines, parameter_lines


def main(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    command = argparse.ArgumentParser(prog="identify", description=__doc__)
    fitting.add_arguments(command, validation_needed=False)
    command.add_argument(
        "--method",
        choices=METHODS,
        default="free_run",
        help="what is fitted: the error of the free run, or (model axis) that of the force (default: free_run)",
    )
    add_figures(command)
    given = command.parse_args(list(arguments))
    result = identify(*fitting.inputs(given), method=given.method)
    result.report(given.out, given.force, **reporting("identify", given, arguments))
    print("\n".join(parameter_lines(result.fit.parameters) + error_lines(result.fit)))
    print("\n".join([*identified_lines(result.told, result.data), *diagnosis_lines(result.diagnosis)]))
    errors = {name: (error,) for name, error in result.position_error.items()}
    for line in [*slow_change_lines(result.own), *position_lines(errors, result.forecast_error)]:
        print(line)
    print(f"report: {given.out / 'report.html'}")
    return 0
