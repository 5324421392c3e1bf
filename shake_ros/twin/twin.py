"""The twin: samples of a running table in, windows with parameters and intervals out, and changes with their names.

It begins with a reference: some seconds of motion that show the levels of noise, how far the table is from its file,
and how much estimates scatter where nothing changes. From then on each window corrects the followed parameters (a prior
that wanders slowly, so that what the motion does not excite keeps its value while its interval grows) and is tested
for a change. Numbers that do not wander are estimated with them: they widen the interval of a value, and not that of
its change. A change is named once enough motion has passed, and becomes part of the model.

The same samples give the same numbers, from a recording or from a graph in lock-step.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from shake_ros.fit.likelihood import Levels
from shake_ros.fit.model import FreeModel
from shake_ros.fit.records import Record
from shake_ros.fit.segment import SETTLE, Segment
from shake_ros.physics.plant.parameters import FULL_LAYOUT, TableParameters
from shake_ros.quantities import ShakeError
from shake_ros.twin.change import HOUR, Alarm, NormalSquare, alarm, mean_log, threshold, windows_since
from shake_ros.twin.evidence import (
    FEW,
    KnownState,
    WindowEvidence,
    conditional,
    evidence,
    fitted_to,
    held,
    moves,
    pooled,
    scatter,
    trouble,
)
from shake_ros.twin.followed import Followed, TwinSettings, followed
from shake_ros.twin.naming import ESTABLISHED, Named, Naming, free_run_errors, free_run_shares

LEARNING, WATCHING, NAMING, PAUSED = "learning", "watching", "naming", "paused"
FOREIGN = 0.6  # relative error of the acceleration in free runs, from which a table's file is that of another table
FAR = 10.0  # times the size of a change that matters, within which a changed parameter lies
STEP = 0.05  # of the size of a change that matters, by which a free run is differentiated
LEAST_FELT = 1e-3  # share of the acceleration that one unit of a parameter moves at least [-]
KEPT = 160  # windows
MOST_NAMED = 5  # windows from which a change is named
EXPLAINED = 3.0  # standard normal variable of the innovations' mean square, up to which a change is explained
NO_MOTION = np.zeros((0, 5))
INTERVAL = 1.645  # standard deviations to each side of a 90 % interval


@dataclass(frozen=True)
class Change:
    """A change with its name."""

    # recording, at: in which it came, and how far behind its first sample at the earliest [s]
    recording: str
    at: float
    since: int  # stamp after which it came [ns]
    noticed: int  # stamp of the end of the window that showed it [ns]
    score: float  # standard normal variable of the test
    named: Named


@dataclass(frozen=True)
class TwinWindow:
    """What one window gave."""

    recording: str  # that it is of
    at: float  # of its first sample behind that of the recording [s]
    # start, stamp: of its first sample and behind its last one [ns]
    start: int
    stamp: int
    state: str  # learning, watching, naming or paused
    note: str  # why it pauses; else empty
    # values, deviations: of the followed parameters, shape (p,), in their units
    values: np.ndarray
    deviations: np.ndarray
    moved: np.ndarray  # standard deviation of their change since the reference, shape (p,)
    square: float  # mean square of the whitened innovations, NaN while nothing is known [-]
    motion: np.ndarray  # predicted and measured from the first sample on, shape (n, 5) or (0, 5), as in WindowEvidence
    change: Change | None = None  # that was named with it

    @property
    def ends(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper ends of the 90 % intervals of the followed parameters, each of shape (p,)."""
        return self.values - INTERVAL * self.deviations, self.values + INTERVAL * self.deviations


@dataclass(frozen=True)
class _Normal:
    """What the reference has shown: levels of noise, inflation of the variance, mean square of the innovations, error
    of free runs, loudness, the table, and the variance of what does not matter, shape (p,)."""

    levels: Levels
    inflation: float
    square: NormalSquare
    error: float
    loudness: float
    table: TableParameters
    apart: np.ndarray


@dataclass(frozen=True)
class _Onset:
    """Where a change came, with the twin's state before it."""

    since: int  # stamp after which it came [ns]
    model: FreeModel
    known: KnownState
    normal: _Normal
    before: Sequence[Record]  # the latest windows before it
    left: TableParameters | None
    change: Change | None = None  # as it was reported, if it was


