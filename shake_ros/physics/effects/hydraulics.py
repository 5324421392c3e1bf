"""What the oil may do on its way beyond the declared model: leakage, supply, return, compressibility, temperature."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from shake_ros.compiled import njit
from shake_ros.physics.effects.effect import Effect
from shake_ros.quantities import quantity


@dataclass(frozen=True)
class TurbulentLeakage(Effect):
    """Turbulent leakage across the piston.

    Leakage past the piston through a short gap or scratch, turbulent instead of laminar.

        Q_t = C_t sroot(P_A − P_B), added to the laminar (3.25)

    Absent at C_t = 0. Same smooth root as the ports.
    """

    place: ClassVar[str] = "flow"
    depends_on: ClassVar[tuple[str, ...]] = ("load_pressure",)

    coefficient: float = quantity("m^3/(s*sqrt(Pa))", "turbulent leakage coefficient", low=0.0, high=1e-6, default=0.0)


@dataclass(frozen=True)
class SupplyDroop(Effect):
    """Supply pressure that falls with the flow drawn.

    The supply pressure sinks with the flow drawn from it: a small pump, a long line or an accumulator.

        τ Ṗ_s = P_s0 − R_s Q_s − P_s,  Q_s = flow through the edges that open to the supply

    R_s Q_s is the steady droop; τ = R_s C_acc is the time in which an accumulator of capacity C_acc yields. Absent
    at R_s = 0.
    """

    place: ClassVar[str] = "supply"
    depends_on: ClassVar[tuple[str, ...]] = ("flow", "time")

    resistance: float = quantity("Pa*s/m^3", "steady droop per flow R_s", low=0.0, high=1e13, default=0.0)
    time_constant: float = quantity("s", "time constant τ of the droop", low=1e-3, high=10.0, default=0.02)


@njit
def pressure_rate(p, pressure, flow):
    """dP_s/dt [Pa/s]."""
    return (p.supply_supply_pressure - p.supply_droop_resistance * flow - pressure) / p.supply_droop_time_constant


@dataclass(frozen=True)
class TankBackPressure(Effect):
    """Tank pressure above the declared one.

    The return line holds the tank ports above the declared pressure: a check valve, a filter, a raised tank.

        P_T → P_T + ΔP

    Absent at ΔP = 0.
    """

    place: ClassVar[str] = "supply"
    depends_on: ClassVar[tuple[str, ...]] = ("flow",)

    pressure: float = quantity("Pa", "rise of the tank pressure ΔP", low=0.0, high=1e7, default=0.0)


@dataclass(frozen=True)
class PressureDependentBulkModulus(Effect):
    """Bulk modulus that rises with pressure.

    The oil stiffens with pressure, (2.28): E = E_0 + m (P − P_0).

    Absent at m = 0, where E is the declared constant. Evaluated by bulk_modulus/ifas.py.
    """

    place: ClassVar[str] = "compressibility"
    depends_on: ClassVar[tuple[str, ...]] = ("load_pressure",)

    slope: float = quantity("-", "rise of the bulk modulus per pressure m", low=0.0, high=300.0, default=0.0)


@dataclass(frozen=True)
class EntrainedAir(Effect):
    """Free air in the oil.

    Free air in the oil, (2.32): the mixture is soft at low pressure.

    α is the volume fraction of air at the table's `bulk_modulus.reference_pressure`. Absent at α = 0. Evaluated by
    bulk_modulus/ifas.py.
    """

    place: ClassVar[str] = "compressibility"
    depends_on: ClassVar[tuple[str, ...]] = ("load_pressure",)

    fraction: float = quantity(
        "-", "volume fraction α of free air at atmospheric pressure", low=0.0, high=0.3, default=0.0
    )
    polytropic_exponent: float = quantity("-", "polytropic exponent κ of the air", low=0.3, high=2.0, default=1.4)


@dataclass(frozen=True)
class SoftZone(Effect):
    """Soft oil column at low load pressure.

    The thesis's soft zone, (6.18)–(6.20): the chambers yield more while the load pressure is small.

        h = 1 − d/2 [tanh(μ(P_L + P_Lt)) − tanh(μ(P_L − P_Lt))] / tanh(μ P_Lt),  P_L = P_A − P_B,  E → E h

    The two steps are evaluated as one fraction, h = 1 − d (1 + cosh 2μP_Lt)/(cosh 2μP_L + cosh 2μP_Lt), which is
    the same. With λ_1 and λ_2 of (6.20): d = 2 (λ_2/λ_1) tanh(μ P_Lt), and λ_1 belongs to E. So h = 1 − d at P_L =
    0 and 1 far away. Table 6.9: d = 0.84, P_Lt = 9.2 bar. Absent at d = 0.

    A modulus of chamber A that depends on the pressure of B is no property of oil: around a closed cycle of the two
    pressures (6.18), (6.19) take up work, or give it the other way round (`thesis/bulk_modulus.py`), and lose or
    make oil. `exchange` is the same softness without that: both chambers keep E, and a volume V_x(P_L) passes from
    A to B as of a seal or a separating part that yields,

        dV_x = c(P_L) dP_L,  c = x (V_t/4E) (1/h − 1),

    so that with x = 1 the two together yield at mid-stroke as with h. Its energy ∫ c P_L dP_L depends on P_L alone.
    """

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
    rate_a, rate_b : k_A Q_A, k_B Q_B of the net flows into the chambers [Pa/s].
    stiffness_a, stiffness_b : k = E/V of each [Pa/m³].
    compliance : c [m³/Pa].
    area_ratio : r [-].
    """
    load = rate_a - area_ratio * rate_b
    load /= 1.0 + compliance * (stiffness_a + area_ratio * area_ratio * stiffness_b)
    passed = compliance * load
    return rate_a - stiffness_a * passed, rate_b + area_ratio * stiffness_b * passed


@dataclass(frozen=True)
class DeadVolume(Effect):
    """Additional oil volume at each chamber.

    Oil between valve and piston that the declared volumes leave out, (3.24).

        V_A → V_A + V_d, V_B → V_B + V_d

    Absent at V_d = 0.
    """

    place: ClassVar[str] = "compressibility"
    depends_on: ClassVar[tuple[str, ...]] = ("position",)

    volume: float = quantity("m^3", "volume V_d added to each chamber", low=0.0, high=1e-2, default=0.0)


LARGEST = 60.0  # [K] where a drift ends


@dataclass(frozen=True)
class OilWarming(Effect):
    """Oil that warms within a recording.

    The oil warms, or cools, while the table is recorded: the laws of plant/temperature.py at T_0 + ΔT(t).

        ΔT = r t,  viscous friction ∝ η = exp(−λ_1 ΔT) (2.4),  laminar leakage ∝ 1/η,  flow coefficient ∝ 1/√ρ,
        laminar pressure ∝ η²/ρ,  ρ ∝ 1/(1 + β_T ΔT) (2.18),  bulk modulus ∝ 1 − γ ΔT

    t is the time since the start of the recording. The oil of the pilot stage and of the pipelines keeps its
    viscosity; a drift ends at ±60 K. Absent at r = 0. Verified against the table at the temperature that it has
    reached.
    """

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
