"""Work that the oil takes up around a closed cycle of both chamber pressures, the piston held in its place.

    W = ∮ P_A dV_A + P_B dV_B,  dV = C dP,  C = diag(V/E) + c [[1, −r], [−r, r²]]

with dV the oil that flows in, c the compliance of an exchanged volume. Zero for any law whose E is a function of the
chamber's own pressure, and for the exchanged volume. With h(P_L) of (6.18), (6.19) the integrand has the curl
(V/E)(P_A + P_B) d(1/h)/dP_L, so one way round it takes up work and the other way it makes it. Verified against the
plant's own rates and the double integral of the curl.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from shake_ros.core.plant.cylinder import rest_pressures, volumes
from shake_ros.core.plant.hydraulics import chamber_moduli, exchange_compliance
from shake_ros.core.plant.parameters import FULL_LAYOUT, TableParameters

STEPS = 400  # of each side of the cycle, by the midpoint rule


def compliance(table: TableParameters, pressure_a: float, pressure_b: float) -> NDArray[np.float64]:
    """C of both chambers at mid-stroke: oil that flows in per pressure, shape (2, 2) [m³/Pa]."""
    p = FULL_LAYOUT.alone(table.vector())[0]
    return _compliance(p, table, pressure_a, pressure_b)


def _compliance(p: object, table: TableParameters, pressure_a: float, pressure_b: float) -> NDArray[np.float64]:
    volume, ratio = volumes(table), table.body.area_ratio
    e_a, e_b = chamber_moduli(p, pressure_a, pressure_b)
    passed = 0.0
    if table.value("effects.soft_zone.depth") > 0.0 and table.value("effects.soft_zone.exchange") > 0.0:
        passed = float(exchange_compliance(p, pressure_a, pressure_b))
    return np.diag([volume.a / e_a, volume.b / e_b]) + passed * np.array([[1.0, -ratio], [-ratio, ratio**2]])


def work_of_cycle(table: TableParameters, swing: float, backwards: bool = False) -> float:
    """Work that is left behind by one cycle [J].

    From the pressures of rest P_A rises by `swing` [Pa], then P_B, then both fall together; `backwards` goes round the
    other way.
    """
    p = FULL_LAYOUT.alone(table.vector())[0]
    rest = np.array(rest_pressures(table.supply.supply_pressure, table.supply.tank_pressure, table.body.area_ratio))
    corners = rest + swing * np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 0.0]])
    if backwards:
        corners = corners[::-1]
    work = 0.0
    for start, end in zip(corners[:-1], corners[1:], strict=True):
        step = (end - start) / STEPS
        for k in range(STEPS):
            pressures = start + (k + 0.5) * step
            work += float(pressures @ _compliance(p, table, *pressures) @ step)
    return work
