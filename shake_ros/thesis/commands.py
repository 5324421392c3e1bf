"""Commands of the thesis: figures, sensitivity, reproduce, schedule, measured_runs."""

from __future__ import annotations

from collections.abc import Sequence

from shake_ros.cli.arguments import CommandLine, add_data, read_data, reported, reporting
from shake_ros.measured.runs import measured_runs
from shake_ros.quantities import ShakeError
from shake_ros.result_folder import check_folder, refuse_existing, writing
from shake_ros.thesis.figures import FIGURES, figures, known_figures
from shake_ros.thesis.reproduce import ALL, EXPERIMENTS, known_experiments, reproduce
from shake_ros.thesis.schedule import schedule
from shake_ros.thesis.sensitivity import check_free, sensitivity


def figures_command(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    listing = "\n".join(f"  {name:10} {drawing.line}" for name, drawing in FIGURES.items())
    p = CommandLine("figures", f"figures:\n{listing}")
    p.add_argument("names", nargs="+", metavar="NAME", help="number of a figure, or all")
    p.add_folder("folder for figure_NAME.png")
    given = p.parse_args(arguments)
    targets = {name: given.out / f"figure_{name.replace('.', '_')}.png" for name in known_figures(given.names)}
    refuse_existing(*targets.values(), force=given.force)
    for name, target in targets.items():
        with writing():
            given.out.mkdir(parents=True, exist_ok=True)
            figures(name)[name].savefig(target, dpi=130)
        print(f"written: {target}")
    return 0


def sensitivity_command(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    p = CommandLine("sensitivity")
    p.add_verb(sensitivity)
    p.add_folder("folder for the figures and sensitivity.json")
    given = p.parse_args(arguments)
    check_free(given.out, given.force)
    found = sensitivity(**p.options(given))
    found.report(given.out, given.force)
    print(found)
    print(f"written: {given.out}")
    return 0


def reproduce_command(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    listed = "".join(f"\n  {name:<16}{entry.line}" for name, entry in EXPERIMENTS.items())
    p = CommandLine("reproduce", f"experiments:{listed}")
    p.add_argument("names", nargs="*", default=[ALL], metavar="NAME", help="experiments, or all (default)")
    p.add_folder("folder for index.html, pages and claims")
    p.add_figures()
    given = p.read(arguments)
    names = known_experiments(given.names)
    check_folder(given.out, given.force)
    found = reproduce(*names)
    found.report(given.out, given.force, **reporting(given))
    print(found)
    print(f"report: {given.out / 'index.html'}")
    return 0


def schedule_command(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    p = CommandLine("schedule")
    add_data(p)
    p.add_verb(schedule, settings="config")
    given = p.read(arguments)
    if bool(given.estimation) != bool(given.validation):
        raise ShakeError("--learn and --hold: both or neither (without them, data are simulated)")
    check_folder(given.out, given.force)
    data = read_data(given) if given.estimation else ()
    return reported(schedule(*data, **p.options(given)), given)


def measured_runs_command(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    p = CommandLine("measured_runs")
    p.add_folder("folder for the report, tables and the fit")
    p.add_verb(measured_runs)
    p.add_figures()
    given = p.read(arguments)
    check_folder(given.out, given.force)
    return reported(measured_runs(**p.options(given)), given)
