"""The thesis's soft zone, (6.18)–(6.20): the chambers yield more while the load pressure is small.

    h = 1 − d/2 [tanh(μ(P_L + P_Lt)) − tanh(μ(P_L − P_Lt))] / tanh(μ P_Lt),  P_L = P_A − P_B,  E → E h

The two steps are evaluated as one fraction, h = 1 − d (1 + cosh 2μP_Lt)/(cosh 2μP_L + cosh 2μP_Lt), which is the same.
With λ_1 and λ_2 of (6.20): d = 2 (λ_2/λ_1) tanh(μ P_Lt), and λ_1 belongs to E. So h = 1 − d at P_L = 0 and 1 far away.
Table 6.9: d = 0.84, P_Lt = 9.2 bar. Absent at d = 0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from shake_ros.core.compiled import njit
from shake_ros.core.effects.effect import Effect
from shake_ros.core.quantities import quantity


@dataclass(frozen=True)
class SoftZone(Effect):
    """Soft oil column at low load pressure."""

    place: ClassVar[str] = "compressibility"
    depends_on: ClassVar[tuple[str, ...]] = ("load_pressure",)

    depth: float = quantity("-", "relative loss of stiffness d at zero load pressure", low=0.0, high=0.99, default=0.0)
    threshold: float = quantity("Pa", "load pressure P_Lt at the zone's edge", low=1e4, high=1e7, default=9.177e5)
    sharpness: float = quantity("1/Pa", "steepness μ of the zone's edge", low=1e-7, high=1e-4, default=8.8e-6)


@njit
def factor(load_pressure, depth, threshold, sharpness):
    """h of (6.20) with λ_1 = 1 [-]."""
    edge = math.exp(-2.0 * sharpness * threshold)
    slope = 2.0 * sharpness * abs(load_pressure)
    beyond = math.exp(slope - 2.0 * sharpness * threshold) + edge * math.exp(-slope)
    return 1.0 - depth * (1.0 + edge) * (1.0 + edge) / (1.0 + edge * edge + beyond)
