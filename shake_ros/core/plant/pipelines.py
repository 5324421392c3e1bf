"""Pipelines between the valve and the chambers: the inertia of the oil, its friction, and the volume at the valve.

    (ρ L/A) Q̇ = P_1 − P_2 − Δp(Q),  Ṗ_valve = E/(A L/2) (Q_valve − Q)

One lump per line, the cylinder's half of the line's volume counting as dead volume; valid well below the frequency of
a pressure wave, a/(4 L). Δp is that of fluid/pipe_flow.py, laminar or turbulent. Absent at length 0.
Source: thesis 2.6. Verified against the line's own frequency and the steady drop.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from shake_ros.core.compiled import kernel
from shake_ros.core.fluid.pipe_flow import pressure_drop
from shake_ros.core.quantities import Parameters, quantity


@dataclass(frozen=True)
class Pipelines(Parameters):
    """Two equal lines between valve and cylinder."""

    length: float = quantity("m", "length L of each line", low=0.0, high=20.0, default=0.0)
    diameter: float = quantity("m", "inner diameter d", low=1e-3, high=0.2, default=0.012)
    density: float = quantity("kg/m^3", "density ρ of the oil", low=500.0, high=2000.0, default=870.0)
    viscosity: float = quantity("Pa*s", "dynamic viscosity η of the oil", low=1e-4, high=10.0, default=0.028)


@kernel
def flow_rate(flow, pressure_in, pressure_out, length, diameter, density, viscosity):
    """Q̇ of a line [m³/s²]."""
    inertance = density * length / (0.25 * math.pi * diameter * diameter)
    return (pressure_in - pressure_out - pressure_drop(flow, length, diameter, viscosity, density)) / inertance


@kernel
def half_volume(length, diameter):
    """Half the oil volume of a line [m³]."""
    return 0.125 * math.pi * diameter * diameter * length
