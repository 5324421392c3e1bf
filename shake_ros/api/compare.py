"""`compare`: the controllers side by side on the same references, loads and perturbed tables; compare.json."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shake_ros.api.loops import Combination, Course, Setup, combinations, load_setup
from shake_ros.api.progress import Progress, ProgressOption
from shake_ros.core.control.closed_loop import ClosedLoop
from shake_ros.core.loop.compiled import Loop, run_batch
from shake_ros.core.loop.metrics import MEANINGS, UNITS, Outcome, Summary, judge, summarise
from shake_ros.core.quantities import unknown_name
from shake_ros.data.result_folder import new_folder, write_json
from shake_ros.report.chart import static_figure
from shake_ros.report.comparison_page import HEAD, comparison_page, error_chart, load_rows, summary_rows, trouble
from shake_ros.report.page import write_page
from shake_ros.report.result_table import aligned

if TYPE_CHECKING:
    from matplotlib.figure import Figure


SCHEMA = "shake_ros.compare/1"


def _outcome_json(outcome: Outcome) -> dict[str, Any]:
    table = {"perturbed_table": outcome.table} if outcome.table >= 0 else {}
    return {
        "entry": outcome.entry,
        "reference": outcome.reference,
        "load": outcome.load,
        **table,
        **dataclasses.asdict(outcome.metrics),
    }


def _summary_json(summary: Summary) -> dict[str, Any]:
    found = {name: dataclasses.asdict(getattr(summary, name)) for name in ("mean", "worst", "perturbed_worst")}
    for figures in found.values():
        for name in ("end_stop", "unstable"):
            del figures[name]
    return {"entry": summary.entry, **found, "unstable": summary.unstable, "end_stops": summary.end_stops}


def comparison_json(
    outcomes: Sequence[Outcome], summaries: Sequence[Summary], settings: Mapping[str, Any]
) -> dict[str, Any]:
    """Content of compare.json (schema shake_ros.compare/1)."""
    return {
        "schema": SCHEMA,
        "units": {**UNITS, "load": "kg"},
        "meanings": MEANINGS,
        "settings": dict(settings),
        "summaries": [_summary_json(s) for s in summaries],
        "runs": [_outcome_json(o) for o in outcomes if o.table < 0],
        "perturbed_runs": [_outcome_json(o) for o in outcomes if o.table >= 0],
    }


@dataclass(frozen=True)
class Case:
    """One run to be made, and its place in the comparison."""

    loop: Loop
    entry: str
    course: Course
    load: float
    table: int


@dataclass(frozen=True, repr=False)
class Comparison:
    """Controllers on the same references, loads and perturbed tables.

    Attributes
    ----------
    settings : of the comparison.
    plant : in a sentence.
    outcomes : every run with its figures.
    summaries : one for each controller.
    runs : of the case that is drawn, by controller.
    drawn : that case in words.
    """

    settings: Mapping[str, Any]
    plant: str
    outcomes: Sequence[Outcome]
    runs: Mapping[str, ClosedLoop]
    drawn: str

    @property
    def summaries(self) -> list[Summary]:
        """Mean and worst figures of each controller."""
        return summarise(self.outcomes)

    def plot(self) -> Figure:
        """Errors of each controller over the case that is drawn."""
        return static_figure(error_chart(self.runs, self.drawn))

    def report(self, out: str | Path, force: bool = False, *, figures: str | None = None, command: str = "") -> None:
        """Write compare.json and report.html into a new folder; options as of `Discovery.report`."""
        with new_folder(Path(out), force=force) as folder:
            write_json(folder / "compare.json", comparison_json(self.outcomes, self.summaries, self.settings))
            page = comparison_page(self.outcomes, self.runs, self.drawn, self.plant, command)
            write_page(page, folder, figures)

    def __repr__(self) -> str:
        bad = trouble(self.outcomes) or ["no run was unstable or touched an end stop"]
        lines = [self.plant]
        for head, rows in ((HEAD, summary_rows(self.summaries)), load_rows(self.outcomes)):
            lines += ["", aligned([head, *rows], [False, *[True] * (len(head) - 1)])]
        return "\n".join([*lines, "", *bad])


def compare(
    settings: str | Path = "default",
    *,
    quick: bool = False,
    records: Sequence[str | Path] = (),
    only: Sequence[str] | None = None,
    changes: Mapping[str, Any] | None = None,
    progress: ProgressOption = True,
) -> Comparison:
    """Run every controller of a comparison on its references, loads and perturbed tables.

    Parameters
    ----------
    settings : config/compare/NAME.yaml or a file.
    quick : two references, one load, four perturbed tables.
    records : accelerograms in place of the synthetic earthquakes.
    only : only these controllers of the settings.
    changes : of keys of the settings, `{"table": "bergamo"}` for another plant.
    progress : whether to show it, or a function to call with it.

    Raises
    ------
    ShakeError
        Unknown names, keys that the settings should not have, a record that cannot be read.

    Examples
    --------
    >>> import shake_ros as sr
    >>> sr.compare(only=["PD"])
    Traceback (most recent call last):
        ...
    shake_ros.core.quantities.UnknownName: ...
    """
    setup = load_setup(str(settings), changes)
    chosen = _chosen(setup, only)
    with Progress("compare", progress) as bar:
        tracks = _courses(setup, quick, records)
        names = [c.name for c in tracks]
        drawn = setup.settings["figure_reference"] if setup.settings["figure_reference"] in names else names[-1]
        bar.span(0.0, 0.1)
        bar("virtual tables", 0.0)
        todo = _cases(setup, chosen, tracks, quick)
        bar.span(0.1, 1.0)
        outcomes, runs = _run(setup, todo, drawn, bar)
    place = f"reference {drawn}, {setup.settings['figure_load']:g} kg"
    return Comparison({**setup.settings, "references": names}, setup.words(), outcomes, runs, place)


def _chosen(setup: Setup, labels: Sequence[str] | None) -> list[Combination]:
    """The combinations of the settings, or those named."""
    known = combinations(setup)
    for label in labels or ():
        if label not in [c.label for c in known]:
            raise unknown_name("controller", label, [c.label for c in known], setup.where)
    return [c for c in known if labels is None or c.label in labels]


def _courses(setup: Setup, quick: bool, records: Sequence[str | Path]) -> list[Course]:
    """References of the settings; records take the place of its earthquakes."""
    names = setup.settings["quick" if quick else "references"]
    found = setup.courses(names["references"] if quick else names)
    if records:
        found = [c for c in found if c.part.frequency > 0.0] + setup.records([str(record) for record in records])
    return found


def _cases(setup: Setup, chosen: Sequence[Combination], tracks: Sequence[Course], quick: bool) -> list[Case]:
    """Every combination on every reference and load, and on the perturbed tables with the references in turn."""
    small = setup.settings["quick"]
    loads = small["loads"] if quick else setup.settings["loads"]
    others = setup.perturbed(int(small["count"] if quick else setup.settings["perturbed"]["count"]))
    delay = int(setup.settings["delay"])
    result = []
    for entry in chosen:
        for load in loads:
            table = setup.table(load)
            for course in tracks:
                result.append(Case(setup.loop(entry, course, load, table, delay), entry.label, course, load, -1))
        for i, (load, table) in enumerate(others):
            course = tracks[i % len(tracks)]
            result.append(Case(setup.loop(entry, course, load, table, 0), entry.label, course, load, i))
    return result


def _run(
    setup: Setup, todo: Sequence[Case], drawn: str, bar: Callable[[str, float], None]
) -> tuple[list[Outcome], dict[str, ClosedLoop]]:
    """Outcomes of all cases, and the runs of the case that is drawn by controller."""
    kept: dict[str, ClosedLoop] = {}
    load = setup.settings["figure_load"]

    def outcome(index: int, run: ClosedLoop) -> Outcome:
        case = todo[index]
        if case.table < 0 and case.load == load and case.course.name == drawn:
            kept[case.entry] = run
        limit, stroke = case.loop.controller.parameters.limit, case.loop.table.body.stroke
        return Outcome(case.entry, case.course.name, case.load, case.table, judge(run, case.course.part, limit, stroke))

    loops = [case.loop for case in todo]
    found = run_batch(loops, outcome, lambda count: bar(todo[count - 1].entry, count / len(todo)))
    return found, {case.entry: kept[case.entry] for case in todo if case.entry in kept}
