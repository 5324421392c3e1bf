"""Signals of different topics onto the stamps of the position sensor, and signs of trouble in the values themselves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shake_ros.core.analysis.stretches import held_at
from shake_ros.data.recordings.bag import Finding
from shake_ros.data.recordings.cdr import Floats, Integers
from shake_ros.data.recordings.series import GAP_FACTOR, JITTER_LIMIT, Series, broken

SAME_SAMPLE = 0.1  # share of a period within which two stamps mean the same sampling instant
IRREGULAR = 3.0  # 90th percentile over median of the distances, from which commands count as events
USABLE = 0.5  # share of samples below which an optional signal is not used


@dataclass(frozen=True)
class Grid:
    """The time base: stamps of the positions.

    Attributes
    ----------
    stamps : (n,) [ns], rising.
    gaps : (n - 1,) whether samples are missing after each sample.
    sample_time : mean distance of neighbours outside of gaps [s].
    restarted : whether the recording holds another run, which was left out.
    """

    stamps: Integers
    gaps: npt.NDArray[np.bool_]
    sample_time: float
    restarted: bool = False

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
    if "imu" in signals:
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
