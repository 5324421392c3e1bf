"""Commands of the thesis: figures, sensitivity, reproduce, schedule, measured_runs."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from shake_ros.cli import arguments as fitting
from shake_ros.cli.arguments import add_figures, reporting
from shake_ros.core.quantities import ShakeError
from shake_ros.data.result_folder import check_folder, refuse_existing, writing
from shake_ros.measured.runs import ALL as ALL_VARIANTS
from shake_ros.measured.runs import DEFAULT_RUNS, THESIS_EXTENSION, measured_runs
from shake_ros.thesis.figures import FIGURES, figures, known_figures
from shake_ros.thesis.reproduce import ALL, EXPERIMENTS, known_experiments, reproduce
from shake_ros.thesis.schedule import ScheduleComparison, SeedResult, schedule
from shake_ros.thesis.sensitivity import check_free, sensitivity


def figures_parser() -> argparse.ArgumentParser:
    """The command line."""
    listing = "\n".join(f"  {name:10} {drawing.line}" for name, drawing in FIGURES.items())
    p = argparse.ArgumentParser(
        prog="figures",
        description="Draw figures of the thesis again: their numbers, or 'all'.",
        epilog=f"figures:\n{listing}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    p.add_argument("names", nargs="+", metavar="NAME", help="number of a figure, or all")
    p.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder for figure_NAME.png")
    p.add_argument("--force", action="store_true", help="overwrite")
    return p


def figures_command(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    given = figures_parser().parse_args(list(arguments))
    targets = {name: given.out / f"figure_{name.replace('.', '_')}.png" for name in known_figures(given.names)}
    refuse_existing(*targets.values(), force=given.force)
    for name, target in targets.items():
        with writing():
            given.out.mkdir(parents=True, exist_ok=True)
            figures(name)[name].savefig(target, dpi=130)
        print(f"written: {target}")
    return 0


def sensitivity_parser() -> argparse.ArgumentParser:
    """The command line."""
    p = argparse.ArgumentParser(prog="sensitivity", description="Study single parameters of (6.15): figures 6.19–6.24.")
    p.add_argument("--study", default="thesis", metavar="NAME", help="config/sensitivity/NAME.yaml or a file")
    p.add_argument("--table", help="another table than the study's")
    p.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder for the figures and sensitivity.json")
    p.add_argument("--force", action="store_true", help="overwrite")
    return p


def sensitivity_command(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    given = sensitivity_parser().parse_args(list(arguments))
    check_free(given.out, given.force)
    found = sensitivity(given.study, given.table)
    found.report(given.out, given.force)
    print(found)
    print(f"written: {given.out}")
    return 0


def reproduce_parser() -> argparse.ArgumentParser:
    """The command line."""
    listed = "".join(f"\n  {name:<14}{entry.line}" for name, entry in EXPERIMENTS.items())
    p = argparse.ArgumentParser(
        prog="reproduce",
        description="reproduce: the experiments of the thesis's chapter 6 run again, "
        "each claim beside what is found here."
        f"\n\nexperiments:{listed}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    p.add_argument("names", nargs="*", default=[ALL], metavar="NAME", help="experiments, or all (default)")
    p.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder for index.html, pages and claims")
    p.add_argument("--force", action="store_true", help="replace DIR")
    add_figures(p)
    return p


def reproduce_command(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    given = reproduce_parser().parse_args(list(arguments))
    names = known_experiments(given.names)
    check_folder(given.out, given.force)
    found = reproduce(*names)
    found.report(given.out, given.force, **reporting("reproduce", given, arguments))
    print(found)
    print(f"report: {given.out / 'index.html'}")
    return 0


def schedule_command(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    command = argparse.ArgumentParser(
        prog="schedule",
        description="`schedule`: the thesis's neural schedule of θ_1 … θ_7 (6.3.5) beside the physical effect, "
        "on the same recordings.",
    )
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
    print("\n".join(schedule_lines(result)))
    print(f"report: {given.out / 'report.html'}")
    return 0


def seed_line(one: SeedResult) -> str:
    """A row of the table of the seeds."""
    t = one.training
    numbers = (
        f"{one.seed:>4}{t.epochs:>8}{t.kept:>6}{t.learn:>8.2g}{t.stop:>7.2f}{t.test:>7.2f}{one.radial_basis:>8.2f}"
    )
    return numbers + "  " + "".join(f"{100 * v:>17.2f} / {100 * a:.2f} %" for v, a in one.errors.values())


def schedule_lines(result: ScheduleComparison) -> list[str]:
    """What is printed."""
    t = result.training
    parts = f"to learn {t.learn:.2g}, to stop by {t.stop:.2g}, to test {t.test:.2g}"
    found = [
        "test windows: mean square of the scaled error of theta, where the mean gives 1; error of the free run",
        f"{'seed':>4}{'epochs':>8}{'kept':>6}{'learn':>8}{'stop':>7}{'test':>7}{'radial':>8}  "
        + "".join(f"{name + ' v / a':>28}" for name in result.seeds[0].errors),
        *map(seed_line, result.seeds),
        f"network that runs below: {t.epochs} epochs, kept is {t.kept}; {parts}",
        f"{'free-run error on validation data':<44}{'velocity':>12}{'acceleration':>14}",
    ]
    for recording, model, velocity, felt in result.error.cells():
        found.append(f"{recording + ': ' + model:<44}{velocity:>12}{felt:>14}")
    return found


def measured_runs_parser() -> argparse.ArgumentParser:
    """The command line."""
    p = argparse.ArgumentParser(
        prog="measured_runs",
        description="`measured_runs`: the real table's harmonics, tables 6.1 and 6.2 of the thesis, against "
        "printed and fitted models.",
    )
    p.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder for the report, tables and the fit")
    p.add_argument(
        "--runs", default=DEFAULT_RUNS, metavar="FILE", help="amplitudes: a name of config/measured or a YAML file"
    )
    p.add_argument(
        "--extend",
        nargs="+",
        default=[THESIS_EXTENSION],
        metavar="NAME",
        help=f"extensions of the declared model to fit, of config/measured/variants.yaml, or {ALL_VARIANTS} "
        f"(default: {THESIS_EXTENSION})",
    )
    p.add_argument(
        "--second",
        nargs="+",
        default=[],
        metavar="NAME",
        help=f"extensions to try on top of the best, or {ALL_VARIANTS}",
    )
    p.add_argument("--force", action="store_true", help="replace an existing result folder")
    add_figures(p)
    return p


def measured_runs_command(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    given = measured_runs_parser().parse_args(list(arguments))
    check_folder(given.out, given.force)
    found = measured_runs(given.runs, given.extend, given.second)
    found.report(given.out, given.force, **reporting("measured_runs", given, arguments))
    print(found)
    print(f"report: {given.out / 'report.html'}")
    return 0
