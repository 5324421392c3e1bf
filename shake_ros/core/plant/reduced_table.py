"""A table whose hydraulics are not declared: β_1 … β_5 of (6.36) with effects, forces per moved mass.

Nothing tells mass, areas or pressures apart there, so every force of an effect counts per moved mass: newton becomes
m/s². The slowdown of a valve is relative to a declared one; here the valve's own lag takes its place.
"""

from __future__ import annotations

from shake_ros.core.plant.reduced import ReducedParameters
from shake_ros.core.plant.small_table import Layout, SmallTable

REDUCED_LAYOUT = Layout(
    "reduced", "dynamics", ReducedParameters, forces_per_mass=True, without=("effects.slow_valve.slowdown",)
)


def reduced_table(parameters: ReducedParameters) -> SmallTable:
    """The reduced table without effects."""
    return SmallTable(REDUCED_LAYOUT, parameters)
