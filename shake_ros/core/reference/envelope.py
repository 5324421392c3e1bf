"""What a table can do at most: stroke, velocity at full valve opening, acceleration at full pressure."""

from __future__ import annotations

import math
from typing import NamedTuple

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
    """
    pressure = max(table.supply.supply_pressure - table.supply.tank_pressure, 0.0)
    area = table.body.piston_area
    return Envelope(
        position=0.5 * table.body.stroke,
        velocity=table.value("valve.flow_coefficient") * math.sqrt(0.5 * pressure) / area,  # (3.17)
        acceleration=area * pressure / table.moved_mass,  # (6.4)
    )