class Twin:
    """Follows one table.

    Parameters
    ----------
    table : as found. settings : of config/twin. sample_time : [s].

    Raises
    ------
    ShakeError : of a table that is not one of the full model.
    """

    def __init__(self, table: TableParameters, settings: TwinSettings, sample_time: float) -> None:
        if table.layout is not FULL_LAYOUT:
            raise ShakeError(f"the twin follows tables of the model full, not of {table.layout.name}")
        self.file, self.settings, self.sample_time = table, settings, sample_time
        self.followed: Followed = followed(table, settings)
        self._count = p = len(self.followed.walk)
        self._walk = np.concatenate([self.followed.walk, np.zeros(len(self.followed.model.x) - p)])
        self._known = KnownState(self.followed.model.x, np.diag(self.followed.file**2))
        self._model: FreeModel = self.followed.model
        self._window = round(settings.test.window / sample_time)
        self._lead = round(SETTLE / sample_time)
        self._limit = threshold(settings.test.false_alarms, settings.test.window, p + 1)
        self._normal: _Normal | None = None
        self._waiting: list[tuple[Record, int]] = []
        self._history: list[tuple[KnownState, WindowEvidence, int, float]] = []
        self._alarm: tuple[Alarm, int] | None = None
        self._left: TableParameters | None = None
        self._onset: _Onset | None = None
        self._last = 0  # stamp behind the latest sample [ns]
        self.begin("")

    @property
    def names(self) -> tuple[str, ...]:
        """Dotted names of the followed parameters."""
        return self._model.names[: self._count]

    @property
    def units(self) -> tuple[str, ...]:
        """Their units."""
        return tuple(p.unit for p in self._model.free[: self._count])

    def file_value(self, name: str) -> float:
        """Value of a followed parameter in the table's file; what only the sensors have is nothing there."""
        return self.file.value(name) if name in FULL_LAYOUT.fields else 0.0

    @property
    def scale(self) -> np.ndarray:
        """What counts as one of each: the value in the file, or its scale where that is larger, shape (p,)."""
        return self._model.scale[: self._count]

    @property
    def table(self) -> TableParameters:
        """The table as it is now known; after a change that is not established, and that no followed parameter may
        be, as it was known before."""
        return self._left or self._model.at(self._known.mean).found_table()

    @property
    def reference(self) -> TableParameters:
        """The table as the reference has shown it; as given before its end."""
        return self._normal.table if self._normal else self._model.table

    @property
    def error(self) -> float:
        """Relative error of the acceleration in free runs of the reference [-]; NaN before its end."""
        return self._normal.error if self._normal else math.nan

    def _empty(self, recording: str) -> None:
        self._recording = recording
        self._stamps = np.zeros(0, dtype=np.int64)
        self._samples = np.zeros((0, 3))
        self._command_before = 0.0

    def begin(self, recording: str) -> None:
        """Samples that come now belong to another recording."""
        self._empty(recording)
        self._origin = -1

    def add(
        self, stamps: np.ndarray, commands: np.ndarray, position: np.ndarray, acceleration: np.ndarray
    ) -> Iterator[TwinWindow]:
        """The windows that the next samples complete.

        A sample that is missing or not finite ends a stretch, and the next window begins behind it.

        Parameters
        ----------
        stamps, commands, position, acceleration : shape (n,) [ns], [-], [m], [m/s²].
        """
        if self._origin < 0 and len(stamps):
            self._origin = int(stamps[0])
            yield from self._away()
        rows = np.column_stack([commands, position, acceleration])
        every = np.concatenate([self._stamps[-1:], stamps])
        period = self.sample_time * 1e9
        apart = np.abs(np.diff(every) / period - 1.0) > 0.5
        apart = apart if len(self._stamps) else np.concatenate([[False], apart])
        good = np.isfinite(rows).all(axis=1)
        cuts = np.flatnonzero(apart | ~good | np.concatenate([[False], ~good[:-1]]))
        for first, last in zip([0, *cuts], [*cuts, len(rows)], strict=True):
            if first in cuts:
                missed = (int(stamps[first]) - int(self._stamps[-1])) * 1e-9 if len(self._stamps) else 0.0
                self._empty(self._recording)
                if apart[first] and abs(missed) > SETTLE:
                    yield self._without(int(stamps[first]), int(stamps[first]), f"no samples for {missed:.2f} s")
            if first < last and good[first]:
                self._stamps = np.concatenate([self._stamps, stamps[first:last]])
                self._samples = np.vstack([self._samples, rows[first:last]])
                yield from self._complete()

    def finish(self) -> Change | None:
        """Name a change that was noticed, from the motion there is: nothing more comes."""
        return self._name(*self._alarm) if self._alarm else None

    def _away(self) -> Iterator[TwinWindow]:
        """A recording that begins long after the one before: a change is named from the motion that there was, and
        values may have wandered, at most as far as those of a file."""
        seconds = (self._origin - self._last) * 1e-9
        if not self._last or self._normal is None or seconds < KEPT * self.settings.test.window:
            return
        if self._alarm:
            change = self._name(*self._alarm)
            yield self._reported(self._last, self._last, change=change)
        self._known, self._history = self._wandered(self._known, seconds), []

    def _complete(self) -> Iterator[TwinWindow]:
        """The windows that the samples at hand complete."""
        size = self._lead + self._window
        while len(self._stamps) >= size:
            stamps, rows = self._stamps[:size], np.ascontiguousarray(self._samples[:size].T)
            record = Record(
                self._recording, self.sample_time, rows[0], rows[1], rows[2], command_before=self._command_before
            )
            self._command_before = float(rows[0, self._window - 1])
            self._stamps, self._samples = self._stamps[self._window :], self._samples[self._window :]
            start, stop = int(stamps[self._lead]), int(stamps[-1]) + round(self.sample_time * 1e9)
            self._last = stop
            why = trouble(record)
            yield self._without(start, stop, why) if why or not moves(record) else self._with(record, start, stop)

    def _without(self, start: int, stop: int, why: str) -> TwinWindow:
        """A window that shows nothing: values stay, intervals grow."""
        self._grow(stop - start)
        return self._reported(start, stop, why)

    @property
    def _state(self) -> str:
        return LEARNING if self._normal is None else NAMING if self._alarm else WATCHING

    def _grow(self, nanoseconds: int) -> None:
        if self._normal is not None:
            self._known = self._wandered(self._known, nanoseconds * 1e-9)

    def _wandered(self, known: KnownState, seconds: float) -> KnownState:
        """What is known after some seconds in which values may have wandered, at most as far as those of a file.

        A recorder whose clock begins anew tells no time between.
        """
        most = np.maximum(self.followed.file**2 - np.diag(known.covariance), 0.0)
        gained = np.minimum(self._walk**2 * max(seconds, 0.0) / HOUR, most)
        return KnownState(known.mean, known.covariance + np.diag(gained))

    def _reported(
        self, start: int, stop: int, note: str = "", seen: WindowEvidence | None = None, change: Change | None = None
    ) -> TwinWindow:
        p, covariance = self._count, self._known.covariance
        scale, values = self._model.scale[:p], self._known.mean[:p] * self._model.scale[:p]
        apart = self._normal.apart[:p] if self._normal else 0.0
        deviations = np.sqrt(np.diag(covariance)[:p] + apart) * scale
        moved = np.sqrt(np.diag(conditional(covariance, p)) + apart) * scale
        at, state = (start - self._origin) * 1e-9, PAUSED if note else self._state
        square, motion = (seen.square, seen.motion) if seen else (math.nan, NO_MOTION)
        return TwinWindow(
            self._recording, at, start, stop, state, note, values, deviations, moved, square, motion, change
        )

    def _with(self, record: Record, start: int, stop: int) -> TwinWindow:
        """A window of motion."""
        self._grow(stop - start)
        if self._normal is None:
            self._waiting.append((record, stop))
            if len(self._waiting) * self.settings.test.window >= self.settings.test.reference:
                self._learn()
            return self._reported(start, stop)
        seen = self._evidence(record, self._normal.levels, self._normal.loudness)
        self._history = [*self._history[-KEPT:], (self._known, seen, start, (start - self._origin) * 1e-9)]
        change = self._tested(stop)
        if self._alarm:  # as before the change, until it has a name
            self._known = self._history[-self._alarm[0].windows][0]
        elif change is None:
            self._known = self._after(self._known, [seen])
        return self._reported(start, stop, seen=seen, change=change)

    def _evidence(self, record: Record, levels: Levels, loudness: float) -> WindowEvidence:
        """The evidence of a window, in which each followed parameter may move by what matters."""
        wide = np.concatenate([self.followed.sizes, np.zeros(len(self._model.x) - self._count)])
        room = np.linalg.inv(self._known.covariance + np.diag(wide**2))
        return evidence(self._model.at(self._known.mean), record, levels, room, loudness)

    def _learn(self) -> None:
        """What is normal, from the windows of the reference."""
        records = [r for r, _ in self._waiting]
        loudness = float(np.median([Segment.of(r).loudness for r in records]))
        first = self._known
        model, levels, found = fitted_to(records, self._model, first.covariance, loudness)
        error = float(free_run_errors(model.vectors(model.x), records)[0])
        if error > FOREIGN:
            self._waiting = []
            raise ShakeError(
                f"the table's file leaves {100.0 * error:.0f} % of the acceleration unexplained: "
                "it is that of another table, or was not found by close_loop"
            )
        inflation = scatter(found)
        self._model, self._known = model, pooled(first, found, inflation)
        square = NormalSquare.of([w.square for w in found])
        apart = self._indifferent(records[:: max(len(records) // FEW, 1)])
        self._normal = _Normal(levels, inflation, square, error, loudness, model.found_table(), apart)
        self._waiting = []

    def _indifferent(self, records: list[Record]) -> np.ndarray:
        """Variance of what does not matter, zero of what is held: where a parameter is known, a change that moves as
        much of the acceleration as matters reaches the threshold of the test."""
        x, steps = self._known.mean, self.followed.sizes * STEP
        moved = np.vstack([x, x + np.eye(self._count, len(x)) * steps[:, None]])
        felt = free_run_shares(self._model.vectors(moved), records) / steps
        found = np.zeros(len(x))
        found[: self._count] = (self.settings.test.matters / np.maximum(felt, LEAST_FELT) / self._limit) ** 2
        return found

    def _tested(self, stop: int) -> Change | None:
        """The change that is named with this window, if any."""
        assert self._normal is not None
        walk = self._walk**2 * self.settings.test.window / HOUR
        past = [(known, w) for known, w, *_ in self._history]
        known = (self._normal.inflation, self._normal.square)
        if self._alarm is None:
            found = alarm(past, walk, *known, self._limit, self._count, self._normal.apart)
            if found and found.parameter >= 0:
                found = replace(found, windows=windows_since(past, found, known[0], FAR * self.followed.sizes))
            self._alarm = (found, stop) if found else None
        else:
            found, noticed = self._alarm
            self._alarm = replace(found, windows=found.windows + 1), noticed
        if self._alarm is None or self._alarm[0].windows * self.settings.test.window < self.settings.test.naming:
            return None
        return self._name(*self._alarm)

    def _name(self, found: Alarm, noticed: int) -> Change | None:
        """The change of an alarm; none where it does not matter, and the windows since are followed like any others.

        What comes after an alarm may be its change that goes on: one cause since then, if it explains the motion now,
        is simpler than two. Its name then stands for both.
        """
        m = found.windows
        windows = [w for _, w, *_ in self._history[-m:]]
        since = [w.record for w in windows][1 if m > 1 else 0 :][-MOST_NAMED:]
        now = self._onset_of(m)
        first = self._onset or now
        onset, named = first, self._named(first, since)
        if first is not now and not named.explained:
            onset, named = now, self._named(now, since)
        if not named.share > self.settings.test.matters:
            self._onset = first
            self._known = self._after(now.known, windows[:-1])
            self._go_on(now.normal, mean_log(windows))
            return None
        _, window, stamp, at = self._history[-m]
        change = onset.change or Change(window.record.name, at, stamp, noticed, found.score, named)
        self._onset = replace(onset, change=replace(change, named=named))
        self._left = onset.left
        if named.explained:
            self._take(named, onset)
        else:
            self._model, self._known = onset.model, onset.known
            self._go_on(onset.normal, mean_log(windows))
        return self._onset.change

    def _after(self, known: KnownState, windows: list[WindowEvidence]) -> KnownState:
        """What is known after windows; as before while a change is not explained, for it would pass as another."""
        assert self._normal is not None
        change = self._onset.change if self._onset else None
        if change is not None and not change.named.explained:
            return known
        return pooled(known, windows, self._normal.inflation)

    def _onset_of(self, m: int) -> _Onset:
        """That of a change before the last m windows."""
        assert self._normal is not None
        known, _, since, _ = self._history[-m]
        before = [w.record for _, w, *_ in self._history[:-m]][-MOST_NAMED:]
        return _Onset(since, self._model, known, self._normal, before, self._left)

    def _named(self, onset: _Onset, since: Sequence[Record]) -> Named:
        """What changed at an onset, from windows since."""
        known = self._wandered(onset.known, (self._last - onset.since) * 1e-9)
        naming = Naming(
            held(onset.model.at(known.mean), self._count),
            conditional(known.covariance, self._count),
            self.followed.sizes,
            onset.normal.levels,
            onset.normal.inflation,
            onset.before,
            since,
        )
        return naming.named(onset.normal.square.most(EXPLAINED))

    def _take(self, named: Named, onset: _Onset) -> None:
        """Go on with the changed model; what is not established leaves the table as it was before."""
        kept, known, p = named.kept, onset.known, self._count
        if named.verdict != ESTABLISHED and not kept.followed:
            self._left = self._left or onset.model.at(known.mean).found_table()
        grown = max(kept.square / math.exp(onset.normal.square.mean), 1.0)
        covariance = known.covariance.copy()
        # of those that are held, as before
        covariance[:p, :p] += grown * named.covariance(p) - conditional(covariance, p)
        x = np.concatenate([kept.model.x[:p], known.mean[p:]])
        self._model = replace(onset.model.at(x), table=kept.model.found_table())
        self._known = KnownState(self._model.x, covariance)
        self._go_on(onset.normal, math.log(kept.square))

    def _go_on(self, normal: _Normal, square: float) -> None:
        """Watch again, where the log mean square of the innovations has become normal; windows scatter as they grew."""
        grown = max(square - normal.square.mean, 0.0)
        shifted = replace(normal.square, mean=normal.square.mean + grown)
        self._normal = replace(normal, square=shifted, inflation=normal.inflation * math.exp(grown))
        self._history, self._alarm = [], None
