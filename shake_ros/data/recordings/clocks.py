"""The times of a recording: stamps of different clocks made one, and when a recorded command acted.

Clocks are compared by the times of receipt, which are of one clock. A message that is received at r when positions
stamped p(r) are, and is stamped s, is s − p(r) ahead of them. On one clock that is a difference of two latencies; on
two it is the offset of the clocks, and its slope their drift. It is taken off where no latency makes it: beyond
LONGEST, or stamped in the future of its receipt. A shorter one is ambiguous, for a sensor's messages may be late: an
acceleration decides itself, by which of the two goes with the position's curvature, and everything else is left as it
is stamped, with a finding.

The valve's command is recorded as the controller sends it. While the pressure is off or comes up, in a hold, and while
the master gain is below 1, the valve gets another one, or none, and a model that is driven by it learns nonsense. Each
change is reported at once, so the reports in the order of their receipt apply to every sample.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shake_ros.core.analysis.stretches import stretches
from shake_ros.data.recordings.align import SAME_SAMPLE, Grid
from shake_ros.data.recordings.bag import Finding, Message
from shake_ros.data.recordings.cdr import Floats, Integers, UndecodableError, walk
from shake_ros.data.recordings.series import Series

SECOND = 1e9
LEAST = 0.01  # [s] of offset that is looked at
SCATTER = 5.0  # times its own scatter
LONGEST = 1.0  # [s] that messages are late at most
FUTURE = 0.005  # [s] ahead of the receipt that no clock of one machine gives
BLOCKS = 20  # medians through which the drift goes
STEEPEST = 0.1  # drift of a clock, at most; more is time that is simulated
STEADY, LONG = 0.01, 0.1  # share of an offset, and [s], to which no latency is as steady and as long
BETTER = 0.5  # of what the curvature leaves of an acceleration by one alignment, from which the other is better
UNKNOWN = 0.02  # [s] of stamps that share a time of receipt, from which this says nothing of clocks


@dataclass(frozen=True)
class ClockShift:
    """Of a topic's clock against the positions': ahead by `offset` [ns] at the stamp `origin`, growing by `drift`."""

    origin: int
    offset: int
    drift: float

    def taken_off(self, stamps: Integers) -> Integers:
        """Stamps on the clock of the positions; those that are none stay."""
        since = (stamps - self.origin).astype(np.float64)
        moved: Integers = stamps - self.offset - np.rint(self.drift * since).astype(np.int64)
        return np.where(stamps > 0, moved, stamps)


def shifts(raw: dict[str, Series], findings: list[Finding]) -> dict[str, ClockShift]:
    """The shift of every signal that is on another clock than the positions."""
    position = raw["joint_states"]
    position = position[position.stamps > 0]
    position = position[np.argsort(position.received, kind="stable")]
    if len(position) < 2:
        return {}
    found = {}
    for name, series in raw.items():
        stamped = series[series.stamps > 0]
        if name != "joint_states" and len(stamped) > 1:
            shift = _shift(name, stamped, position, findings)
            if shift is not None:
                found[name] = shift
    return found


def _shift(name: str, series: Series, position: Series, findings: list[Finding]) -> ClockShift | None:
    inside = (series.received >= position.received[0]) & (series.received <= position.received[-1])
    series = series[inside]
    if len(series) < 2:
        return None
    origin, near = int(position.stamps[0]), int(np.median(series.stamps))  # 1e18 ns apart where one is since boot
    since = (series.stamps - near).astype(np.float64)
    known, own = (position.received - position.received[0]).astype(np.float64), position.stamps - origin
    received = (series.received - position.received[0]).astype(np.float64)
    level, drift, scatter = _line(since, since - np.interp(received, known, own.astype(np.float64)))
    last = np.minimum(np.searchsorted(known, received, side="right"), len(own) - 1)
    unknown = float(np.median(own[last] - own[np.maximum(np.searchsorted(known, received) - 1, 0)]))
    offset, period = near - origin + round(level), max(position.period, 1.0)
    moved = abs(drift) * float(np.ptp(series.stamps))
    drifts = abs(drift) <= STEEPEST and moved > max(
        SAME_SAMPLE * period, 2.0 * SCATTER * scatter, unknown - 3.0 * period
    )
    drifts = drifts and not _on_grid(series, position)
    if abs(offset) < max(LEAST * SECOND, SCATTER * scatter, 3.0 * period, unknown) and not drifts:
        return None
    shift = ClockShift(near, offset, drift if drifts else 0.0)
    steady = abs(offset) > LONG * SECOND and scatter < STEADY * abs(offset)
    sure = drifts or abs(offset) > LONGEST * SECOND or steady or _in_the_future(series, position)
    if name == "imu" and abs(offset) <= LONGEST * SECOND:
        stamped, taken_off = _left(series, position, shift)
        sure = taken_off < BETTER * stamped or (sure and not stamped < BETTER * taken_off)
    sure = sure and unknown < max(UNKNOWN * SECOND, 3.0 * period)
    where = f"{abs(offset) / SECOND:.4g} s {'ahead of' if offset > 0 else 'behind'} the positions'"
    if sure:
        by = f" and drift by {1e6 * drift:+.0f} ppm" if drifts else ""
        end = f"by the times of receipt; removed, to within {max(scatter, 1e3) / 1e6:.2g} ms"
        text = f"stamps are of another clock: they are {where}{by}, {end}"
    else:
        text = f"stamps are {where} received with them: another clock, or late in transit; used as they are stamped"
    findings.append(Finding("clock", series.topic, len(series), text))
    return shift if sure else None


def _in_the_future(series: Series, position: Series) -> bool:
    """Whether stamps lie behind their receipt, on whose clock the positions are."""
    ahead, own = (float(np.median(s.stamps - s.received)) / SECOND for s in (series, position))
    return ahead > FUTURE and -LONGEST < own < FUTURE


def _line(at: Floats, values: Floats) -> tuple[float, float, float]:
    """Level at 0, slope and scatter of medians of blocks about their line; all three robust against late messages."""
    parts = np.array_split(np.arange(len(at)), min(BLOCKS, max(1, len(at) // 5)))
    x = np.array([np.median(at[rows]) for rows in parts])
    y = np.array([np.median(values[rows]) for rows in parts])
    if len(x) < 4:
        return float(np.median(values)), 0.0, float(np.median(np.abs(values - np.median(values))))
    slope, level = np.polyfit(x / SECOND, y, 1)
    drift = float(slope) / SECOND
    around = float(np.median(np.abs(values - level - drift * at)))
    return float(level), drift, max(around, float(np.std(y - level - drift * x)))


def _on_grid(series: Series, position: Series) -> bool:
    """Whether the samples are taken at the instants of positions: then the clocks do not drift."""
    right = np.clip(np.searchsorted(position.stamps, series.stamps), 1, len(position) - 1)
    apart = np.minimum(
        np.abs(position.stamps[right] - series.stamps), np.abs(series.stamps - position.stamps[right - 1])
    )
    return bool(np.mean(apart <= 1e-3 * position.period) > 0.5)


def _left(series: Series, position: Series, shift: ClockShift) -> tuple[float, float]:
    """Share of an acceleration's square that the position's curvature leaves: as stamped, and with the shift off."""
    t, x = (position.stamps - position.stamps[0]).astype(np.float64) / SECOND, position.values[:, 0]
    even = np.arange(0.0, t[-1], max(0.02, position.period / SECOND))
    curvature = np.diff(np.interp(even, t, x), 2)
    found = []
    for stamps in (series.stamps, shift.taken_off(series.stamps)):
        order = np.argsort(stamps, kind="stable")
        at = (stamps[order] - position.stamps[0]).astype(np.float64) / SECOND
        felt = np.interp(even[1:-1], at, series.values[order, 0], np.nan, np.nan)
        good = np.isfinite(felt) & np.isfinite(curvature)
        if good.sum() < 10 or np.ptp(felt[good]) == 0.0 or np.ptp(curvature[good]) == 0.0:
            return 1.0, 1.0
        found.append(1.0 - float(np.corrcoef(felt[good], curvature[good])[0, 1]) ** 2)
    return found[0], found[1]


TOPIC, TYPE = "diagnostics", "diagnostic_msgs/msg/DiagnosticArray"
PASSES, SPAN = "passes", "span"  # values of a status: whether commands act, and the master gain
FULL = 0.9995  # master gain that counts as 1, as it is printed
BRIEF = 0.05  # [s] a shorter segment is a matter of which message was received first


def said(data: bytes) -> bool | None:
    """Whether commands act in full, by a message; None where none of its nodes has an interlock."""
    try:
        texts = walk(data, TYPE).texts
    except UndecodableError:
        return None
    nodes: dict[str, dict[str, str]] = {}
    for path, key in texts.items():
        if path.endswith("].key"):
            status = path.partition("].values")[0]
            nodes.setdefault(status, {})[key] = texts[path.removesuffix("key") + "value"]
    reported = next((values for values in nodes.values() if PASSES in values), None)
    return None if reported is None else reported[PASSES] == "True" and _number(reported.get(SPAN, "1")) >= FULL


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return 1.0


def without_brief(acts: npt.NDArray[np.bool_], most: int) -> npt.NDArray[np.bool_]:
    """The same, without segments of at most so many samples on which commands did not act.

    >>> without_brief(np.array([False, True, False, False]), 1).tolist()
    [True, True, False, False]
    """
    found = acts.copy()
    for span in stretches(~acts):
        if span.stop - span.start <= most:
            found[span] = True
    return found


class Acting:
    """What the reports of a recording say, in the order of their receipt."""

    def __init__(self) -> None:
        self._received: list[int] = []
        self._acts: list[bool] = []

    def add(self, message: Message) -> None:
        """Take one message; only changes are kept."""
        acts = said(message.data)
        if acts is not None and (not self._acts or acts != self._acts[-1]):
            self._received.append(message.received)
            self._acts.append(acts)

    def samples(self, received: Integers) -> npt.NDArray[np.bool_]:
        """Whether commands acted on samples received at these times [ns]; before the first report as it says."""
        if not self._acts:
            return np.ones(len(received), dtype=bool)
        at = np.searchsorted(np.array(self._received), received, side="right") - 1
        return np.array(self._acts)[np.maximum(at, 0)]

    def usable(self, received: Integers, grid: Grid, topic: str, findings: list[Finding]) -> npt.NDArray[np.bool_]:
        """The samples on which commands acted; all of a recording that has none. What is left out is reported."""
        acts = without_brief(self.samples(received), round(BRIEF / grid.sample_time))
        idle = int(np.sum(~acts))
        if not idle:
            return acts
        what = "commands did not act in full (pressure off, a hold, or a master gain below 1)"
        if idle == len(acts):
            findings.append(Finding("idle", topic, idle, f"{what} on any sample", 0.0))
            return np.ones(len(acts), dtype=bool)
        first = grid.seconds(int(np.argmin(acts)))
        text = f"{what} on {idle} of {len(acts)} samples, which are left out; first at {first:.4g} s"
        findings.append(Finding("idle", topic, idle, text, first))
        return acts
