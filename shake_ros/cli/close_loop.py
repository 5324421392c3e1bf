"""`close_loop`: find the residual of the declared model, trace it to an effect, add it, report before and after."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from shake_ros.api.close_loop import close_loop
from shake_ros.cli import fitting
from shake_ros.cli.reporting import add_figures, reporting
from shake_ros.report.text import close_loop_lines, diagnosis_lines, identified_lines, tracking_lines


def main(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    command = argparse.ArgumentParser(prog="close_loop", description=__doc__)
    fitting.add_arguments(command, validation_needed=True)
    add_figures(command)
    given = command.parse_args(list(arguments))
    found = close_loop(*fitting.inputs(given))
    found.report(given.out, given.force, **reporting("close_loop", given, arguments))
    tracking = tracking_lines(found.tracking) if found.tracking else []
    told = identified_lines(found.told, found.data)
    print("\n".join([*close_loop_lines(found.closed), *told, *tracking, *diagnosis_lines(found.diagnosis)]))
    for name, (before, after) in found.position_error.items():
        print(f"position of the free run, {name}: {1e3 * before:.3f} → {1e3 * after:.3f} mm rms")
    print(f"report: {given.out / 'report.html'}")
    return 0
