"""`demo`: the main job end to end: measured data, the loop over DDS, the missing effect, tracking before and after."""

from __future__ import annotations

import json
import shutil
import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from shake_ros.api.demo_runs import RUNS, Hidden, hide, record_run, tracking
from shake_ros.api.fitted import names_of
from shake_ros.api.measured_runs import ALL, fit_runs, read_problem
from shake_ros.api.progress import Progress, Told
from shake_ros.api.unseen import with_test
from shake_ros.core.discovery.close_loop import LoopClosure, close_loop
from shake_ros.core.identification.recordings import Record
from shake_ros.core.measured_harmonics.variants import MeasuredRuns
from shake_ros.core.quantities import ShakeError
from shake_ros.data.fit_records import fit_records
from shake_ros.data.recordings import TableRecording, read_table_recording
from shake_ros.data.results import close_loop_json, write_folder, write_json
from shake_ros.declared import model_structure
from shake_ros.settings import find, load_search, load_table, read_yaml, save_table

if TYPE_CHECKING:
    from shake_ros.report.demo_page import Tracking


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
    progress: Told = True,
) -> Demo:
    """The main job end to end; it needs ROS 2.

    The measured runs of the real table; a simulated table with a hidden effect recorded over DDS; the loop closed on
    the recordings; the same earthquake tracked with the model before and with the model after.

    Parameters
    ----------
    out : result folder; an earlier demo's is replaced. seed : chooses the hidden effect and the table's own values.
    hidden : hide this effect instead. figures, command : as of `Discovery.report`.
    progress : show it, or a function to tell.

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
    settings = read_yaml(find("demo", "demo"))
    table = hide(settings, seed, hidden)

    def fill(work: Path) -> None:
        _run(work, settings, table, bar, started, figures, command)

    with Progress("demo", progress) as bar:
        write_folder(folder, fill, force=True)
    return Demo(folder, json.loads((folder / "summary.json").read_text(encoding="utf-8")))


def check_output(out: Path) -> None:
    """Refuse to replace what is not an earlier demo's result."""
    if out.exists() and not (out / "summary.json").is_file() and not (out.is_dir() and not any(out.iterdir())):
        raise ShakeError(f"{out}: exists already and is no demo's result; name another folder with --out")


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
    from shake_ros.report.demo_page import Tracking, demo_page, tracks_of
    from shake_ros.report.figures_demo import overview
    from shake_ros.report.written import write_page

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
    before = recordings["earthquake"]
    tracks = Tracking(before, again, tracking(before), tracking(again))
    summary = summarise(runs, hidden, result, tracks, time.monotonic() - started)
    write_json(folder / "summary.json", summary)
    content = close_loop_json(result, names_of(learn), names_of(hold), "full", names_of(test))
    write_json(folder / "close_loop.json", content)
    write_page(demo_page(runs, hidden.effect, result, learn, hold, test, tracks, summary, command), folder, figures)
    (folder / "overview.png").write_bytes(overview(runs, result, hold, tracks_of(tracks)))
    (folder / "summary.txt").write_text(lines(summary, tracks), encoding="utf-8")


def close(
    settings: Mapping[str, Any], recordings: Mapping[str, TableRecording], bar: Progress
) -> tuple[LoopClosure, list[Record], list[Record]]:
    """Step 3: fit the declared model to the recordings, find and add what it lacks."""
    learn, hold = fit_records(recordings["excitation"]), fit_records(recordings["earthquake"])
    model = model_structure(load_table(settings["declared"]))
    return close_loop(model, learn, hold, load_search().replace(most_effects=2), bar), learn, hold


def summarise(
    runs: MeasuredRuns, hidden: Hidden, result: LoopClosure, tracks: Tracking, seconds: float
) -> dict[str, Any]:
    """Content of summary.json."""
    steps = result.search.steps
    return {
        "harmonics": {"baseline_rms": runs.declared.rms, "effect": runs.best.effect, "final_rms": runs.best.rms},
        "hidden": {
            "effect": hidden.effect,
            "named": steps[0].chosen.candidate.effect if steps else None,
            "alternatives": list(steps[0].alternatives) if steps else [],
            "hold_before": mean_error(result.baseline.validation),
            "hold_after": mean_error(result.final.validation),
            "test_before": mean_error(result.baseline.test),
            "test_after": mean_error(result.final.test),
        },
        "tracking": {"before": tracks.error_before["position"], "after": tracks.error_after["position"]},
        "seconds": round(seconds, 1),
    }


def mean_error(errors: Mapping[str, Mapping[str, float]]) -> float:
    """Mean acceleration error over recordings; of the velocity where there is no accelerometer."""
    return float(np.mean([e.get("acceleration", e["velocity"]) for e in errors.values()]))


def lines(summary: Mapping[str, Any], tracks: Tracking) -> str:
    """The summary for a terminal."""
    h, d, t = summary["harmonics"], summary["hidden"], summary["tracking"]
    verdict = "right" if d["named"] == d["effect"] else "not the hidden one"
    return (
        f"measured runs:  {h['baseline_rms']:.3f} → {h['final_rms']:.3f} m/s² rms "
        f"with {h['effect'] or 'nothing added'}\n"
        f"hidden effect:  {d['effect']}; named: {d['named'] or 'nothing'} ({verdict})\n"
        f"validation:     {100 * d['hold_before']:.2f} → {100 * d['hold_after']:.2f} % of the acceleration\n"
        f"test:           {100 * d['test_before']:.2f} → {100 * d['test_after']:.2f} % of the acceleration\n"
        f"tracking error: {100 * t['before']:.2f} → {100 * t['after']:.2f} % of the position, "
        f"{100 * tracks.error_before['velocity']:.2f} → {100 * tracks.error_after['velocity']:.2f} % of the velocity\n"
        f"seconds:        {summary['seconds']:.0f}\n"
    )
