"""`follow`: the twin over recordings, off line: each parameter over time, changes with their names, a page."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from shake_ros.api.progress import Progress, ProgressOption
from shake_ros.api.read import Data, recordings
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.quantities import ShakeError
from shake_ros.recordings.bags import TableRecording
from shake_ros.report.page import Page, Result
from shake_ros.report.result_table import ResultTable, percent
from shake_ros.settings import load_table, save_table
from shake_ros.twin.followed import TwinSettings, load_twin
from shake_ros.twin.months import DAY, Readings, readings
from shake_ros.twin.naming import Hypothesis
from shake_ros.twin.page import A_DATE, change_text, follow_page, instant, month_lines
from shake_ros.twin.twin import LEARNING, NO_MOTION, Change, Twin, TwinWindow

SCHEMA = "shake_ros.follow/1"
LATEST = 3  # windows whose motion is kept
SAME_RATE = 1e-3  # part by which sample times of recordings may differ


@dataclass(frozen=True, repr=False)
class Following(Result):
    """One table over its recordings.

    Attributes
    ----------
    names, units : of the followed parameters. windows : in the order of time, without their motion.
    latest : the last windows with motion. changes : with their names.
    reference, table : as known at the end of the reference, and at the end.
    error : of the acceleration in free runs of the reference [-].
    recordings : that were followed.
    months : each parameter from day to day, where the recordings are of several days.
    limits : of each parameter, beyond which maintenance is due.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    windows: Sequence[TwinWindow]
    latest: Sequence[TwinWindow]
    changes: Sequence[Change]
    reference: TableParameters
    table: TableParameters
    error: float
    recordings: Sequence[TableRecording]
    months: tuple[Readings, ...]
    limits: Sequence[tuple[float, float]]

    @property
    def known(self) -> list[TwinWindow]:
        """The windows from the end of the reference on."""
        learning = [i for i, w in enumerate(self.windows) if w.state == LEARNING]
        return list(self.windows[learning[-1] + 1 if learning else 0 :])

    @property
    def parameters(self) -> ResultTable:
        """Each followed parameter at the end of the reference and at the end, with its 90 % interval."""
        first, last = self.known[0], self.known[-1]
        rows = list(zip(self.names, first.values, last.values, *last.ends, self.units, strict=True))
        return ResultTable(("parameter", "reference", "now", "low", "high", "unit"), rows)

    @property
    def events(self) -> ResultTable:
        """The changes, a row each."""
        rows = [
            (
                instant(c.since, c.recording, c.at),
                c.named.verdict,
                _name(c),
                c.named.place,
                *c.named.error,
                change_text(c),
            )
            for c in self.changes
        ]
        heads = ("since", "verdict", "change", "place", "error before", "since then", "with it", "in words")
        return ResultTable(heads, rows, dict.fromkeys(heads[4:7], percent))

    @property
    def lines(self) -> list[str]:
        """What happened, a line for each change and each pause."""
        pauses = [f"paused, {instant(w.start, w.recording, w.at)}: {w.note}" for w in self.windows if w.note]
        rows = zip(self.months, self.limits, strict=True) if self.months else ()
        months = [line for readings, limits in rows for line in month_lines(readings, limits)]
        return ([*map(change_text, self.changes), *pauses] or ["no change"]) + months

    @property
    def page(self) -> Page:
        """The changes and what to do about them, each parameter over time."""
        return follow_page(self)

    def files(self, work: Path, _: Path, /) -> None:
        """Write table.yaml, the table as it is known at the end."""
        save_table(work / "table.yaml", self.table, f"As followed over {', '.join(r.name for r in self.recordings)}.")

    def content(self) -> dict[str, Any]:
        """Content of report.json."""
        return {
            "schema": SCHEMA,
            "parameters": [{"name": n, "unit": u} for n, u in zip(self.names, self.units, strict=True)],
            "reference_error": self.error,
            "windows": [_window_json(w) for w in self.windows],
            "changes": [_change_json(c) for c in self.changes],
            "months": [_months_json(*row) for row in zip(self.months, self.limits, strict=False)],
        }


def _name(change: Change) -> str:
    named = change.named
    return " or ".join(h.name for h in (named.best, *named.rivals)) if named.explained else "unexplained"


def _months_json(r: Readings, limits: tuple[float, float]) -> dict[str, Any]:
    due = r.due(*limits)
    return {
        "name": r.name,
        "unit": r.unit,
        "stamps": r.stamps.tolist(),
        "values": r.values.tolist(),
        "deviations": r.deviations.tolist(),
        "steps": [{"since": int(r.stamps[k]), "size": size, "deviation": d} for k, size, d in r.steps],
        "trend": dict(zip(("per_day", "deviation"), r.trend, strict=True)) if r.trend else None,
        "maintenance": [int(r.stamps[0] + d * DAY) if math.isfinite(d) else None for d in due] if due else None,
    }


