"""`schedule`: the thesis's neural schedule of θ_1 … θ_7 (6.3.5) beside the physical effect, on the same recordings."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from shake_ros.api.schedule import ScheduleComparison, schedule
from shake_ros.api.schedule_models import SeedResult
from shake_ros.cli import fitting
from shake_ros.cli.reporting import add_figures, reporting
from shake_ros.core.quantities import ShakeError
from shake_ros.data.results import check_folder


def main(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    command = argparse.ArgumentParser(prog="schedule", description=__doc__)
    fitting.add_data(command)
    command.add_argument("--config", default="default", metavar="NAME", help="config/schedule/NAME.yaml or a file")
    add_figures(command)
    given = command.parse_args(list(arguments))
    if bool(given.estimation) != bool(given.validation):
        raise ShakeError("--learn and --hold: both or neither (without them, data are simulated)")
    check_folder(given.out, given.force)
    data = fitting.read_data(given) if given.estimation else ()
    result = schedule(*data, settings=given.config)
    result.report(given.out, given.force, **reporting("schedule", given, arguments))
    print("\n".join(lines(result)))
    print(f"report: {given.out / 'report.html'}")
    return 0


def seed_line(one: SeedResult) -> str:
    """A row of the table of the seeds."""
    t = one.training
    numbers = (
        f"{one.seed:>4}{t.epochs:>8}{t.kept:>6}{t.learn:>8.2g}{t.stop:>7.2f}{t.test:>7.2f}{one.radial_basis:>8.2f}"
    )
    return numbers + "  " + "".join(f"{100 * v:>17.2f} / {100 * a:.2f} %" for v, a in one.errors.values())


def lines(result: ScheduleComparison) -> list[str]:
    """What is printed."""
    t = result.training
    parts = f"to learn {t.learn:.2g}, to stop by {t.stop:.2g}, to test {t.test:.2g}"
    found = [
        "windows held out: mean square of the scaled error of theta, where the mean gives 1; error of the free run",
        f"{'seed':>4}{'epochs':>8}{'kept':>6}{'learn':>8}{'stop':>7}{'test':>7}{'radial':>8}  "
        + "".join(f"{name + ' v / a':>28}" for name in result.seeds[0].errors),
        *map(seed_line, result.seeds),
        f"network that runs below: {t.epochs} epochs, kept is {t.kept}; {parts}",
        f"{'free-run error on what was held out':<44}{'velocity':>12}{'acceleration':>14}",
    ]
    for recording, model, velocity, felt in result.error.cells():
        found.append(f"{recording + ': ' + model:<44}{velocity:>12}{felt:>14}")
    return found
