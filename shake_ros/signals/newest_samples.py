"""The newest samples of a signal while it is being measured, and their harmonics over whole periods."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from shake_ros.quantities import ShakeError
from shake_ros.signals.thd import Harmonics, fundamental_frequency, harmonics, newest_periods

Floats = npt.NDArray[np.float64]
GAP = 1.5  # sample times between neighbours from which on a sample is missing
LONGEST_GAP = 0.1  # [s] of lost samples on end; the fit runs over the true instants, and bridges what is shorter
MOST_LOST = 0.25  # of the samples of a window


class NewestSamples:
    """A ring of the newest samples with their instants; lost ones are gaps, which the fit by true instants bridges.

    A long gap, a step back in time or a value that is not a number starts it anew.

    Parameters
    ----------
    capacity : samples to keep.
    sample_time : their distance [s].
    """

    def __init__(self, capacity: int, sample_time: float) -> None:
        if capacity < 8 or not sample_time > 0.0:
            raise ShakeError(f"a window needs at least 8 samples and a positive sample time, not {capacity}")
        self.sample_time = sample_time
        self.restarts = 0  # how often it was started anew
        self.reason = ""  # of the last time, in words
        self._values = np.empty(capacity)
        self._stamps = np.empty(capacity, dtype=np.int64)
        self._count = 0  # samples since the last start
        self._last = 0

    def __len__(self) -> int:
        return min(self._count, len(self._values))

    def add(self, stamp: int, value: float) -> None:
        """Take a sample measured at `stamp` [ns]."""
        elapsed = (stamp - self._last) * 1e-9
        if self._count and elapsed <= 0.0:
            self._start_anew(f"the stamps went back by {-elapsed:.3g} s")
        elif self._count and elapsed > max(LONGEST_GAP, GAP * self.sample_time):
            self._start_anew(f"{elapsed / self.sample_time - 1:.0f} consecutive samples lost")
        self._last = stamp
        if not math.isfinite(value):
            self._start_anew("a value that is not a number")
            return
        place = self._count % len(self._values)
        self._stamps[place] = stamp
        self._values[place] = value
        self._count += 1

    def _start_anew(self, reason: str) -> None:
        if self._count:
            self.restarts += 1
            self.reason = reason
        self._count = 0

    def arrays(self) -> tuple[Floats, Floats]:
        """(n,) times from the oldest sample [s] and (n,) values, oldest first."""
        n = len(self)
        order = np.arange(self._count - n, self._count) % len(self._values)
        stamps = self._stamps[order]
        return (stamps - stamps[0]) * 1e-9 if n else np.empty(0), self._values[order]

    def harmonics(self, periods: int, frequency: float | None = None, orders: int | None = None) -> Harmonics | None:
        """Harmonics over the newest `periods` whole periods; None until there are as many samples.

        Parameters
        ----------
        frequency : fundamental [Hz]; None finds it in all samples that are kept.
        orders : as for `harmonics`.

        Raises
        ------
        ShakeError
            where the capacity is too small for as many periods, too many samples are lost, or there is no fundamental.
        """
        if frequency is not None and round(periods / (frequency * self.sample_time)) > len(self._values):
            raise ShakeError(f"{periods} periods of {frequency:g} Hz need more than {len(self._values)} samples")
        if len(self) < 8 or (frequency is None and len(self) < len(self._values)):
            return None
        time, values = self.arrays()
        if frequency is None:
            frequency = self.fundamental()
        elif periods > math.floor((time[-1] - time[0] + 1.5 * self.sample_time) * frequency):
            return None
        window = newest_periods(time, frequency, periods)
        if lost := self._lost(time):
            begin = time[-1] - periods / frequency + (1.0 + 1e-6) * self.sample_time
            window = slice(max(int(np.searchsorted(time, begin, side="right")) - 1, 0), len(time))
            lost = self._lost(time[window])
        if lost > MOST_LOST:
            raise ShakeError(f"{lost:.0%} of the window's samples are lost: more than {MOST_LOST:.0%}")
        time, values = time[window], values[window]
        if periods > 1:  # the given frequency may be that of another clock
            frequency = fundamental_frequency(time, values, near=frequency)
        return harmonics(time, values, frequency, orders)

    def _lost(self, time: Floats) -> float:
        """Share of the samples that are missing in between."""
        whole = round((time[-1] - time[0]) / self.sample_time) + 1
        return max(0.0, 1.0 - len(time) / whole)

    def fundamental(self) -> float:
        """The fundamental of all samples that are kept [Hz]; ShakeError as `fundamental_frequency`."""
        time, values = self.arrays()
        if not len(time) or not self._lost(time):
            return fundamental_frequency(time, values)
        grid = np.arange(time[0], time[-1], self.sample_time)  # the spectrum, for a first guess, needs equal steps
        guess = fundamental_frequency(grid, np.interp(grid, time, values))
        return fundamental_frequency(time, values, near=guess)
