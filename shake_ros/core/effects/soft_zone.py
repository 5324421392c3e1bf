"""The thesis's soft zone, (6.18)–(6.20): the chambers yield more while the load pressure is small.

    h = 1 − d/2 [tanh(μ(P_L + P_Lt)) − tanh(μ(P_L − P_Lt))] / tanh(μ P_Lt),  P_L = P_A − P_B,  E → E h

The two steps are evaluated as one fraction, h = 1 − d (1 + cosh 2μP_Lt)/(cosh 2μP_L + cosh 2μP_Lt), which is the same.
With λ_1 and λ_2 of (6.20): d = 2 (λ_2/λ_1) tanh(μ P_Lt), and λ_1 belongs to E. So h = 1 − d at P_L = 0 and 1 far away.
Table 6.9: d = 0.84, P_Lt = 9.2 bar. Absent at d = 0.

A modulus of chamber A that depends on the pressure of B is no property of oil: around a closed cycle of the two
pressures (6.18), (6.19) take up work, or give it the other way round (`plant/chamber_work.py`), and lose or make oil.
`exchange` is the same softness without that: both chambers keep E, and a volume V_x(P_L) passes from A to B as of a
seal or a separating part that yields,

    dV_x = c(P_L) dP_L,  c = x (V_t/4E) (1/h − 1),

so that with x = 1 the two together yield at mid-stroke as with h. Its energy ∫ c P_L dP_L depends on P_L alone.
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
    exchange: float = quantity(
        "-", "0: (6.20) on E; x: as volume exchanged between the chambers", low=0.0, high=2.0, default=0.0
    )


@njit
def factor(load_pressure, depth, threshold, sharpness):
    """h of (6.20) with λ_1 = 1 [-]."""
    edge = math.exp(-2.0 * sharpness * threshold)
    slope = 2.0 * sharpness * abs(load_pressure)
    beyond = math.exp(slope - 2.0 * sharpness * threshold) + edge * math.exp(-slope)
    return 1.0 - depth * (1.0 + edge) * (1.0 + edge) / (1.0 + edge * edge + beyond)


@njit
def exchanged(rate_a, rate_b, stiffness_a, stiffness_b, compliance, area_ratio):
    """Ṗ_A, Ṗ_B where a volume of c Ṗ_L passes from A to B, P_L = P_A − r P_B, from those without it [Pa/s].

    Parameters
    ----------
    rate_a, rate_b : k_A Q_A, k_B Q_B of the net flows into the chambers [Pa/s]. stiffness_a, stiffness_b : k = E/V of
        each [Pa/m³]. compliance : c [m³/Pa]. area_ratio : r [-].
    """
    load = rate_a - area_ratio * rate_b
    load /= 1.0 + compliance * (stiffness_a + area_ratio * area_ratio * stiffness_b)
    passed = compliance * load
    return rate_a - stiffness_a * passed, rate_b + area_ratio * stiffness_b * passed
