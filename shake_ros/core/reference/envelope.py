"""What a table can do at most: stroke, velocity at full valve opening, acceleration at full pressure."""

from __future__ import annotations

from typing import NamedTuple

from shake_ros.core.plant.cylinder import pressure_left, steady_speeds
from shake_ros.core.plant.parameters import TableParameters


class Envelope(NamedTuple):
    """Largest position [m], velocity [m/s] and acceleration [m/s²]."""

    position: float
    velocity: float
    acceleration: float


def envelope(table: TableParameters) -> Envelope:
    """The table's bounds, each with the others at zero.

    Half the stroke; C_v √((P_s − P_T)/2) / A_p, the velocity of the unloaded cylinder through both edges of the open
    valve (3.17); and A_p (P_s − P_T) / M (6.4). The velocity that is left at an acceleration a is v √(1 − a/a_max).
    Where the two areas differ, those of the weaker direction.
    """
    return Envelope(
        position=0.5 * table.body.stroke,
        velocity=min(steady_speeds(table)),  # (3.17)
        acceleration=table.body.piston_area * min(pressure_left(table)) / table.moved_mass,  # (6.4)
    )
