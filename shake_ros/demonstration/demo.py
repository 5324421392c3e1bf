"""`demo`: the main job end to end: recordings over DDS, the missing effect, tracking before and after; its page."""

from __future__ import annotations

import json
import math
import shutil
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import yaml

from shake_ros.api.fitted import names_of, with_test
from shake_ros.api.progress import Progress, ProgressOption
from shake_ros.cli.arguments import CommandLine, reporting
from shake_ros.control.closed_loop import normalised_error
from shake_ros.declared import model_structure
from shake_ros.fit.records import Record
from shake_ros.measured.models import MeasuredRuns
from shake_ros.measured.page import harmonics_chart
from shake_ros.measured.runs import ALL, fit_runs, read_problem
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.quantities import ShakeError, unknown_name
from shake_ros.recordings.bags import TableRecording, read_table_recording
from shake_ros.recordings.fit_records import fit_records
from shake_ros.repair.close_loop import LoopClosure, close_loop
from shake_ros.report.close_loop_page import MODELS, effect_text, mean_error, model_sections
from shake_ros.report.page import Bar, Page, write_page
from shake_ros.report.report_json import close_loop_json, found_effects
from shake_ros.report.result_table import percent
from shake_ros.report.sections import Track, parameters_side_by_side, sources_of, tracking_section
from shake_ros.report.text import sentence
from shake_ros.result_folder import new_folder, write_json
from shake_ros.settings import find, load_search, load_table, read_yaml, save_table

if TYPE_CHECKING:
    pass

DURATION = {"excitation": 11.0, "earthquake": 12.0}  # of the recordings [s]
RUNS = ("excitation", "earthquake", "earthquake_again")  # recorded, each with sensor noise of its own


@dataclass(frozen=True)
class Hidden:
    """The simulated table and the effect hidden in it."""

    effect: str
    table: TableParameters
    seed: int


def hide(settings: Mapping[str, Any], seed: int, effect: str | None) -> Hidden:
    """Draw a table of its own from the seed, with one hidden effect."""
    if seed < 0:
        raise ShakeError(f"--seed {seed}: must not be negative")
    rng = np.random.default_rng(seed)
    table = load_table(settings["declared"])
    values = dict(settings["numerics"])
    for name, (low, high) in settings["spread"].items():
        values[name] = table.value(name) * math.exp(rng.uniform(math.log(low), math.log(high)))
    names = sorted(settings["hidden"])
    chosen = effect or names[int(rng.integers(len(names)))]
    if chosen not in settings["hidden"]:
        raise unknown_name("hidden effect", chosen, names)
    values.update({f"effects.{chosen}.{k}": v for k, v in settings["hidden"][chosen].items()})
    return Hidden(chosen, table.with_values(values), seed)


def record_run(
    work: Path, name: str, settings: Mapping[str, Any], hidden: Hidden, model: str | Path, bar: Progress
) -> Path:
    """One recorded run over DDS with observer and controller carrying `model`; returns the bag's folder.

    Parameters
    ----------
    work : folder of the bag and of what the run needs.
    model : a name of config/table, or the path of a file.
    """
    from shake_ros.ros.graph import record

    carried = str(model.resolve()) if isinstance(model, Path) else model  # a relative one would lie beside these files
    role = "excitation" if name == "excitation" else "earthquake"
    paths = {}
    for kind in ("observer", "controller"):
        content = {**read_yaml(find(kind, settings[kind])), "model": carried}
        path = work / f"{kind}_{name}.yaml"
        path.write_text(yaml.safe_dump(content), encoding="utf-8")
        paths[kind] = str(path)
    record(
        work / name,
        table=str(work / "hidden_table.yaml"),
        reference=settings[role],
        observer=paths["observer"],
        controller=paths["controller"],
        seed=len(RUNS) * hidden.seed + RUNS.index(name),
        duration=DURATION[role],
        progress=lambda part: bar(f"{name} over DDS", part),
    )
    return work / name


@dataclass(frozen=True)
class Demo:
    """What the demo left. folder : with report.html and the recordings. summary : content of summary.json."""

    folder: Path
    summary: Mapping[str, Any]

    def __str__(self) -> str:
        return (self.folder / "summary.txt").read_text(encoding="utf-8")


