"""`measured_runs`: the real table's harmonics, tables 6.1 and 6.2 of the thesis, against printed and fitted models."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shake_ros.api.loops import strict
from shake_ros.api.progress import Progress, ProgressOption
from shake_ros.declared import DEFAULT_TABLE, free_parameters
from shake_ros.fit.free_parameters import free_parameter
from shake_ros.measured.harmonics import HarmonicProblem, HarmonicRun, PrintedParameters
from shake_ros.measured.models import HarmonicComparison, MeasuredModel, MeasuredRuns, Variant, compare, study
from shake_ros.measured.page import harmonics_chart, measured_page, shown
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.quantities import ShakeError, unknown_name
from shake_ros.report.chart import static_figure
from shake_ros.report.page import Page, Result
from shake_ros.report.result_table import ResultTable
from shake_ros.settings import find, load_table, read_yaml, save_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure


SCHEMA = "shake_ros.measured_runs/1"


def _model_json(model: MeasuredModel) -> dict[str, Any]:
    result = model.account
    content: dict[str, Any] = {
        "name": model.name,
        "rms": result.rms,
        "run_rms": result.run_rms.tolist(),
        "thd": result.distortion.tolist(),
        "thd_all_orders": result.whole_distortion.tolist(),
    }
    if model.fitted:
        free, x = model.fitted.fit.free, model.fitted.fit.x
        values = (x * free.scale).tolist()
        content["effect"] = model.fitted.effect
        content["criterion"] = model.fitted.criterion
        content["parameters"] = {
            f.name: {"value": value, "unit": f.unit, "at_bound": not f.low < value < f.high}
            for f, value in zip(free.free, values, strict=True)
        }
    if model.left_out:
        content["left_out"] = {"rms": model.left_out.rms, "run_rms": model.left_out.run_rms.tolist()}
    return content


def comparison_json(comparison: HarmonicComparison) -> dict[str, Any]:
    """All models with every run's amplitudes [m/s²], THD as a ratio."""
    problem = comparison.problem
    measured = problem.distortion(problem.measured).tolist()
    runs = []
    for run, span, thd in zip(problem.runs, problem.spans, measured, strict=True):
        simulated = {m.name: m.account.amplitudes[span].tolist() for m in comparison.models}
        runs.append(
            {
                "amplitude": run.amplitude,
                "frequency": run.frequency,
                "orders": run.orders.tolist(),
                "measured": run.measured.tolist(),
                "measured_thd": thd,
                "simulated": simulated,
            }
        )
    return {
        "schema": SCHEMA,
        "runs": runs,
        "printed": [_model_json(m) for m in comparison.printed],
        "fitted": [_model_json(m) for m in comparison.fitted],
        "best": comparison.chosen.name,
        "exchanged": [_model_json(m) for m in comparison.exchanged],
        "seconds": [_model_json(m) for m in comparison.seconds],
    }


def comparison_csv(comparison: HarmonicComparison) -> str:
    """One row per run and order: command amplitude, frequency, order, measured, then a column per model [m/s²]."""
    problem, models = comparison.problem, comparison.models
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    head = ["command_amplitude", "frequency_hz", "order", "measured"]
    writer.writerow([*head, *(m.name for m in models)])
    for run, span in zip(problem.runs, problem.spans, strict=True):
        for order, place in zip(run.orders.tolist(), range(span.start, span.stop), strict=True):
            row = [problem.measured[place], *(m.account.amplitudes[place] for m in models)]
            writer.writerow([run.amplitude, run.frequency, order, *(f"{value:.5g}" for value in row)])
    return out.getvalue()


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


@dataclass(frozen=True, repr=False)
class MeasuredComparison(Result):
    """Printed and fitted models beside the measured harmonics.

    Attributes
    ----------
    comparison : of all models, run by run, with fits that left a run out.
    """

    numbers = "measured_runs.json"
    comparison: HarmonicComparison

    @property
    def table(self) -> TableParameters:
        """The fitted table."""
        return self.comparison.chosen.table

    @property
    def errors(self) -> ResultTable:
        """Root mean square error of the harmonic amplitudes of each fitted model [m/s²]."""
        rows = [(m.name, m.account.rms) for m in self.comparison.models]
        return ResultTable(("model", "error [m/s²]"), rows)

    def plot(self) -> Figure:
        """Measured and simulated harmonics of every run."""
        models = [(m.name, m.account.amplitudes, colour) for m, colour in shown(self.comparison)]
        return static_figure(harmonics_chart(self.comparison.problem, models))

    def content(self) -> dict[str, Any]:
        """All models with every run's amplitudes [m/s²], THD as a ratio."""
        return comparison_json(self.comparison)

    @property
    def page(self) -> Page:
        """What explains the real table's harmonics, how well, and why not another model."""
        return measured_page(self.comparison)

    def files(self, work: Path, _: Path, /) -> None:
        """Write measured_runs.txt, harmonics.csv and the fitted table."""
        (work / "measured_runs.txt").write_text(f"{self!r}\n", encoding="utf-8")
        (work / "harmonics.csv").write_text(comparison_csv(self.comparison), encoding="utf-8")
        comment = f"{self.comparison.chosen.name} to the measured runs by measured_runs."
        save_table(work / "fitted_table.yaml", self.table, comment)


