"""A simulated table with its power unit and its faults, sample by sample: the machine under plant and emulator."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.physics.plant.table import Measurement, Table
from shake_ros.quantities import Parameters, quantity
from shake_ros.safety.causes import HIGH, LOW, OFF
from shake_ros.safety.faults import MachineFaults


@dataclass(frozen=True)
class PowerUnitParameters(Parameters):
    """Pressures and lag of the unit; its high pressure is the table's supply pressure."""

    low_pressure: float = quantity("Pa", "supply pressure at the stage `low`", low=1e5, high=1e8)
    pressure_time: float = quantity("s", "time constant of the supply pressure", low=0.0, high=60.0)


class PowerUnit:
    """Supply pressure over time.

    Parameters
    ----------
    parameters : of the unit.
    high_pressure, tank_pressure : [Pa].
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


REACHED = 0.9  # of its pressure confirms a stage
NO_FAULT: Mapping[str, float] = {}


class Machine:
    """What is moved and measured.

    Parameters
    ----------
    parameters, unit : of the table and of its power unit.
    sample_time : [s].
    seed : of the sensor noise.
    position : at the start [m].
    stage : of the hydraulics at the start.
    """

    def __init__(
        self,
        parameters: TableParameters,
        unit: PowerUnitParameters,
        sample_time: float,
        seed: int,
        position: float,
        stage: int,
    ) -> None:
        self.sample_time = sample_time
        self.on = NO_FAULT  # faults that are on, with their values
        self._seed = seed
        self.table = self.make(parameters)
        supply = parameters.supply
        self.unit = PowerUnit(unit, supply.supply_pressure, supply.tank_pressure, stage)
        self.state = self.table.initial_state(position)
        self.acting = 0.0
        self.samples = 0
        self._faults = MachineFaults(seed)
        self._supplied = supply.supply_pressure
        ahead = self.table.advance(self.state, 0.0)  # all is compiled before the first sample
        self.table.measure(ahead, 0)
        self.table.pressures(ahead)

    def make(self, parameters: TableParameters) -> Table:
        """A table of other parameters; ShakeError where there is none."""
        return Table(parameters, self.sample_time, self._seed)

    def change(self, parameters: TableParameters) -> None:
        """Take other parameters, between two samples."""
        self.table = self.make(parameters)
        self._supplied = parameters.supply.supply_pressure
        self.unit.change_high_pressure(self._supplied)

    def confirmed(self) -> int:
        """The stage whose pressure is there."""
        unit = self.unit
        if unit.pressure >= REACHED * unit.high_pressure:
            return HIGH
        return LOW if unit.pressure >= REACHED * unit.parameters.low_pressure else OFF

    def advance(self, stage: int, u: float) -> None:
        """One sample at a stage of the hydraulics under a command u; raises ShakeError as `Table.advance` does."""
        self.unit.failed = "supply_failure" in self.on
        self.acting = self._faults.valve(self.on, u, self.acting)
        pressure = self.unit.advance(stage, self.sample_time)
        if pressure != self._supplied:
            self.table.set_supply_pressure(pressure)
            self._supplied = pressure
        self.state = self.table.advance(self.state, self.acting)
        self.samples += 1

    def measure(self) -> Measurement:
        """What the sensors say now, NaN where they say nothing; the truth behind it is never at fault."""
        return self._faults.readings(self.on, self.table.measure(self.state, self.samples))
