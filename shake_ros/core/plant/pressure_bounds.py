"""Between which pressures the chambers can be, and the samples of a run that leave them.

Below: with cavitation no chamber falls to its limit p_c. Without it, as the declared table stands, the oil of the model
bears tension, so a pressure below absolute zero is possible and tells that the run left what the model describes.

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

import numpy as np
from numpy.typing import NDArray

from shake_ros.core.plant.cylinder import Sides, areas, volumes
from shake_ros.core.plant.parameters import TableParameters

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
    speed : largest speed of the piston |v| [m/s]. reach : largest distance from mid-stroke |x| [m].
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
    table : whose chambers are watched. sample_time : [s].
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
            found.append(f"a chamber at {self._highest:.4g} Pa, above {bound:.4g} Pa that supply and inertia can make")
        return tuple(found)


def findings_of_run(table: TableParameters, result: NDArray[np.float64], sample_time: float) -> tuple[str, ...]:
    """What `PressureWatch` finds in the result of a run, shape (n, 7)."""
    watch = PressureWatch(table, sample_time)
    for row in result:
        watch.observe(row[0], row[1], row[3], row[4])
    return watch.findings()