def demo(
    out: str | Path = "out/demo",
    *,
    seed: int = 1,
    hidden: str | None = None,
    figures: str | None = None,
    command: str = "",
    progress: ProgressOption = True,
) -> Demo:
    """The main job end to end; it needs ROS 2.

    The measured runs of the real table; a simulated table with a hidden effect recorded over DDS; the model
    repaired with the recordings; the same earthquake tracked with the model before and with the model after.

    Parameters
    ----------
    out : result folder; an earlier demo's is replaced.
    seed : chooses the hidden effect and the table's own values.
    hidden : hide this effect instead of the one that the seed chooses.
    figures, command : as of `Discovery.report`.
    progress : show it, or a function to call with it.

    Raises
    ------
    ShakeError
        The folder holds something else, the seed is negative, or the demo does not hide this effect.
    RuntimeError
        A node died or is stuck.

    Examples
    --------
    >>> import shake_ros as sr
    >>> sr.demo(seed=-1)
    Traceback (most recent call last):
        ...
    shake_ros.quantities.ShakeError: --seed -1: must not be negative
    """
    folder = Path(out)
    check_output(folder)
    started = time.monotonic()
    settings = read_yaml(find("demo", "default"))
    table = hide(settings, seed, hidden)
    with Progress("demo", progress) as bar, new_folder(folder, force=True) as work:
        _run(work, settings, table, bar, started, figures, command)
    return Demo(folder, json.loads((folder / "summary.json").read_text(encoding="utf-8")))


def check_output(out: Path) -> None:
    """Refuse to replace what is not an earlier demo's result."""
    if out.exists() and not (out / "summary.json").is_file() and not (out.is_dir() and not any(out.iterdir())):
        raise ShakeError(f"{out}: exists already and is not the result of a demo; choose another folder with --out")


def measured_runs(bar: Progress) -> MeasuredRuns:
    """Step 1: the five measured runs of the real table."""
    problem, table = read_problem(find("measured", "harmonics"))
    return fit_runs(problem, table, [ALL], bar)


def _run(
    folder: Path,
    settings: Mapping[str, Any],
    hidden: Hidden,
    bar: Progress,
    started: float,
    figures: str | None,
    command: str,
) -> None:
    bar.span(0.0, 0.25)
    runs = measured_runs(bar)
    with tempfile.TemporaryDirectory(prefix="shake_ros-demo-") as temporary:
        work = Path(temporary)
        save_table(work / "hidden_table.yaml", hidden.table, "The demo's simulated table.")
        recordings: dict[str, TableRecording] = {}
        for i, name in enumerate(("excitation", "earthquake")):
            bar.span(0.25 + 0.1 * i, 0.35 + 0.1 * i)
            recordings[name] = read_table_recording(record_run(work, name, settings, hidden, settings["declared"], bar))
        bar.span(0.45, 0.85)
        learn, hold = fit_records(recordings["excitation"]), fit_records(recordings["earthquake"])
        result = close_loop(model_structure(load_table(settings["declared"])), learn, hold, load_search(), bar)
        save_table(
            folder / "extended_table.yaml", result.final.table, "The declared table, fitted and extended by demo."
        )
        bar.span(0.85, 0.95)
        model = folder / "extended_table.yaml"
        again = read_table_recording(record_run(work, "earthquake_again", settings, hidden, model, bar))
        test = fit_records(again)
        result = with_test(result, test)
        for name in RUNS:
            shutil.move(work / name, folder / f"bag_{name}")  # may be another file system
    bar.span(0.95, 1.0)
    bar("report", 0.0)
    tracks = dict(zip(MODELS, map(track_of, (recordings["earthquake"], again)), strict=True))
    found = DemoResult(runs, hidden.effect, result, learn, hold, test, tracks)
    summary = summarise(found, time.monotonic() - started)
    write_json(folder / "summary.json", summary)
    content = close_loop_json(result, names_of(learn), names_of(hold), "full", names_of(test))
    write_json(folder / "close_loop.json", content)
    page = demo_page(found, summary)
    write_page(page, folder, figures, command=command)
    (folder / "summary.txt").write_text(f"{page.text()}\n", encoding="utf-8")


@dataclass(frozen=True)
class DemoResult:
    """What the demo found."""

    runs: MeasuredRuns  # of the real table, with the models fitted to them
    hidden: str  # name of the hidden effect
    result: LoopClosure  # models before and after, with their errors on test data too
    # learn, hold, test: estimation, validation and test data
    learn: Sequence[Record]
    hold: Sequence[Record]
    test: Sequence[Record]
    # the earthquake with the declared and with the extended model in observer and controller, by name
    tracks: Mapping[str, Track]


def track_of(run: TableRecording) -> Track:
    """The true motion of a recording, and its relative errors behind the reference."""
    assert run.reference is not None and run.truth is not None
    good = np.isfinite(run.reference).all(axis=1) & np.isfinite(run.truth).all(axis=1)
    errors = normalised_error(run.reference[good], run.truth[good]).tolist()
    names = ("position", "velocity", "acceleration")
    return Track(run.time, run.reference, run.truth, dict(zip(names, errors, strict=True)))


