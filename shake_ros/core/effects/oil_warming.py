"""The oil warms, or cools, while the table is recorded: the laws of plant/temperature.py at T_0 + ΔT(t).

    ΔT = r t,  viscous friction ∝ η = exp(−λ_1 ΔT) (2.4),  laminar leakage ∝ 1/η,  flow coefficient ∝ 1/√ρ,
    laminar pressure ∝ η²/ρ,  ρ ∝ 1/(1 + β_T ΔT) (2.18),  bulk modulus ∝ 1 − γ ΔT

t is the time since the start of the recording. The oil of the pilot stage and of the pipelines keeps its viscosity; a
drift ends at ±60 K. Absent at r = 0. Verified against the table at the temperature that it has reached.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from shake_ros.core.compiled import njit
from shake_ros.core.effects.effect import Effect
from shake_ros.core.quantities import quantity

LARGEST = 60.0  # [K] where a drift ends


@dataclass(frozen=True)
class OilWarming(Effect):
    """Oil that warms within a recording."""

    place: ClassVar[str] = "compressibility"
    depends_on: ClassVar[tuple[str, ...]] = ("time",)

    rate: float = quantity("K/s", "rise of the oil's temperature r", low=-20.0, high=20.0, default=0.0)
    viscosity_decay: float = quantity("1/K", "viscosity-temperature coefficient λ_1", low=0.0, high=0.2, default=0.045)
    modulus_slope: float = quantity(
        "1/K", "relative loss of bulk modulus per temperature γ", low=0.0, high=0.015, default=3.8e-3
    )
    expansion: float = quantity("1/K", "heat expansion factor of the oil β_T", low=0.0, high=0.01, default=6.5e-4)


@njit
def warmer(clock, rate):
    """ΔT at a time of the recording [K].

    >>> float(warmer(100.0, 0.05)), float(warmer(1e5, 0.05))
    (5.0, 60.0)
    """
    return min(max(rate * clock, -LARGEST), LARGEST)


@njit
def thickness(rise, decay):
    """η over that at the recording's start (2.4) [-]."""
    return math.exp(-decay * rise)


@njit
def lightness(rise, expansion):
    """ρ over that at the recording's start (2.18) [-]."""
    return 1.0 / (1.0 + expansion * rise)


@njit
def stiffness(rise, slope):
    """Bulk modulus over that at the recording's start [-]."""
    return 1.0 - slope * rise
