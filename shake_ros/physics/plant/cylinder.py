"""The cylinder with two sides that may differ, (3.23), (3.24): areas, volumes, rest, steady speeds, oil spring.

    A_B = r A_A;  V_A = V_t s + V_pl,A + A_A x,  V_B = V_t (1 − s) + V_pl,B − A_B x

with r the ratio of the areas, s the share of chamber A in V_t at mid-stroke, V_pl the volumes of the lines. r = 1 and
s = 1/2 is the double rod of the thesis. The load pressure is the one that moves the piston, P_L = P_A − r P_B, so that
the force is A_A P_L on either cylinder; at rest P_A = r P_B. Through both open edges of the valve (3.17) the unloaded
piston runs out at v_+ and back at v_−,

    v_± = C_v/A_A sqrt(Δ_±/(1 + r³)),  Δ_+ = P_s − r P_T,  Δ_− = r P_s − P_T,

so a symmetric valve moves it faster towards the side whose area is the smaller on the way in. Verified against a
plant written separately and the operating points of this one.

Between which pressures the chambers can be, and the samples of a run that leave them.

Below: with cavitation no chamber falls to its limit p_c. Without it, as the declared table stands, the oil of the model
bears tension, so a pressure below absolute zero is possible and shows that the run left the range of the model.

Above: a chamber beyond supply pressure takes in nothing, its edges and its leakages let oil out, so it rises only while
the piston moves into it, V Ṗ/E ≤ A w with w the speed into the chamber, and the piston pays for it,
M ẇ ≤ −A P + A' P_s + F (the other chamber, of area A', is fed at no more than P_s and grows). Together, from the
instant at which P passes the larger of P_s and c = (A' P_s + F)/A with the speed w_1,

    ½ (V/E) (P − max(P_s, c))² ≤ ½ M w_1²,  so  P ≤ max(P_s, c) + w sqrt(E M/V)

with the largest speed w and force F and the smallest volume V of the run: inertia against the oil spring (2.25). Holds
for a modulus that does not rise with pressure and a table in one piece: `LOOSE` names what it does not hold with.
Verified against violent
runs with and without cavitation, and closely met by one that is shut at full speed.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from shake_ros.compiled import kernel
from shake_ros.physics.effects.valve import effective_underlap
from shake_ros.physics.plant.parameters import FULL_LAYOUT, TableParameters

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
    dead = table.value("effects.dead_volume.volume")
    return Sides(*chamber_volumes(FULL_LAYOUT.records(table.vector())[0], position, dead))


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


def underlap_left(table: TableParameters) -> float:
    """Underlap that is open in the middle of a table's valve, with what a dead band closes taken off [-]."""
    width, closed = (table.value(f"effects.spool_deadband.{name}") for name in ("width", "closed"))
    return max(float(effective_underlap(table.value("valve.underlap"), width, closed)), 0.0)


def oil_spring(table: TableParameters, moduli: Sides, position: float = 0.0) -> float:
    """k = E_A A_A²/V_A + E_B A_B²/V_B (2.25) [N/m]."""
    area, volume = areas(table), volumes(table, position)
    return moduli.a * area.a**2 / volume.a + moduli.b * area.b**2 / volume.b  # (2.25)


LOOSE = (  # what lets a chamber rise above the bound, or swings beside the table with a motion of its own
    "bulk_modulus.kind",
    "effects.pressure_dependent_bulk_modulus.slope",
    "effects.unlisted.kind",
    "effects.coupling_backlash.gap",
    "effects.base_flexibility.compliance",
    "effects.specimen_resonance.mass",
    "frame.storeys",
    "pipelines.length",
)


def smallest_volumes(table: TableParameters, reach: float) -> Sides:
    """Volume of each chamber where the piston is `reach` [m] off mid-stroke towards it (6.11), (3.24) [m³]."""
    return Sides(volumes(table, -reach).a, volumes(table, reach).b)


def highest_pressure(table: TableParameters, speed: float, reach: float, force: float = 0.0) -> float:
    """Pressure that no chamber passes [Pa].

    Parameters
    ----------
    speed : largest speed of the piston |v| [m/s].
    reach : largest distance from mid-stroke |x| [m].
    force : largest external force along the motion [N].
    """
    mass = table.moved_mass + max(table.value("effects.payload_error.mass"), 0.0)
    supply, area = table.value("supply.supply_pressure"), areas(table)
    highest = 0.0
    for own, other, volume in zip(area, reversed(area), smallest_volumes(table, reach), strict=True):
        surge = speed * math.sqrt(table.value("bulk_modulus.modulus") * mass / volume)
        held = max(supply, other / own * supply + abs(force) / own)
        highest = max(highest, held + surge)
    return highest


class PressureWatch:
    """Counts the samples at which a chamber's pressure is not one that oil can have.

    Parameters
    ----------
    table : whose chambers are watched.
    sample_time : [s].
    """

    def __init__(self, table: TableParameters, sample_time: float) -> None:
        self._table, self._sample_time = table, sample_time
        self._limit = table.cavitation.pressure if table.cavitation.width > 0.0 else 0.0
        self._below = {"pressure_a": 0, "pressure_b": 0}
        self._speed = self._reach = 0.0
        self._highest = -math.inf

    def observe(self, position: float, velocity: float, pressure_a: float, pressure_b: float) -> None:
        """Take in one sample of the piston's motion [m], [m/s] and of the pressures that act [Pa] ×2."""
        self._below["pressure_a"] += pressure_a < self._limit
        self._below["pressure_b"] += pressure_b < self._limit
        self._speed, self._reach = max(self._speed, abs(velocity)), max(self._reach, abs(position))
        self._highest = max(self._highest, pressure_a, pressure_b)

    def findings(self) -> tuple[str, ...]:
        """One sentence for each thing that was seen; empty where all pressures are possible."""
        bounded = self._limit > 0.0
        below = f"below its cavitation limit {self._limit:g} Pa" if bounded else "below absolute zero"
        reason = "" if bounded else ": the table has no cavitation"
        found = [
            f"{name} {below} for {1e3 * count * self._sample_time:g} ms{reason}"
            for name, count in self._below.items()
            if count
        ]
        table = self._table
        force = abs(table.value("effects.constant_force.force"))
        force += table.value("effects.stiffness_to_ground.stiffness") * self._reach
        bound = highest_pressure(table, self._speed, self._reach, force)
        if self._highest > bound and not any(table.value(name) for name in LOOSE):
            found.append(
                f"a chamber at {self._highest:.4g} Pa, above {bound:.4g} Pa that supply and inertia can produce"
            )
        return tuple(found)
