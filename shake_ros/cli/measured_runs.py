"""`measured_runs`: the real table's harmonics, tables 6.1 and 6.2 of the thesis, against printed and fitted models."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from shake_ros.cli.progress import Bar
from shake_ros.core.identification.free_parameters import free_parameter
from shake_ros.core.measured_harmonics.comparison import HarmonicComparison, compare
from shake_ros.core.measured_harmonics.harmonics import HarmonicProblem, HarmonicRun
from shake_ros.core.measured_harmonics.printed_parameters import PrintedParameters
from shake_ros.core.measured_harmonics.variants import MeasuredRuns, Variant, study
from shake_ros.core.plant.parameters import TableParameters
from shake_ros.core.quantities import ShakeError, unknown_name
from shake_ros.data.measured_results import comparison_csv, comparison_json
from shake_ros.data.results import check_folder, write_folder, write_json
from shake_ros.declared import DEFAULT_TABLE, free_parameters
from shake_ros.report.figures_measured import harmonics_figure, traces_figure
from shake_ros.report.measured_text import comparison_lines
from shake_ros.report.style import png
from shake_ros.settings import find, load_table, read_yaml, save_table

DEFAULT_RUNS = "harmonics"
THESIS_EXTENSION = "soft_zone"
ALL = "all"
PRINTED = {  # key of config/measured/printed.yaml → name of the model
    "without_soft_zone": "table 6.9 without soft zone, printed",
    "with_soft_zone": "table 6.9 with soft zone, printed",
}


@dataclass(frozen=True)
class Extensions:
    """config/measured/variants.yaml: what the declared model starts from, and extensions alone and on top."""

    declared: Sequence[Mapping[str, float]]
    single: Mapping[str, Variant]
    second: Mapping[str, Variant]


def parser() -> argparse.ArgumentParser:
    """The command line."""
    p = argparse.ArgumentParser(prog="measured_runs", description=__doc__)
    p.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder for figures, tables and the fit")
    p.add_argument(
        "--runs", default=DEFAULT_RUNS, metavar="FILE", help="amplitudes: a name of config/measured or a YAML file"
    )
    p.add_argument(
        "--extend",
        nargs="+",
        default=[THESIS_EXTENSION],
        metavar="NAME",
        help=f"extensions of the declared model to fit, of config/measured/variants.yaml, or {ALL} "
        f"(default: {THESIS_EXTENSION})",
    )
    p.add_argument(
        "--second", nargs="+", default=[], metavar="NAME", help=f"extensions to try on top of the best, or {ALL}"
    )
    p.add_argument("--force", action="store_true", help="replace an existing result folder")
    return p


def read_runs(path: Path) -> tuple[list[HarmonicRun], float]:
    """Measured runs and the specimen's mass [kg] of a file; errors name the file, the run and the value."""
    content = read_yaml(path)
    _keys(content, ("specimen_mass", "runs"), str(path))
    if not isinstance(content["runs"], list) or not content["runs"]:
        raise ShakeError(f"{path}: runs: expected a list of runs")
    runs = []
    for number, entry in enumerate(content["runs"], start=1):
        where = f"{path}: run {number}"
        _keys(entry, ("amplitude", "frequency", "harmonics"), where)
        try:
            runs.append(HarmonicRun(**entry))
        except ShakeError as error:
            raise ShakeError(f"{where}: {error}") from None
    return runs, content["specimen_mass"]


def _keys(content: Any, known: Sequence[str], where: str) -> None:
    if not isinstance(content, dict):
        raise ShakeError(f"{where}: expected {', '.join(known)}")
    for key in content:
        if key not in known:
            raise unknown_name("key", key, known, where)
    missing = [key for key in known if key not in content]
    if missing:
        raise ShakeError(f"{where}: missing {', '.join(missing)}")


def read_problem(path: Path) -> tuple[HarmonicProblem, TableParameters]:
    """The runs of a file as a problem, and the declared table with their specimen."""
    runs, mass = read_runs(path)
    try:
        return HarmonicProblem(runs), load_table(DEFAULT_TABLE).with_values({"body.specimen_mass": mass})
    except ShakeError as error:
        raise type(error)(f"{path}: {error}") from None


