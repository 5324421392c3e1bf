"""The cylinder with two sides that may differ, (3.23), (3.24): areas, volumes, rest, steady speeds, oil spring.

    A_B = r A_A;  V_A = V_t s + V_pl,A + A_A x,  V_B = V_t (1 − s) + V_pl,B − A_B x

with r the ratio of the areas, s the share of chamber A in V_t at mid-stroke, V_pl the volumes of the lines. r = 1 and
s = 1/2 is the double rod of the thesis. The load pressure is the one that moves the piston, P_L = P_A − r P_B, so that
the force is A_A P_L on either cylinder; at rest P_A = r P_B. Through both open edges of the valve (3.17) the unloaded
piston runs out at v_+ and back at v_−,

    v_± = C_v/A_A sqrt(Δ_±/(1 + r³)),  Δ_+ = P_s − r P_T,  Δ_− = r P_s − P_T,

so a symmetric valve moves it faster towards the side whose area is the smaller on the way in. Verified against a
plant written separately and the operating points of this one.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from shake_ros.core.compiled import kernel
from shake_ros.core.plant.parameters import TableParameters

SMALLEST_PART = 0.02  # of a chamber's volume at mid-stroke, which the right-hand side keeps in it


class Sides(NamedTuple):
    """A quantity of chamber A and the same of chamber B."""

    a: float
    b: float


@kernel
def load_pressure(p, pressure_a, pressure_b):
    """P_L = P_A − r P_B [Pa]."""
    return pressure_a - p.body_area_ratio * pressure_b


@kernel
def chamber_volumes(p, piston, dead):
    """V_A, V_B (6.11), (3.24) at a piston position [m] with oil that the declared volumes leave out [m³]."""
    half_a = p.body_volume_share * p.body_cylinder_volume
    half_b = p.body_cylinder_volume - half_a
    swept = p.body_piston_area * piston
    # the end stops keep the piston off the covers
    v_a = max(half_a + swept, SMALLEST_PART * half_a) + dead + p.body_line_volume_a
    v_b = max(half_b - p.body_area_ratio * swept, SMALLEST_PART * half_b) + dead + p.body_line_volume_b
    return v_a, v_b


def areas(table: TableParameters) -> Sides:
    """A_A, A_B [m²]."""
    return Sides(table.body.piston_area, table.body.area_ratio * table.body.piston_area)


def volumes(table: TableParameters, position: float = 0.0) -> Sides:
    """V_A, V_B (3.24) with every dead volume, the piston `position` [m] off mid-stroke [m³]."""
    body, area = table.body, areas(table)
    half_a = body.volume_share * body.cylinder_volume
    half_b = body.cylinder_volume - half_a
    dead = table.value("effects.dead_volume.volume")
    v_a = max(half_a + area.a * position, SMALLEST_PART * half_a)
    v_b = max(half_b - area.b * position, SMALLEST_PART * half_b)
    return Sides(v_a + dead + body.line_volume_a, v_b + dead + body.line_volume_b)


def rest_pressures(supply: float, tank: float, area_ratio: float) -> Sides:
    """P_A = r P_B with P_A + P_B = P_s + P_T: the piston at rest on a shut symmetric valve [Pa].

    >>> rest_pressures(200e5, 10e5, 1.0), rest_pressures(210e5, 0.0, 0.5)
    (Sides(a=10500000.0, b=10500000.0), Sides(a=7000000.0, b=14000000.0))
    """
    total = supply + tank
    share = area_ratio / (1.0 + area_ratio)
    return Sides(total * share, total - total * share)


class Speeds(NamedTuple):
    """Velocity of the unloaded piston at full opening of the valve, out along +x and back, both positive [m/s]."""

    out: float
    back: float


def pressure_left(table: TableParameters) -> Sides:
    """Δ_+ and Δ_−, the load pressures that stop the piston on its way out and back [Pa]."""
    ratio, high = table.body.area_ratio, table.supply.supply_pressure
    low = table.supply.tank_pressure + table.value("effects.tank_back_pressure.pressure")
    return Sides(max(high - ratio * low, 0.0), max(ratio * high - low, 0.0))


def steady_speeds(table: TableParameters) -> Speeds:
    """v_+ and v_− of the unloaded piston (3.17), without the valve's gain and underlap [m/s]."""
    left, per_flow = pressure_left(table), 1.0 + table.body.area_ratio**3
    flow = table.value("valve.flow_coefficient")
    out, back = (flow * math.sqrt(part / per_flow) / table.body.piston_area for part in left)
    return Speeds(out, back)


def oil_spring(table: TableParameters, moduli: Sides, position: float = 0.0) -> float:
    """k = E_A A_A²/V_A + E_B A_B²/V_B (2.25) [N/m]."""
    area, volume = areas(table), volumes(table, position)
    return moduli.a * area.a**2 / volume.a + moduli.b * area.b**2 / volume.b  # (2.25)
