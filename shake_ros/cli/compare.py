"""compare: the controllers side by side on the same references, loads and perturbed tables."""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from shake_ros.api.loops import Course, Entry, Plant, entries, load_plant
from shake_ros.cli.progress import Bar
from shake_ros.core.control.closed_loop import ClosedLoop
from shake_ros.core.loop.comparison import Outcome, summarise
from shake_ros.core.loop.compiled import Loop, run_batch
from shake_ros.core.loop.metrics import judge
from shake_ros.core.quantities import ShakeError, unknown_name
from shake_ros.data.comparison import comparison_json
from shake_ros.data.results import write_folder, write_json
from shake_ros.report.comparison_page import comparison_page
from shake_ros.report.comparison_text import HEAD, aligned, load_rows, summary_rows, trouble

QUICK_KEYS = ("references", "loads", "count")


@dataclass(frozen=True)
class Case:
    """One run to be made, and where it stands."""

    loop: Loop
    entry: str
    course: Course
    load: float
    table: int


def parser() -> argparse.ArgumentParser:
    """The command line."""
    p = argparse.ArgumentParser(prog="compare", description=__doc__)
    p.add_argument("--out", type=Path, required=True, metavar="DIR", help="result folder")
    p.add_argument("--quick", action="store_true", help="two references, one load, four perturbed tables")
    p.add_argument("--settings", default="default", metavar="NAME", help="config/compare/NAME.yaml or a file")
    p.add_argument("--record", nargs="+", metavar="FILE", help="accelerograms in place of the synthetic earthquakes")
    p.add_argument("--only", nargs="+", metavar="LABEL", help="these controllers of the settings alone")
    p.add_argument("--force", action="store_true", help="replace DIR")
    return p


def chosen(plant: Plant, labels: Sequence[str] | None) -> list[Entry]:
    """The entries of the settings, or those named."""
    known = entries(plant)
    for label in labels or ():
        if label not in [e.label for e in known]:
            raise unknown_name("controller", label, [e.label for e in known], plant.where)
    return [e for e in known if labels is None or e.label in labels]


def courses(plant: Plant, quick: bool, records: Sequence[str] | None) -> list[Course]:
    """References of the settings; records take the place of its earthquakes."""
    names = plant.settings["quick" if quick else "references"]
    found = plant.courses(names["references"] if quick else names)
    if records:
        found = [c for c in found if c.part.frequency > 0.0] + plant.records(records)
    return found


def cases(plant: Plant, lines: Sequence[Entry], tracks: Sequence[Course], quick: bool) -> list[Case]:
    """Every entry on every reference and load, and on the perturbed tables with the references in turn."""
    small = plant.settings["quick"]
    loads = small["loads"] if quick else plant.settings["loads"]
    others = plant.perturbed(int(small["count"] if quick else plant.settings["perturbed"]["count"]))
    delay = int(plant.settings["delay"])
    result = []
    for entry in lines:
        for load in loads:
            table = plant.table(load)
            for course in tracks:
                result.append(Case(plant.loop(entry, course, load, table, delay), entry.label, course, load, -1))
        for i, (load, table) in enumerate(others):
            course = tracks[i % len(tracks)]
            result.append(Case(plant.loop(entry, course, load, table, 0), entry.label, course, load, i))
    return result


def run_cases(
    plant: Plant, todo: Sequence[Case], drawn: str, tell: Callable[[str, float], None]
) -> tuple[list[Outcome], dict[str, ClosedLoop]]:
    """Outcomes of all cases, and the runs of the case that is drawn by entry."""
    kept: dict[str, ClosedLoop] = {}
    load = plant.settings["figure_load"]

    def outcome(index: int, run: ClosedLoop) -> Outcome:
        case = todo[index]
        if case.table < 0 and case.load == load and case.course.name == drawn:
            kept[case.entry] = run
        parameters = case.loop.controller.parameters
        metrics = judge(run, case.course.part, parameters.limit, case.loop.table.body.stroke)
        return Outcome(case.entry, case.course.name, case.load, case.table, metrics)

    found = run_batch(
        [case.loop for case in todo], outcome, lambda count: tell(todo[count - 1].entry, count / len(todo))
    )
    return found, {case.entry: kept[case.entry] for case in todo if case.entry in kept}


def words(plant: Plant) -> str:
    """The plant in a sentence."""
    s, sensors = plant.settings, plant.table(plant.settings["model_load"]).sensors
    return (
        f"Table {s['table']} with {', '.join(f'{k} = {v:g}' for k, v in s['values'].items())}; "
        f"{1e-3 / s['sample_time']:g} kHz; position with {1e6 * sensors.position_noise:g} µm of noise and "
        f"{sensors.position_bits} bits over {1e3 * sensors.position_range:g} mm; commands {s['delay']} sample late."
    )


def run(given: argparse.Namespace, bar: Bar) -> str:
    """Compare, write the folder, and return what is printed."""
    if given.out.exists() and not given.force:
        raise ShakeError(f"{given.out}: exists already (--force replaces it)")
    began, spent = time.monotonic(), time.process_time()
    plant = load_plant(given.settings)
    lines = chosen(plant, given.only)
    tracks = courses(plant, given.quick, given.record)
    names = [c.name for c in tracks]
    drawn = plant.settings["figure_reference"] if plant.settings["figure_reference"] in names else names[-1]
    bar.span(0.0, 0.1)
    bar("virtual tables", 0.0)
    todo = cases(plant, lines, tracks, given.quick)
    bar.span(0.1, 1.0)
    outcomes, runs = run_cases(plant, todo, drawn, bar)
    summaries = summarise(outcomes)
    settings = {**plant.settings, "references": names}

    def fill(folder: Path) -> None:
        write_json(folder / "compare.json", comparison_json(outcomes, summaries, settings))
        place = f"reference {drawn}, {plant.settings['figure_load']:g} kg"
        (folder / "report.html").write_text(comparison_page(outcomes, runs, place, words(plant)), encoding="utf-8")

    write_folder(given.out, fill, force=given.force)
    bad = trouble(outcomes)
    wall, processor = time.monotonic() - began, time.process_time() - spent
    return "\n".join(
        [
            words(plant),
            "",
            aligned(HEAD, summary_rows(summaries)),
            "",
            aligned(*load_rows(outcomes)),
            "",
            *(bad or ["no run was unstable or touched an end stop"]),
            f"{len(outcomes)} loops in {wall:.0f} s, {processor:.0f} s of processor time",
            f"report: {given.out / 'report.html'}",
        ]
    )


def main(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    given = parser().parse_args(list(arguments))
    with Bar("compare") as bar:
        text = run(given, bar)
    print(text)
    return 0
