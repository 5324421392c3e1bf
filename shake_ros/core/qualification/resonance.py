"""Resonances of a specimen from the force on the table and its acceleration: no sensor on the specimen is needed.

The table with a flexible specimen answers the cylinder's force F with the apparent mass

    F/a = m_r + c/(jω) + m_q (ω_q² + 2 j ζ ω_q ω)/(ω_q² − ω² + 2 j ζ ω_q ω),

the rigid mass, what is viscous, and one oscillator of mass m_q. Its terms are fitted to the measured ratio, averaged
over segments, weighted by the coherence. Friction adds a force that is not in proportion: it lowers the coherence.
The response of a mass on a spring to the motion of its base; any textbook of vibration.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
SEGMENT = 8.0  # [s], of a spectrum
STARTS = 16  # frequencies from which the fit starts
TELLING = 0.03  # share of the rigid mass from which a moving mass is one


@dataclass(frozen=True)
class Resonance:
    """What a search found: frequency [Hz], damping [-], moving mass and rigid mass [kg], mean coherence [-]."""

    frequency: float
    damping: float
    mass: float
    rigid_mass: float
    coherence: float

    @property
    def found(self) -> bool:
        """Whether there is a resonance: its mass is told from the rigid one."""
        return self.mass > TELLING * self.rigid_mass

    def moved(self, after: Resonance) -> float:
        """Change of the frequency until a later search, −1 where the resonance is gone; 0 where there was none [-]."""
        if not self.found:
            return 0.0
        return after.frequency / self.frequency - 1.0 if after.found else -1.0

    def __str__(self) -> str:
        if not self.found:
            return f"none in the band (rigid mass {self.rigid_mass:.0f} kg)"
        return f"{self.frequency:.2f} Hz, damping {100.0 * self.damping:.1f} %, moving mass {self.mass:.0f} kg"


@dataclass(frozen=True)
class SearchBand:
    """Where a resonance is sought [Hz], and the piston areas [m²] that make a force of two pressures."""

    low: float
    high: float
    piston_area: float
    area_ratio: float = 1.0  # of chamber B

    def of(self, pressure_a: Array, pressure_b: Array, acceleration: Array, time_step: float) -> Resonance:
        """The resonance in a recording of both pressures [Pa] and the acceleration [m/s²], (n,) each."""
        force = self.piston_area * (pressure_a - self.area_ratio * pressure_b)
        return search(force, acceleration, time_step, self.low, self.high)


def _columns(omega: Array, frequency: float, damping: float) -> NDArray[np.complex128]:
    w = 2.0 * math.pi * frequency
    spring = (w**2 + 2j * damping * w * omega) / (w**2 - omega**2 + 2j * damping * w * omega)
    return np.column_stack([np.ones_like(omega, dtype=complex), 1.0 / (1j * omega), spring])


def search(force: Array, acceleration: Array, time_step: float, low: float, high: float) -> Resonance:
    """The resonance between low and high [Hz] in a recording of force [N] and acceleration [m/s²], (n,) each."""
    from scipy.optimize import least_squares
    from scipy.signal import coherence, csd, welch

    n = min(force.size, round(SEGMENT / time_step))
    f, cross = csd(acceleration, force, 1.0 / time_step, nperseg=n)
    _, power = welch(acceleration, 1.0 / time_step, nperseg=n)
    _, both = coherence(acceleration, force, 1.0 / time_step, nperseg=n)
    band = (f >= low) & (f <= high)
    ratio, weight, omega = (cross / power)[band], np.sqrt(both[band]), 2.0 * math.pi * f[band]

    def solved(x: Array) -> tuple[Array, Array]:
        columns = _columns(omega, float(np.exp(x[0])), float(np.exp(x[1]))) * weight[:, None]
        wanted = ratio * weight
        a = np.concatenate([columns.real, columns.imag])
        b = np.concatenate([wanted.real, wanted.imag])
        masses = np.linalg.lstsq(a, b, rcond=None)[0]
        return np.asarray(a @ masses - b), masses

    bounds = ([math.log(low), math.log(0.002)], [math.log(high), math.log(0.5)])
    fits = [
        least_squares(lambda x: solved(x)[0], [math.log(start), math.log(0.05)], bounds=bounds)
        for start in np.geomspace(1.1 * low, 0.9 * high, STARTS)
    ]
    best = min(fits, key=lambda fit: float(fit.cost))
    masses = solved(best.x)[1]
    frequency, damping = np.exp(best.x)
    return Resonance(float(frequency), float(damping), float(masses[2]), float(masses[0]), float(np.mean(both[band])))
