"""Cavitation: a chamber's pressure falls to a limit and stays there while a void opens, and rises when the void has
closed.

The integrated state is the pressure p̃ that the liquid would have if it could bear tension; below the limit it
measures the void, V_void = V (p_c − p̃)/E. The pressure that acts on piston, valve and leakage is

    P = p̃                                  for p̃ ≥ p_c + w
    P = p_c + w exp((p̃ − p_c − w)/w)       below,

once differentiable, never at or below p_c. So the oil that is missing in a chamber must flow in before its pressure
rises again, without a state or an event for the void. With a modulus that changes on the way the void is met
approximately. Above p_c + w nothing differs from a table without cavitation. Absent at w = 0. p_c is about the
pressure of saturated vapour, or some tenths of a bar where dissolved air comes out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from shake_ros.core.compiled import njit
from shake_ros.core.quantities import Parameters, quantity


@dataclass(frozen=True)
class Cavitation(Parameters):
    """Lowest pressure of a chamber."""

    width: float = quantity("Pa", "range w above the limit in which the oil yields", low=0.0, high=1e6, default=0.0)
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
