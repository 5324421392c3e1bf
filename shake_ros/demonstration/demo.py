"""`demo`: the main job end to end: recordings over DDS, the missing effect, tracking before and after."""

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
from shake_ros.core.identification.recordings import Record
from shake_ros.core.plant.parameters import TableParameters
from shake_ros.core.quantities import ShakeError, unknown_name
from shake_ros.data.fit_records import fit_records
from shake_ros.data.recordings import TableRecording, read_table_recording
from shake_ros.data.result_folder import new_folder, write_json
from shake_ros.data.results import close_loop_json
from shake_ros.declared import model_structure
from shake_ros.measured.models import MeasuredRuns
from shake_ros.measured.runs import ALL, fit_runs, read_problem
from shake_ros.report.close_loop_page import MODELS, mean_error
from shake_ros.search.close_loop import LoopClosure, close_loop
from shake_ros.settings import find, load_search, load_table, read_yaml, save_table

if TYPE_CHECKING:
    from shake_ros.demonstration.page import DemoResult


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
    from shake_ros.ros.graph import Experiment, record

    carried = str(model.resolve()) if isinstance(model, Path) else model  # a relative one would lie beside these files
    role = "excitation" if name == "excitation" else "earthquake"
    paths = {}
    for kind in ("observer", "controller"):
        content = {**read_yaml(find(kind, settings[kind])), "model": carried}
        paths[kind] = work / f"{kind}_{name}.yaml"
        paths[kind].write_text(yaml.safe_dump(content), encoding="utf-8")
    experiment = Experiment(
        str(work / "hidden_table.yaml"),
        settings[role],
        str(paths["observer"]),
        str(paths["controller"]),
        seed=len(RUNS) * hidden.seed + RUNS.index(name),
        duration=DURATION[role],
    )
    record(experiment, work / name, lambda part: bar(f"{name} over DDS", part))
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
    hidden : hide this effect instead.
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
    shake_ros.core.quantities.ShakeError: --seed -1: must not be negative
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
    from shake_ros.demonstration.page import DemoResult, demo_page, overview, track_of
    from shake_ros.report.page import write_page

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
        result, learn, hold = close(settings, recordings, bar)
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
    write_page(demo_page(found, summary, command), folder, figures)
    (folder / "overview.png").write_bytes(overview(found))
    (folder / "summary.txt").write_text(lines(found, summary), encoding="utf-8")


def close(
    settings: Mapping[str, Any], recordings: Mapping[str, TableRecording], bar: Progress
) -> tuple[LoopClosure, list[Record], list[Record]]:
    """Step 3: fit the declared model to the recordings, find and add what it lacks."""
    learn, hold = fit_records(recordings["excitation"]), fit_records(recordings["earthquake"])
    model = model_structure(load_table(settings["declared"]))
    return close_loop(model, learn, hold, load_search(), bar), learn, hold


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


def lines(found: DemoResult, summary: Mapping[str, Any]) -> str:
    """The summary for a terminal."""
    h, d, t = summary["harmonics"], summary["hidden"], summary["tracking"]
    before, after = (track.errors["velocity"] for track in found.tracks.values())
    verdict = "right" if d["named"] == d["effect"] else "not the hidden one"
    return (
        f"measured runs:  {h['baseline_rms']:.3f} → {h['final_rms']:.3f} m/s² rms "
        f"with {h['effect'] or 'nothing added'}\n"
        f"hidden effect:  {d['effect']}; named: {d['named'] or 'nothing'} ({verdict})\n"
        f"validation:     {100 * d['hold_before']:.2f} → {100 * d['hold_after']:.2f} % of the acceleration\n"
        f"test:           {100 * d['test_before']:.2f} → {100 * d['test_after']:.2f} % of the acceleration\n"
        f"tracking error: {100 * t['before']:.2f} → {100 * t['after']:.2f} % of the position, "
        f"{100 * before:.2f} → {100 * after:.2f} % of the velocity\n"
        f"seconds:        {summary['seconds']:.0f}\n"
    )


def demo_command(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    command = CommandLine("demo")
    command.add_argument("--out", type=Path, default=Path("out/demo"), metavar="DIR", help="result folder")
    command.add_argument("--seed", type=int, default=1, help="chooses the hidden effect and the table's own values")
    command.add_argument("--hidden", metavar="EFFECT", help="hide this effect instead of the one the seed chooses")
    command.add_figures()
    given = command.parse_args(arguments)
    try:
        result = demo(given.out, seed=given.seed, hidden=given.hidden, **reporting("demo", given, arguments))
    except RuntimeError as error:  # a node of the graph died or is stuck
        print(f"shake_ros demo: {error}", file=sys.stderr)
        return 1
    print(result, end="")
    print(f"report: {given.out / 'report.html'}")
    return 0