def measured_runs(
    runs: str | Path = DEFAULT_RUNS,
    extend: Sequence[str] = (THESIS_EXTENSION,),
    second: Sequence[str] = (),
    *,
    progress: ProgressOption = True,
) -> MeasuredComparison:
    """Fit the declared model and extensions to measured harmonic amplitudes; minutes for all five runs.

    Parameters
    ----------
    runs : amplitudes, a name of config/measured or a YAML file.
    extend : extensions of config/measured/variants.yaml to fit, or "all".
    second : extensions to try on top of the best, or "all".
    progress : whether to show it, or a function to call with it.

    Raises
    ------
    ShakeError
        Unknown names, or a file whose runs are not as they should be.

    Examples
    --------
    >>> import shake_ros as sr
    >>> sr.measured_runs(extend=["soft_zon"])
    Traceback (most recent call last):
        ...
    shake_ros.quantities.UnknownName: ...
    """
    problem, table = read_problem(find("measured", str(runs)))
    printed, extensions = printed_tables(table), read_extensions()
    chosen(extend, extensions.single, "--extend")
    wanted = chosen(second, extensions.second, "--second")
    with Progress("measured_runs", progress) as bar:
        bar.span(0.0, 0.3)
        fitted = fit_runs(problem, table, extend, bar)
        bar.span(0.3, 1.0)
        return MeasuredComparison(compare(fitted, printed, [v for v in wanted if v.name != fitted.best.name], bar))


def read_runs(path: Path) -> tuple[list[HarmonicRun], float]:
    """Measured runs and the specimen's mass [kg] of a file; errors name the file, the run and the value."""
    content = strict(read_yaml(path), ("specimen_mass", "runs"), str(path))
    if not isinstance(content["runs"], list) or not content["runs"]:
        raise ShakeError(f"{path}: runs: expected a list of runs")
    runs = []
    for number, entry in enumerate(content["runs"], start=1):
        where = f"{path}: run {number}"
        strict(entry, ("amplitude", "frequency", "harmonics"), where)
        try:
            runs.append(HarmonicRun(**entry))
        except ShakeError as error:
            raise ShakeError(f"{where}: {error}") from None
    return runs, content["specimen_mass"]


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
    seeds = {name: k for k, name in enumerate((n for n, e in entries.items() if "seed" not in e), start=1)}
    made = {
        name: Variant(
            name=name,
            effect=entry["effect"],
            free=tuple(free_parameter(n, c, str(path)) for n, c in entry["free"].items()),
            trials=tuple(entry["trials"]),
            seed=seeds[name] if name in seeds else entry["seed"],
            fixed=entry.get("fixed", {}),
        )
        for name, entry in entries.items()
    }
    return Extensions(content["declared"], {n: made[n] for n in content["variants"]}, made)


def chosen(names: Sequence[str], known: Mapping[str, Variant], option: str) -> list[Variant]:
    """Extensions by name, in the file's order; `all` for every one."""
    for name in names:
        if name not in known and name != ALL:
            raise unknown_name("extension", name, [*known, ALL], option)
    return [variant for name, variant in known.items() if ALL in names or name in names]


def fit_runs(
    problem: HarmonicProblem, table: TableParameters, names: Sequence[str], progress: Callable[[str, float], None]
) -> MeasuredRuns:
    """The declared model and some of its extensions fitted to the runs."""
    extensions = read_extensions()
    variants = chosen(names, extensions.single, "--extend")
    return study(table, free_parameters(), variants, problem, progress, extensions.declared)


def printed_tables(table: TableParameters) -> dict[str, TableParameters]:
    """The declared table, whose identified parameters are those of table 6.8, and the two columns of table 6.9."""
    path = find("measured", "printed")
    content = strict(read_yaml(path), tuple(PRINTED), str(path))
    columns = {
        name: table.with_values(PrintedParameters.from_mapping(content[key], f"{path}: {key}").values())
        for key, name in PRINTED.items()
    }
    return {"declared table (table 6.8), printed": table, **columns}