def _window_json(w: TwinWindow) -> dict[str, Any]:
    return {
        "recording": w.recording,
        "at": w.at,
        "start": w.start,
        "stop": w.stamp,
        "state": w.state,
        "note": w.note,
        "values": w.values.tolist(),
        "deviations": w.deviations.tolist(),
        "mean_square": w.square,
    }


def _change_json(c: Change) -> dict[str, Any]:
    before, after, left = c.named.error
    return {
        "recording": c.recording,
        "at": c.at,
        "since": c.since,
        "noticed": c.noticed,
        "score": c.score,
        "verdict": c.named.verdict,
        "explained": c.named.explained,
        "place": c.named.place,
        "best": _hypothesis_json(c.named.best),
        "rivals": [_hypothesis_json(h) for h in c.named.rivals],
        "acceleration_error": {"before": before, "since": after, "with": left},
        "text": change_text(c),
    }


def _hypothesis_json(h: Hypothesis) -> dict[str, Any]:
    return {
        "name": h.name,
        "parameter": h.parameter,
        "place": h.place,
        "unit": h.unit,
        "before": h.before,
        "value": h.after,
        "deviation": h.deviation,
        "evidence": h.evidence,
        "followed": h.followed,
    }


def follow(
    runs: Data,
    table: str | Path | TableParameters,
    *,
    settings: str | TwinSettings = "default",
    progress: ProgressOption = True,
) -> Following:
    """Follow the parameters of a found table over recordings, and name what changed.

    Parameters
    ----------
    runs : recordings of one table or their paths, in the order of time, with valve command, position and acceleration.
    table : as `close_loop` found it: its table.yaml, a name of config/table, or the table itself.
    settings : a name of config/twin, a YAML file, or the settings.
    progress : show it, or a function to call with what is being done and the part done.

    Raises
    ------
    ShakeError
        A recording lacks a topic, sample times differ, too little moves, or the table is another one.
    """
    declared, found = load_table(table), recordings(runs)
    if not found:
        raise ShakeError("no recording to follow")
    chosen = load_twin(settings) if isinstance(settings, str) else settings
    twin = Twin(declared, chosen, found[0].sample_time)
    windows, latest = list[TwinWindow](), list[TwinWindow]()
    done, total = 0, sum(len(r) for r in found)
    with Progress("follow", progress) as bar:
        for r in found:
            for w in _over(twin, r):
                windows.append(replace(w, motion=NO_MOTION))
                latest = [*latest, w][-LATEST:] if len(w.motion) else latest
                bar(f"{r.name}: {w.state}", min((done + _place(r, w)) / total, 1.0))
            done += len(r)
        last = twin.finish()
    if math.isnan(twin.error):
        moving = sum(w.state == LEARNING for w in windows) * chosen.test.window
        raise ShakeError(f"{chosen.test.reference:g} s of motion show what is normal; the recordings hold {moving:g} s")
    every = [w.change for w in windows if w.change] + ([last] if last else [])
    changes = list({c.since: c for c in every}.values())  # of one that was named again, its latest name
    rows = zip(twin.names, twin.scale, strict=True)
    limits = [chosen.parameters[n].limits(twin.file_value(n), float(unit)) for n, unit in rows]
    learning = max(i for i, w in enumerate(windows) if w.state == LEARNING)
    months = readings(windows[learning + 1 :], twin.names, twin.units, A_DATE)
    return Following(
        *(twin.names, twin.units, windows, latest, changes, twin.reference, twin.table, twin.error, tuple(found)),
        *(months, limits),
    )


def _place(recording: TableRecording, window: TwinWindow) -> float:
    return (window.stamp - recording.provenance.start_stamp) * 1e-9 / recording.sample_time


def _over(twin: Twin, recording: TableRecording) -> Iterator[TwinWindow]:
    """The windows of a recording."""
    if recording.acceleration is None or not recording.position_measured:
        topic = "imu" if recording.position_measured else "joint_states"
        raise ShakeError(f"{recording.name}: no topic {topic}, which the twin needs")
    if abs(recording.sample_time / twin.sample_time - 1.0) > SAME_RATE:
        raise ShakeError(
            f"{recording.name}: a sample every {recording.sample_time:g} s, the first recording's "
            f"every {twin.sample_time:g} s"
        )
    twin.begin(recording.name)
    stamps = recording.provenance.start_stamp + np.rint(recording.time * 1e9).astype(np.int64)
    yield from twin.add(stamps, recording.valve_command, recording.position, recording.acceleration)
