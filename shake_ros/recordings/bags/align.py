"""Signals of different topics and clocks onto the stamps of the position sensor, and signs of trouble in the values.

Clocks are compared by the times of receipt, which are of one clock. A message that is received at r when positions
stamped p(r) are, and is stamped s, is s − p(r) ahead of them. On one clock that is a difference of two latencies; on
two it is the offset of the clocks, and its slope their drift. It is taken off where no latency makes it: beyond
LONGEST, or stamped in the future of its receipt. A shorter one is ambiguous, for a sensor's messages may be late: an
acceleration decides itself, by which of the two goes with the position's curvature, and everything else is left as it
is stamped, with a finding.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shake_ros.recordings.bags.bag import Finding
from shake_ros.recordings.bags.cdr import Floats, Integers
from shake_ros.recordings.bags.series import GAP_FACTOR, JITTER_LIMIT, Series, broken
from shake_ros.signals.stretches import held_at

SAME_SAMPLE = 0.1  # share of a period within which two stamps mean the same sampling instant
IRREGULAR = 3.0  # 90th percentile over median of the distances, from which commands count as events
USABLE = 0.5  # share of samples below which an optional signal is not used


@dataclass(frozen=True)
class Grid:
    """The time base: stamps of the positions."""

    stamps: Integers  # (n,) [ns], rising
    gaps: npt.NDArray[np.bool_]  # (n - 1,) whether samples are missing after each sample
    sample_time: float  # mean distance of neighbours outside of gaps [s]
    restarted: bool = False  # whether the recording holds another run, which was left out

    @property
    def time(self) -> Floats:
        """(n,) from the first stamp [s]."""
        seconds: Floats = (self.stamps - self.stamps[0]) / 1e9
        return seconds

    def seconds(self, row: int) -> float:
        """Time of a sample from the first one [s]."""
        return float(self.stamps[row] - self.stamps[0]) / 1e9

    @classmethod
    def of(cls, series: Series, findings: list[Finding]) -> Grid:
        """The time base of an ordered series; gaps and jitter are reported."""
        steps = np.diff(series.stamps)
        period = float(np.median(steps))
        gaps = broken(series.stamps)
        mean = float(steps[~gaps].mean())
        restarted = any(finding.kind == "restart" and finding.topic == series.topic for finding in findings)
        grid = cls(series.stamps, gaps, mean / 1e9, restarted)
        report_gaps(series.topic, steps, gaps, period, findings)
        away = np.abs(steps[~gaps] - mean) > JITTER_LIMIT * mean
        if away.any():
            spread = float(np.std(steps[~gaps])) / 1e6
            text = (
                f"{int(away.sum())} samples are off their period by more than 10 % (standard deviation {spread:.3g} ms)"
            )
            first = int(np.flatnonzero(~gaps)[int(np.argmax(away))])
            findings.append(Finding("jitter", series.topic, int(away.sum()), text, grid.seconds(first)))
        return grid


def report_gaps(
    topic: str, steps: Integers, gaps: npt.NDArray[np.bool_], period: float, findings: list[Finding]
) -> None:
    """One finding for all gaps of a topic: how many, how many samples, where the first and the longest are."""
    if not gaps.any():
        return
    missing = int(np.sum(np.rint(steps[gaps] / period) - 1))
    since = np.concatenate(([0], np.cumsum(steps)))[:-1] / 1e9
    first = float(since[np.argmax(gaps)])
    longest = int(np.argmax(np.where(gaps, steps, 0)))
    text = (
        f"{int(gaps.sum())} gaps, about {missing} samples missing; first after {first:.6g} s, "
        f"longest {steps[longest] / 1e9:.3g} s after {since[longest]:.6g} s"
    )
    findings.append(Finding("gap", topic, missing, text, first))


def hold(series: Series, grid: Grid, findings: list[Finding]) -> Floats:
    """The command that acts from each sample on: the last one stamped at or before it.

    Returns
    -------
    (n,) command; NaN before the first, and where the command's own stamps have a gap.
    """
    topic, tolerance = series.topic, int(grid.sample_time * 1e9 * SAME_SAMPLE)
    period = series.period
    steps = np.diff(series.stamps)
    regular = len(series) > 2 and float(np.percentile(steps, 90)) <= IRREGULAR * period
    index = np.searchsorted(series.stamps, grid.stamps + tolerance, side="right") - 1
    values = np.where(index >= 0, series.values[np.maximum(index, 0), 0], np.nan)
    early = int((index < 0).sum())
    if early:
        findings.append(Finding("gap", topic, early, f"the first {early} positions come before the first command", 0.0))
    if regular:
        age = grid.stamps - series.stamps[np.maximum(index, 0)]
        lost = broken(series.stamps)
        open_ended = np.append(lost, True)  # the next command is lost, or there is none
        stale = (index >= 0) & (age > period - tolerance) & open_ended[np.maximum(index, 0)]
        report_gaps(topic, steps, lost, period, findings)
        last = int((stale & (index == len(series) - 1)).sum())
        if last > 1:
            text = f"the last {last} positions come after the last command"
            findings.append(Finding("gap", topic, last, text, grid.seconds(len(grid.stamps) - last)))
        values[stale] = np.nan
    elif len(series) > 2:
        text = "commands come irregularly and are taken as events that last until the next"
        findings.append(Finding("jitter", topic, len(series), text))
    used = np.unique(index[index >= 0]).size
    if len(series) > 1.5 * used and used:
        text = f"{len(series)} commands for {used} positions: of several between two positions the last one counts"
        findings.append(Finding("resampled", topic, len(series) - used, text))
    return values


def matched(series: Series, grid: Grid, findings: list[Finding]) -> Floats | None:
    """A measured signal at the grid's stamps.

    Samples with the same stamp are taken as they are; a signal with stamps of its own is interpolated linearly
    between neighbours that are no gap apart, and a finding says so.

    Returns
    -------
    (n, width) values, NaN where there is no sample; None where fewer than half of the samples are there.
    """
    if not len(series):
        findings.append(Finding("absent", series.topic, 0, "has no usable sample; left out"))
        return None
    right = np.clip(np.searchsorted(series.stamps, grid.stamps), 0, len(series) - 1)
    left = np.maximum(right - 1, 0)
    nearest = np.where(
        np.abs(series.stamps[left] - grid.stamps) < np.abs(series.stamps[right] - grid.stamps), left, right
    )
    same = np.abs(series.stamps[nearest] - grid.stamps) <= SAME_SAMPLE * grid.sample_time * 1e9
    values = np.where(same[:, None], series.values[nearest], np.nan)
    slower = series.period > GAP_FACTOR * grid.sample_time * 1e9
    if len(series) > 1 and (same.mean() < USABLE or slower):
        values, same = _interpolated(series, grid, left, right)
        text = f"has stamps of its own (every {series.period / 1e6:.4g} ms); interpolated linearly"
        findings.append(Finding("resampled", series.topic, int(same.sum()), text))
    missing = int((~same).sum())
    if missing > (1.0 - USABLE) * len(same):
        text = f"exists for {len(same) - missing} of {len(same)} positions only; left out"
        findings.append(Finding("absent", series.topic, missing, text))
        return None
    if missing:
        first = grid.seconds(int(np.argmin(same)))
        text = f"{missing} of {len(same)} positions have no such sample; first at {first:.6g} s"
        findings.append(Finding("gap", series.topic, missing, text, first))
    return values


def _interpolated(series: Series, grid: Grid, left: Integers, right: Integers) -> tuple[Floats, npt.NDArray[np.bool_]]:
    span = (series.stamps[right] - series.stamps[left]).astype(np.float64)
    share = (grid.stamps - series.stamps[left]) / np.where(span > 0, span, 1.0)
    inside = (span > 0) & (span <= GAP_FACTOR * series.period) & (share >= 0) & (share <= 1)
    a, b = series.values[left], series.values[right]
    first = series.stamps[right] == grid.stamps  # on the first sample, which has none before it
    values = np.where(first[:, None], b, a + share[:, None] * (b - a))
    return np.where((inside | first)[:, None], values, np.nan), inside | first


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


def shifts(raw: dict[str, Series], base: str, findings: list[Finding]) -> dict[str, ClockShift]:
    """The shift of every signal that is on another clock than the positions, or another time base."""
    position = raw[base]
    position = position[position.stamps > 0]
    position = position[np.argsort(position.received, kind="stable")]
    if len(position) < 2:
        return {}
    found = {}
    for name, series in raw.items():
        stamped = series[series.stamps > 0]
        if name != base and len(stamped) > 1:
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


SCALE_SUSPECT = 3.0
KEPT = 0.5  # of the acceleration's power, in means over steps from which the position's curvature is that of the motion


@dataclass(frozen=True)
class Size:
    """The sizes a signal has on a shaking table: from `low` to `high` at its largest, in `unit`."""

    unit: str
    low: float
    high: float
    small: str
    large: str


SIZES = {
    "joint_states": Size("m", 0.0, 2.0, "", "millimetres instead of metres?"),
    "imu": Size("m/s²", 0.0, 500.0, "", "mm/s² instead of m/s²?"),
    "valve_command": Size("-", 0.0, 1.05, "", "volts, milliamperes or per cent instead of −1 … 1?"),
    "pressure_a": Size("Pa", 2e4, 2e8, "bar instead of pascal?", "not pascal?"),
    "pressure_b": Size("Pa", 2e4, 2e8, "bar instead of pascal?", "not pascal?"),
    "pressure_load": Size("Pa", 2e3, 2e8, "bar instead of pascal?", "not pascal?"),
    "pressure_supply": Size("Pa", 2e4, 2e8, "bar instead of pascal?", "not pascal?"),
}


def not_a_number(signals: dict[str, Floats], topics: dict[str, str], grid: Grid, findings: list[Finding]) -> None:
    """Report values that are not finite, other than those that gaps account for."""
    for name, values in signals.items():
        bad = ~np.isfinite(values)
        counted = sum(f.count for f in findings if f.topic == topics[name] and f.kind == "gap")
        if bad.any() and (np.isinf(values).any() or name == "joint_states" or int(bad.sum()) > counted):
            first = grid.seconds(int(np.argmax(bad)))
            text = f"{int(bad.sum())} samples have no finite value; first at {first:.6g} s"
            findings.append(Finding("not_a_number", topics[name], int(bad.sum()), text, first))


def sizes(signals: dict[str, Floats], topics: dict[str, str], grid: Grid, findings: list[Finding]) -> None:
    """Report signals that stand still, stick at an extreme value, or have the size of another unit."""
    for name, values in signals.items():
        expected = SIZES.get(name)
        if expected is None or values.ndim > 1 or not np.isfinite(values).any():
            continue
        largest = float(np.nanmax(np.abs(np.where(np.isfinite(values), values, np.nan))))
        hint = expected.large if largest > expected.high else expected.small if largest < expected.low else ""
        if hint:
            text = f"reaches {largest:.6g} {expected.unit}: {hint}"
            findings.append(Finding("unit", topics[name], 1, text))
        _flat(values, topics[name], grid, findings)
    if "imu" in signals and "joint_states" in signals:
        _acceleration_scale(signals["joint_states"], signals["imu"], topics["imu"], grid, findings)


def _flat(values: Floats, topic: str, grid: Grid, findings: list[Finding]) -> None:
    finite = values[np.isfinite(values)]
    low, high = float(finite.min()), float(finite.max())
    if low == high:
        findings.append(Finding("constant", topic, len(finite), f"has the same value {low:.6g} throughout"))
        return
    for extreme in (low, high):
        at = held_at(values, extreme)
        if at.any():
            first = grid.seconds(int(np.argmax(at)))
            text = (
                f"{int(at.sum())} samples stand at the extreme value {extreme:.6g}; first at {first:.6g} s (saturated?)"
            )
            findings.append(Finding("clipping", topic, int(at.sum()), text, first))


def _acceleration_scale(
    position: Floats, acceleration: Floats, topic: str, grid: Grid, findings: list[Finding]
) -> None:
    """Compare the accelerometer with the second difference of position over steps long enough to drown its noise."""
    gap_free = ~grid.gaps
    stride = max(1, round(0.02 / grid.sample_time))
    if len(position) < 20 * stride or not gap_free.all():
        return
    count = len(position) // stride * stride
    means = [x[:count].reshape(-1, stride).mean(axis=1) for x in (position, acceleration)]
    curvature = np.diff(means[0], 2) / (stride * grid.sample_time) ** 2
    measured = means[1][1:-1]
    good = np.isfinite(curvature) & np.isfinite(measured)
    if good.sum() < 10:
        return
    measured = measured - np.mean(measured[good])
    power, left = float(np.sum(curvature[good] ** 2)), float(np.var(measured[good]))
    if power == 0.0 or left < KEPT * float(np.nanvar(acceleration)):  # too fast for such steps
        return
    correlation = float(np.corrcoef(curvature[good], measured[good])[0, 1])
    slope = float(np.sum(curvature[good] * measured[good])) / power
    ratio = 1.0 / abs(slope) if slope else np.inf
    if abs(correlation) > 0.8 and not 1.0 / SCALE_SUSPECT < ratio < SCALE_SUSPECT:
        guess = "g instead of m/s²?" if 7.0 < ratio < 13.0 else "another unit?"
        text = f"is {ratio:.3g} times smaller than the curvature of the position: {guess}"
        findings.append(Finding("unit", topic, 1, text))
