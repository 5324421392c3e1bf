"""Signals of a second file, recorded on a clock of its own, on the stamps of the first file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfiltfilt

from shake_ros.core.analysis.clocks import Clock, EvenSamples, clock_of
from shake_ros.core.quantities import ShakeError

Floats = npt.NDArray[np.float64]
FASTER = 1.5  # times as fast as the first file, from which a second one is filtered before it is thinned
PASSED = 0.4  # of the first file's rate, up to which it passes
LOST = 1.5  # periods between two rows from which samples are missing there


def even(time: Floats, values: Floats) -> EvenSamples:
    """A signal on even samples: as it is where its stamps are even, otherwise on a line between its neighbours."""
    known = np.isfinite(values)
    count = round((time[-1] - time[0]) / float(np.median(np.diff(time)))) + 1
    step = float(time[-1] - time[0]) / (count - 1)
    return EvenSamples(float(time[0]), step, np.interp(time[0] + step * np.arange(count), time[known], values[known]))


def clock_between(first: dict[str, Floats], second: dict[str, Floats], names: tuple[Path, Path]) -> Clock:
    """The second file's clock on the first's, from the position in this and the acceleration in that one.

    Raises
    ------
    ShakeError : one line, where the correlation does not tell.
    """
    try:
        return clock_of(even(first["time"], first["position"]), even(second["time"], second["acceleration"]))
    except ShakeError as error:
        raise ShakeError(
            f"{names[1]}: its acceleration does not tell how its clock stands to that of {names[0]}: {error}"
        ) from None


def brought(first: dict[str, Floats], second: dict[str, Floats], clock: Clock | None) -> dict[str, Floats]:
    """The columns of the first file while the second one ran, with the second one's signals on its stamps.

    clock : of the second file; None where both count the same time. What is sampled much faster is filtered before.
    """
    time = second["time"] if clock is None else clock.on_first(second["time"])
    common = (first["time"] >= time[0]) & (first["time"] <= time[-1])
    together = {name: column[common] for name, column in first.items()}
    if np.count_nonzero(common) < 2:
        return together
    period, of_first = float(np.median(np.diff(time))), float(np.median(np.diff(first["time"])))
    after = np.clip(np.searchsorted(time, together["time"]), 1, len(time) - 1)
    lost = time[after] - time[after - 1] > LOST * period
    for name in second.keys() - {"time"}:
        known = np.isfinite(second[name])
        values = second[name][known]
        if of_first > FASTER * period and len(values) > 30:
            values = sosfiltfilt(butter(4, PASSED * 2.0 * period / of_first, output="sos"), values)
        column = np.asarray(CubicSpline(time[known], values)(together["time"]))
        unknown = ~(known[after] & known[after - 1])
        together[name] = np.where(lost | unknown, np.nan, column)
    return together


def clock_line(clock: Clock, names: tuple[Path, Path]) -> str:
    """What was found of the second file's clock."""
    when = "after" if clock.shift >= 0.0 else "before"
    speed = "fast" if clock.drift < 0.0 else "slow"
    turned = "; the two have opposite signs" if clock.turned else ""
    return (
        f"{names[1].name}: begins {abs(clock.shift):.5f} s {when} {names[0].name} (± {1e3 * clock.shift_deviation:.2g} "
        f"ms), its clock is {1e6 * abs(clock.drift):.1f} ppm {speed} (± {1e6 * clock.drift_deviation:.2g}), found by "
        f"correlation ({clock.correlation:.3f}); a delay of the accelerometer is part of that{turned}"
    )
