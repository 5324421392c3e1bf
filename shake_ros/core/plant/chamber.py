"""What a chamber of the cylinder may do beyond (3.25), (3.26): cavitate, and be fed through a pipeline.

Cavitation: a chamber's pressure falls to a limit and stays there while a void opens, and rises when the void has
closed.

The integrated state is the pressure p̃ that the liquid would have if it could bear tension; below the limit it
measures the void, V_void = V (p_c − p̃)/E. The pressure that acts on piston, valve and leakage is

    P = p̃                                  for p̃ ≥ p_c + w
    P = p_c + w exp((p̃ − p_c − w)/w)       below,

once differentiable, never at or below p_c. So the oil that is missing in a chamber must flow in before its pressure
rises again, without a state or an event for the void. With a modulus that changes on the way the void is met
approximately. Above p_c + w nothing differs from a table without cavitation. Absent at w = 0. p_c is about the
pressure of saturated vapour, or some tenths of a bar where dissolved air comes out.

Pipelines between the valve and the chambers: the inertia of the oil, its friction, and the volume at the valve.

    (ρ L/A) Q̇ = P_1 − P_2 − Δp(Q),  Ṗ_valve = E/(A L/2) (Q_valve − Q)

One lump per line, the cylinder's half of the line's volume counting as dead volume; valid well below the frequency of
a pressure wave, a/(4 L). Δp is that of fluid/flow.py, laminar or turbulent. Absent at length 0.
Source: thesis 2.6. Verified against the line's own frequency and the steady drop.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from shake_ros.core.compiled import kernel, njit
from shake_ros.core.fluid.flow import pressure_drop
from shake_ros.core.quantities import Parameters, quantity


@dataclass(frozen=True)
class Cavitation(Parameters):
    """Lowest pressure of a chamber."""

    width: float = quantity("Pa", "range w above the limit in which cavitation sets in", low=0.0, high=1e6, default=0.0)
    pressure: float = quantity(
        "Pa", "absolute pressure p_c that no chamber falls below", low=0.0, high=1e6, default=0.0
    )


@njit
def acting_pressure(liquid_pressure, limit, width):
    """P of a chamber from the pressure p̃ of its liquid [Pa].

    >>> float(acting_pressure(3e5, 1e4, 5e4)), round(float(acting_pressure(-1e9, 1e4, 5e4)))
    (300000.0, 10000)
    """
    if width <= 0.0 or liquid_pressure >= limit + width:
        return liquid_pressure
    return limit + width * math.exp((liquid_pressure - limit - width) / width)


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