def read_extensions() -> Extensions:
    """Extensions of the declared model from config/discovery."""
    path = find("measured", "variants")
    content = read_yaml(path)
    entries = {**content["variants"], **content.get("second", {})}
    made = {
        name: Variant(
            name,
            entry["effect"],
            tuple(free_parameter(n, c, str(path)) for n, c in entry["free"].items()),
            tuple(entry["trials"]),
            seed,
        )
        for seed, (name, entry) in enumerate(entries.items(), start=1)
    }
    return Extensions(content["declared"], {n: made[n] for n in content["variants"]}, made)


def chosen(names: Sequence[str], known: Mapping[str, Variant], option: str) -> list[Variant]:
    """Extensions by name, in the file's order; `all` for every one."""
    for name in names:
        if name not in known and name != ALL:
            raise unknown_name("extension", name, [*known, ALL], option)
    return [variant for name, variant in known.items() if ALL in names or name in names]


def fit_runs(problem: HarmonicProblem, table: TableParameters, names: Sequence[str], progress: Bar) -> MeasuredRuns:
    """The declared model and some of its extensions fitted to the runs."""
    extensions = read_extensions()
    variants = chosen(names, extensions.single, "--extend")
    return study(table, free_parameters(), variants, problem, progress, extensions.declared)


def printed_tables(table: TableParameters) -> dict[str, TableParameters]:
    """The declared table, whose identified parameters are those of table 6.8, and the two columns of table 6.9."""
    path = find("measured", "printed")
    content = read_yaml(path)
    _keys(content, tuple(PRINTED), str(path))
    columns = {
        name: table.with_values(PrintedParameters.from_mapping(content[key], f"{path}: {key}").values())
        for key, name in PRINTED.items()
    }
    return {"declared table (table 6.8), printed": table, **columns}


def run(arguments: argparse.Namespace) -> None:
    """Fit, compare, draw, write."""
    check_folder(arguments.out, arguments.force)
    problem, table = read_problem(find("measured", arguments.runs))
    printed = printed_tables(table)
    extensions = read_extensions()
    chosen(arguments.extend, extensions.single, "--extend")
    seconds = chosen(arguments.second, extensions.second, "--second")
    with Bar("measured_runs") as bar:
        bar.span(0.0, 0.3)
        runs = fit_runs(problem, table, arguments.extend, bar)
        bar.span(0.3, 0.97)
        seconds = [variant for variant in seconds if variant.name != runs.best.name]
        comparison = compare(runs, printed, seconds, bar)
        bar.span(0.97, 1.0)
        bar("figures", 0.0)
        write_folder(arguments.out, lambda folder: write(folder, comparison), force=arguments.force)
    print("\n".join(comparison_lines(comparison)))
    print(f"written: {arguments.out}")


def write(folder: Path, comparison: HarmonicComparison) -> None:
    """All files of the result."""
    text = "\n".join(comparison_lines(comparison)) + "\n"
    (folder / "measured_runs.txt").write_text(text, encoding="utf-8")
    write_json(folder / "measured_runs.json", comparison_json(comparison))
    (folder / "harmonics.csv").write_text(comparison_csv(comparison), encoding="utf-8")
    (folder / "harmonics.png").write_bytes(png(harmonics_figure(comparison)))
    (folder / "traces.png").write_bytes(png(traces_figure(comparison)))
    comment = f"{comparison.chosen.name} to the measured runs by measured_runs."
    save_table(folder / "fitted_table.yaml", comparison.chosen.table, comment)


def main(argv: list[str]) -> int:
    """Run the command; 0 done, 2 bad arguments or input."""
    try:
        arguments = parser().parse_args(argv)
    except SystemExit as stop:
        return int(stop.code or 0)
    try:
        run(arguments)
    except ShakeError as error:
        print(f"measured_runs: {error}", file=sys.stderr)
        return 2
    return 0
