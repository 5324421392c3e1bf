"""The newest samples of a signal while it is being measured, and their harmonics over whole periods."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from shake_ros.core.analysis.thd import Harmonics, fundamental_frequency, harmonics, newest_periods
from shake_ros.core.quantities import ShakeError

Floats = npt.NDArray[np.float64]
GAP = 1.5  # sample times between neighbours from which on a sample is missing


class NewestSamples:
    """A ring of equally spaced samples; a gap, a step back in time or a value that is no number starts it anew.

    Parameters
    ----------
    capacity : samples to keep.
    sample_time : their distance [s].

    Attributes
    ----------
    restarts : how often it was started anew.
    """

    def __init__(self, capacity: int, sample_time: float) -> None:
        if capacity < 8 or not sample_time > 0.0:
            raise ShakeError(f"a window needs at least 8 samples and a positive sample time, not {capacity}")
        self.sample_time = sample_time
        self.restarts = 0
        self._values = np.empty(capacity)
        self._stamps = np.empty(capacity, dtype=np.int64)
        self._count = 0  # samples since the last start
        self._last = 0

    def __len__(self) -> int:
        return min(self._count, len(self._values))

    def add(self, stamp: int, value: float) -> None:
        """Take a sample measured at `stamp` [ns]."""
        if self._count and not 0 < stamp - self._last <= GAP * self.sample_time * 1e9:
            self._start_anew()
        self._last = stamp
        if not math.isfinite(value):
            self._start_anew()
            return
        place = self._count % len(self._values)
        self._stamps[place] = stamp
        self._values[place] = value
        self._count += 1

    def _start_anew(self) -> None:
        self.restarts += self._count > 0
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
            where the capacity is too small for as many periods, or the samples have no fundamental.
        """
        if frequency is not None and round(periods / (frequency * self.sample_time)) > len(self._values):
            raise ShakeError(f"{periods} periods of {frequency:g} Hz need more than {len(self._values)} samples")
        if len(self) < 8 or (frequency is None and len(self) < len(self._values)):
            return None
        time, values = self.arrays()
        if frequency is None:
            frequency = fundamental_frequency(time, values)
        elif periods > math.floor((len(time) + 0.5) * self.sample_time * frequency):
            return None
        window = newest_periods(time, frequency, periods)
        return harmonics(time[window], values[window], frequency, orders)