def summarise(found: DemoResult, seconds: float) -> dict[str, Any]:
    """Content of summary.json."""
    runs, result, steps = found.runs, found.result, found.result.search.steps
    return {
        "harmonics": {"baseline_rms": runs.declared.rms, "effect": runs.best.effect, "final_rms": runs.best.rms},
        "hidden": {
            "effect": found.hidden,
            "named": steps[0].chosen.candidate.effect if steps else None,
            "alternatives": list(steps[0].alternatives) if steps else [],
            "hold_before": mean_error(result.baseline.validation),
            "hold_after": mean_error(result.final.validation),
            "test_before": mean_error(result.baseline.test),
            "test_after": mean_error(result.final.test),
        },
        "tracking": dict(zip(("before", "after"), (t.errors["position"] for t in found.tracks.values()), strict=True)),
        "seconds": round(seconds, 1),
    }


def measured_section(page: Page, runs: MeasuredRuns) -> None:
    """The five measured runs of the real table."""
    page.heading("Five measured runs of the real table")
    page.paragraph(
        f"{len(runs.problem.measured)} harmonic amplitudes of the acceleration under open-loop sines. The declared "
        f"model (constant bulk modulus) misses them by {runs.declared.rms:.3f} m/s² rms; "
        + (
            f"with {runs.best.name}, by {runs.best.rms:.3f} m/s²."
            if runs.best.name
            else "no extension justifies its extra parameters."
        )
    )
    best = f"with {runs.best.name or 'nothing added'}"
    drawn = [("declared model", runs.amplitudes(runs.declared), "before"), (best, runs.amplitudes(runs.best), "after")]
    page.chart(harmonics_chart(runs.problem, drawn))
    models = [runs.declared, *runs.variants]
    widest = max(v.rms for v in models)
    rows: list[list[str | Bar]] = [
        [v.name or "declared model", Bar(v.rms / widest, f"{v.rms:.3f}"), str(len(v.fit.x)), f"{v.criterion:.1f}"]
        for v in models
    ]
    head = ("model", "rms error [m/s²]", "parameters", "information criterion")
    page.table(head, rows, best=models.index(runs.best), start=0)


def demo_page(found: DemoResult, summary: Mapping[str, Any]) -> Page:
    """The whole page; summary : content of summary.json."""
    runs, result, sets = found.runs, found.result, (found.learn, found.hold, found.test)
    before, after = (track.errors["position"] for track in found.tracks.values())
    named = summary["hidden"]["named"] or "nothing"
    page = Page(
        "Closing the loop with measured data",
        "A simulated table with an effect that the model is missing: recorded over DDS, found from the recordings, "
        "added, and tracked again; and the declared model against harmonics measured on the real table.",
        sources_of(*sets),
    )
    page.heading("What was found, and how certain it is")
    page.cards(
        [
            (named, f"found from the recordings; the hidden effect was {found.hidden}"),
            (
                f"{percent(summary['hidden']['hold_before'])} → {percent(summary['hidden']['hold_after'])}",
                "acceleration error of the free run, validation data",
            ),
            (
                f"{percent(summary['hidden']['test_before'])} → {percent(summary['hidden']['test_after'])}",
                "acceleration error of the free run, test data",
            ),
            (
                f"{percent(before)} → {percent(after)}",
                "position error under the earthquake",
            ),
            (
                f"{runs.declared.rms:.3f} → {runs.best.rms:.3f} m/s²",
                f"error of the real table's harmonics, with {runs.best.name}",
            ),
        ]
    )
    for effect in found_effects(result):
        page.paragraph(effect_text(effect))
    page.paragraph(
        "Plant, reference generator, observer, controller and recorder ran in lock-step as separate processes: "
        f"{sum(len(r.commands) for r in found.learn)} samples of an excitation for estimation and "
        f"{len(found.tracks[MODELS[0]].time)} samples of the earthquake for validation. The earthquake under the "
        "extended model is test data: no decision used it."
    )
    model_sections(page, result, *sets)
    page.heading("What remains")
    page.paragraph(sentence(result.remaining.text))
    page.heading("The same earthquake, tracked with each model")
    page.paragraph(
        "Observer and controller carry a copy of the table's model: in the first run the declared model, in the second "
        "the model identified and extended from the recordings. Errors are those of the true motion against the "
        "reference."
    )
    tracking_section(page, found.tracks)
    page.heading("Parameters")
    parameters_side_by_side(page, dict(zip(MODELS, (result.baseline, result.final), strict=True)))
    measured_section(page, runs)
    return page


def demo_command(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    command = CommandLine("demo")
    command.add_verb(demo, "figures", "command")
    command.add_figures()
    given = command.read(arguments)
    try:
        result = demo(**command.options(given), **reporting(given))
    except RuntimeError as error:  # a node of the graph died or is stuck
        print(f"shake_ros demo: {error}", file=sys.stderr)
        return 1
    print(result, end="")
    print(f"report: {Path(given.out) / 'report.html'}")
    return 0
