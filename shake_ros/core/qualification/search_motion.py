"""The low motion of a resonance search: a sine whose frequency rises by equal octaves a minute, or random.

Sweeps and random motions as of the vibration response investigation of IEC 60068-2-57 and -2-59 practice, which were
not read in the original here; both end at rest.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shake_ros.core.iteration.drive import integrate
from shake_ros.core.qualification.motion import REST
from shake_ros.core.quantities import Parameters, choice, quantity
from shake_ros.core.reference.baseline import end_at_rest, filtered
from shake_ros.core.reference.motion import smooth_step

Array = NDArray[np.float64]
SWEEP, RANDOM = "sine_sweep", "random"
BEYOND = 1.2  # of either end of the band, over which the motion goes


@dataclass(frozen=True)
class SearchParameters(Parameters):
    """A resonance search before and after the test."""

    motion: str = choice("of the search", (SWEEP, RANDOM))
    level: float = quantity("m/s²", "peak of the sweep, rms of the random motion; 0 = no search", low=0.0, high=50.0)
    sweep_rate: float = quantity("octave/min", "of the sweep", low=0.1, high=60.0)
    duration: float = quantity("s", "of the random motion", low=5.0, high=600.0)
    low: float = quantity("Hz", "lower end of its band", low=0.1, high=100.0)
    high: float = quantity("Hz", "upper end of its band", low=0.2, high=200.0)
    shift: float = quantity("-", "of a frequency, from which a specimen counts as changed", low=0.001, high=1.0)

    @property
    def words(self) -> str:
        """The motion, for a certificate."""
        band = f"{self.low:g} to {self.high:g} Hz"
        if self.motion == SWEEP:
            return f"a sine sweep of {self.level:g} m/s², {band}, {self.sweep_rate:g} octaves/min"
        return f"random motion of {self.level:g} m/s² rms, {band}"


def sweep(low: float, high: float, rate: float, time_step: float) -> Array:
    """A sine of amplitude 1 from low to high [Hz] at `rate` [octaves/min], (n,).

    >>> round(sweep(1.0, 32.0, 10.0, 0.001).size * 0.001)  # five octaves, a sixth of a minute each … 30 s
    30
    """
    growth = rate / 60.0 * math.log(2.0)
    time = np.arange(round(math.log(high / low) / growth / time_step)) * time_step
    return np.asarray(np.sin(2.0 * math.pi * low * np.expm1(growth * time) / growth))


def random(low: float, high: float, duration: float, time_step: float, seed: int) -> Array:
    """Noise of rms 1 between low and high [Hz], (n,)."""
    count = round(duration / time_step)
    f = np.fft.rfftfreq(count, time_step)
    phases = np.random.RandomState(seed).uniform(0.0, 2.0 * np.pi, f.size)
    noise: Array = np.fft.irfft(np.where((f >= low) & (f <= high), np.exp(1j * phases), 0.0), count)
    return np.asarray(noise / np.std(noise))


def search_motion(parameters: SearchParameters, time_step: float, seed: int) -> Array:
    """Position, velocity, acceleration of a search, (n, 3) [m, m/s, m/s²]."""
    p = parameters
    low, high = p.low / BEYOND, p.high * BEYOND
    if p.motion == SWEEP:
        wave = sweep(low, high, p.sweep_rate, time_step)
    else:
        wave = random(low, high, p.duration + 2.0 * REST, time_step, seed)
    place = np.arange(wave.size) * time_step
    wave = p.level * wave * smooth_step(np.minimum(place, place[::-1]) / REST)[0]
    return integrate(
        end_at_rest(filtered(np.pad(wave, round(REST / time_step)), time_step, low, 0.0), time_step), time_step
    )
