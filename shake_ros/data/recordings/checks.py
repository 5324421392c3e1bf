"""Signs of trouble in the values themselves: not a number, clipped, constant, another unit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shake_ros.core.analysis.stretches import held_at
from shake_ros.data.recordings.align import Grid
from shake_ros.data.recordings.bag import Finding
from shake_ros.data.recordings.cdr import Floats

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
