"""Resonances of a specimen from the force on the table and its acceleration: no sensor on the specimen is needed.

The table with a flexible specimen answers the cylinder's force F with the apparent mass

    F/a = m_r + c/(jω) − j d + Σ m_q (ω_q² + 2 j ζ_q ω_q ω)/(ω_q² − ω² + 2 j ζ_q ω_q ω),

the rigid mass, what is viscous, dry friction as a sine of constant acceleration meets it, and an oscillator of mass m_q
for each resonance. Its terms are fitted to the measured ratio, averaged over segments, weighted by the coherence; an
oscillator is added as long as it explains a share of what the ones before it left. Friction adds a force that is not in
proportion: it lowers the coherence. A ratio of two measured signals holds at any rate of a sweep; the response alone
would lag behind it.
The response of masses on springs to the motion of their base; any textbook of vibration.
Verified against: forces made by this formula with one and two oscillators, and the simulated table's own specimen.

The motion of a search is low: a sine whose frequency rises by equal octaves a minute, or random.

Sweeps and random motions as of the vibration response investigation of IEC 60068-2-57 and -2-59 practice, which were
not read in the original here; both end at rest.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shake_ros.control.reference.baseline import end_at_rest, filtered, states_from_rest
from shake_ros.control.reference.motion import smooth_step
from shake_ros.qualification.motion import REST
from shake_ros.quantities import Parameters, choice, quantity

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
    shift: float = quantity("-", "of a frequency, above which a specimen counts as changed", low=0.001, high=1.0)

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
    return states_from_rest(
        end_at_rest(filtered(np.pad(wave, round(REST / time_step)), time_step, low, 0.0), time_step), time_step
    )


SEGMENT = 8.0  # [s], of a spectrum
STARTS, FITTED = 32, 3  # frequencies at which an oscillator is tried, and the best of them from which it is fitted
APART = 1.2  # ratio of two frequencies in one search, at least: nearer ones share what leaks of one resonance
TELLING = 0.03  # share of the rigid mass from which a moving mass is one
EXPLAINED = 0.3  # share of the misfit that one more oscillator has to take away
MOST, RIGID = 3, 3  # resonances, and terms before them
DAMPED = 0.002, 0.3  # damping of a resonance; a fit that ends at the upper bound is none
SAME = 1.5  # ratio of two frequencies up to which they may be one resonance that moved


@dataclass(frozen=True)
class Resonance:
    """What a search found: frequency [Hz], damping [-], moving mass [kg]."""

    frequency: float
    damping: float
    mass: float

    def __str__(self) -> str:
        return f"{self.frequency:.2f} Hz, damping {100.0 * self.damping:.1f} %, moving mass {self.mass:.0f} kg"


@dataclass(frozen=True)
class Shift:
    """A resonance before and after; one of them is None where it is new, or gone."""

    before: Resonance | None
    after: Resonance | None

    @property
    def frequency(self) -> float:
        """Relative change of the frequency; −1 where the resonance is gone, 0 where it is new [-]."""
        if self.before is None:
            return 0.0
        return -1.0 if self.after is None else self.after.frequency / self.before.frequency - 1.0

    @property
    def damping(self) -> float:
        """Relative change of the damping, likewise [-]."""
        if self.before is None:
            return 0.0
        return -1.0 if self.after is None else self.after.damping / self.before.damping - 1.0

    def __str__(self) -> str:
        if self.before is None:
            return f"new at {self.after.frequency:.2f} Hz" if self.after else "none"
        if self.after is None:
            return f"{self.before.frequency:.2f} Hz: gone"
        moved, damped = 100.0 * self.frequency, 100.0 * self.damping
        return f"{self.before.frequency:.2f} Hz: frequency {moved:+.1f} %, damping {damped:+.0f} %"


@dataclass(frozen=True)
class ResonanceSearch:
    """A search: its resonances by frequency, the rigid mass [kg], the mean coherence [-]."""

    resonances: tuple[Resonance, ...]
    rigid_mass: float
    coherence: float

    def shifts(self, after: ResonanceSearch) -> tuple[Shift, ...]:
        """Each resonance with that of a later search which it has become, the nearest ones first."""
        old, new, pairs = list(self.resonances), list(after.resonances), list[Shift]()
        while old and new:
            a, b = min(
                ((a, b) for a in old for b in new), key=lambda ab: abs(math.log(ab[1].frequency / ab[0].frequency))
            )
            if abs(math.log(b.frequency / a.frequency)) > math.log(SAME):
                break
            pairs.append(Shift(a, b))
            old.remove(a)
            new.remove(b)
        pairs += [Shift(a, None) for a in old] + [Shift(None, b) for b in new]
        return tuple(sorted(pairs, key=lambda p: (p.before or p.after or self.resonances[0]).frequency))

    def __str__(self) -> str:
        if not self.resonances:
            return f"none in the band (rigid mass {self.rigid_mass:.0f} kg)"
        return "; ".join(map(str, self.resonances))


@dataclass(frozen=True)
class SearchBand:
    """Where a resonance is sought [Hz], and the piston areas [m²] that make a force of two pressures."""

    low: float
    high: float
    piston_area: float
    area_ratio: float = 1.0  # of chamber B

    def of(self, pressure_a: Array, pressure_b: Array, acceleration: Array, time_step: float) -> ResonanceSearch:
        """The resonances in a recording of both pressures [Pa] and the acceleration [m/s²], (n,) each."""
        force = self.piston_area * (pressure_a - self.area_ratio * pressure_b)
        return search(force, acceleration, time_step, self.low, self.high)


def _columns(omega: Array, frequencies: Array, dampings: Array) -> NDArray[np.complex128]:
    w, damping = 2.0 * math.pi * frequencies, dampings
    o = omega[:, None]
    springs = (w**2 + 2j * damping * w * o) / (w**2 - o**2 + 2j * damping * w * o)
    one = np.ones_like(omega, dtype=complex)
    return np.column_stack([one, 1.0 / (1j * omega), -1j * one, springs])


@dataclass(frozen=True)
class _Ratio:
    """F/a with the weight of each frequency, (m,) each."""

    omega: Array
    ratio: NDArray[np.complex128]
    weight: Array

    def solved(self, x: Array) -> tuple[Array, Array]:
        """What is missed with oscillators ln f, ln ζ in turn, and the masses that miss least."""
        columns = _columns(self.omega, np.exp(x[0::2]), np.exp(x[1::2])) * self.weight[:, None]
        wanted = self.ratio * self.weight
        a = np.concatenate([columns.real, columns.imag])
        b = np.concatenate([wanted.real, wanted.imag])
        masses = np.linalg.lstsq(a, b, rcond=None)[0]
        return np.asarray(a @ masses - b), masses


def search(force: Array, acceleration: Array, time_step: float, low: float, high: float) -> ResonanceSearch:
    """The resonances between low and high [Hz] in a recording of force [N] and acceleration [m/s²], (n,) each."""
    from scipy.optimize import least_squares
    from scipy.signal import coherence, csd, welch

    n = min(force.size, round(SEGMENT / time_step))
    f, cross = csd(acceleration, force, 1.0 / time_step, nperseg=n)
    _, power = welch(acceleration, 1.0 / time_step, nperseg=n)
    _, both = coherence(acceleration, force, 1.0 / time_step, nperseg=n)
    band = (f >= low) & (f <= high)
    measured = _Ratio(2.0 * math.pi * f[band], (cross / power)[band], np.sqrt(both[band]))
    best = np.zeros(0)
    missed, masses = measured.solved(best)
    while best.size < 2 * MOST:
        count = best.size // 2 + 1
        sides = [math.log(low), math.log(DAMPED[0])], [math.log(high), math.log(DAMPED[1])]
        bounds = np.tile(sides[0], count), np.tile(sides[1], count)
        starts = [
            np.append(best, [math.log(start), math.log(0.05)]) for start in np.geomspace(1.1 * low, 0.9 * high, STARTS)
        ]
        starts.sort(key=lambda x: float(np.sum(measured.solved(x)[0] ** 2)))
        fits = [least_squares(lambda x: measured.solved(x)[0], x, bounds=bounds) for x in starts[:FITTED]]
        found = min(fits, key=lambda fit: float(fit.cost))
        left, weighed = measured.solved(found.x)
        distinct = float(np.min(weighed[RIGID:])) > TELLING * float(weighed[0])
        near = float(np.min(np.diff(np.sort(found.x[0::2])), initial=math.inf)) < math.log(APART)
        near = near or float(np.max(found.x[1::2])) > math.log(0.99 * DAMPED[1])
        if near or not distinct or left @ left > (1.0 - EXPLAINED) * (missed @ missed):
            break
        best, missed, masses = found.x, left, weighed
    frequencies, dampings = np.exp(best[0::2]), np.exp(best[1::2])
    rows = sorted(zip(frequencies.tolist(), dampings.tolist(), masses[RIGID:].tolist(), strict=True))
    return ResonanceSearch(tuple(Resonance(*row) for row in rows), float(masses[0]), float(np.mean(both[band])))
