"""The simulated hydraulic power unit: its pressure follows the stage that the interlock asks for, with a lag."""

from __future__ import annotations

import math
from dataclasses import dataclass

from shake_ros.core.quantities import Parameters, quantity
from shake_ros.core.safety.stages import HIGH, LOW


@dataclass(frozen=True)
class PowerUnitParameters(Parameters):
    """Pressures and lag of the unit; its high pressure is the table's supply pressure."""

    low_pressure: float = quantity("Pa", "supply pressure at the stage `low`", low=1e5, high=1e8)
    pressure_time: float = quantity("s", "time constant of the supply pressure", low=0.0, high=60.0)


class PowerUnit:
    """Supply pressure over time.

    Parameters
    ----------
    parameters : of the unit. high_pressure, tank_pressure : [Pa].
    stage : at the start.
    """

    def __init__(self, parameters: PowerUnitParameters, high_pressure: float, tank_pressure: float, stage: int) -> None:
        self.parameters = parameters
        self.high_pressure = high_pressure
        self.tank_pressure = tank_pressure
        self.failed = False
        self.pressure = self._wanted(stage)

    def _wanted(self, stage: int) -> float:
        if stage >= HIGH and not self.failed:
            return self.high_pressure
        if stage == LOW and not self.failed:
            return min(self.parameters.low_pressure, self.high_pressure)
        return self.tank_pressure

    def change_high_pressure(self, pressure: float) -> None:
        """Another high pressure [Pa]; at once where the unit delivers high pressure."""
        if self.pressure == self.high_pressure:
            self.pressure = pressure
        self.high_pressure = pressure

    def advance(self, stage: int, dt: float) -> float:
        """Supply pressure [Pa] after `dt` [s] at a stage; exactly the wanted one once it is reached.

        >>> unit = PowerUnit(PowerUnitParameters(5e6, 0.1), 2e7, 1e5, HIGH)
        >>> unit.advance(HIGH, 0.001), round(unit.advance(0, 0.1) / 1e5, 1)
        (20000000.0, 74.2)
        """
        wanted = self._wanted(stage)
        if self.pressure != wanted:
            lag = self.parameters.pressure_time
            left = (self.pressure - wanted) * math.exp(-dt / lag) if lag > 0.0 else 0.0
            self.pressure = wanted + left if abs(left) > 1.0 else wanted
        return self.pressure
