"""Faults of the machine itself: of its supply, its valve and its sensors. Plant and target emulator have the same.

A fault is on or off; those with a unit have a value besides. Which are on is a mapping of name to value.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from shake_ros.core.plant.table import Measurement
from shake_ros.core.quantities import Parameters, quantity

# fault → unit of its value, "" where it has none
MACHINE_FAULTS: dict[str, str] = {
    "supply_failure": "",
    "valve_stuck": "",
    "valve_stuck_at": "-",
    "position_off": "",
    "acceleration_off": "",
    "pressure_off": "",
    "position_frozen": "",
    "acceleration_frozen": "",
    "position_bias": "m",
    "acceleration_bias": "m/s^2",
    "position_noise": "m",
    "acceleration_noise": "m/s^2",
}
MISSING = {"position_off": "position", "acceleration_off": "acceleration", "pressure_off": "pressure_supply"}
FROZEN = {"position_frozen": "position", "acceleration_frozen": "acceleration"}
BIASED = {"position_bias": "position", "acceleration_bias": "acceleration"}
NOISY = {"position_noise": "position", "acceleration_noise": "acceleration"}


@dataclass(frozen=True)
class MachineFaultParameters(Parameters):
    """The switches of a node: all off, until one is set."""

    supply_failure: bool = quantity("", "the power unit stops, whatever it is asked for", live=True, default=False)
    valve_stuck: bool = quantity("", "the spool stays where it is", live=True, default=False)
    valve_stuck_at: bool = quantity("", "the spool goes to `valve_opening` and stays", live=True, default=False)
    valve_opening: float = quantity("-", "of `valve_stuck_at`", low=-1.0, high=1.0, live=True, default=0.0)
    position_off: bool = quantity("", "cable off: no reading of the position", live=True, default=False)
    acceleration_off: bool = quantity("", "cable off: no reading of the acceleration", live=True, default=False)
    pressure_off: bool = quantity("", "cable off: no reading of the supply pressure", live=True, default=False)
    position_frozen: bool = quantity("", "the reading stays as it is", live=True, default=False)
    acceleration_frozen: bool = quantity("", "the reading stays as it is", live=True, default=False)
    position_bias: float = quantity("m", "added to the reading", live=True, default=0.0)
    acceleration_bias: float = quantity("m/s^2", "added to the reading", live=True, default=0.0)
    position_noise: float = quantity("m", "standard deviation added to the reading", low=0.0, live=True, default=0.0)
    acceleration_noise: float = quantity(
        "m/s^2", "standard deviation added to the reading", low=0.0, live=True, default=0.0
    )

    def on(self) -> dict[str, float]:
        """The faults that are on, with their values.

        >>> MachineFaultParameters(valve_stuck_at=True, valve_opening=0.3, position_bias=0.01).on()
        {'valve_stuck_at': 0.3, 'position_bias': 0.01}
        """
        found: dict[str, float] = {}
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if value and field.name in MACHINE_FAULTS:
                found[field.name] = self.valve_opening if field.name == "valve_stuck_at" else float(value)
        return found


class MachineFaults:
    """What faults make of the valve's command and of the readings.

    Parameters
    ----------
    seed : of the noise bursts.
    """

    def __init__(self, seed: int) -> None:
        self._noise = np.random.default_rng(seed)
        self._held: dict[str, float] = {}

    def valve(self, on: Mapping[str, float], wanted: float, acting: float) -> float:
        """The command that the spool follows, where `wanted` is asked for and `acting` was the last one [-]."""
        if "valve_stuck_at" in on:
            return on["valve_stuck_at"]
        return self._hold("valve_stuck", on, acting, wanted)

    def _hold(self, name: str, on: Mapping[str, float], first: float, free: float) -> float:
        """The value of the moment at which a fault came on, as long as it is on."""
        if name in on:
            return self._held.setdefault(name, first)
        self._held.pop(name, None)
        return free

    def readings(self, on: Mapping[str, float], measured: Measurement) -> Measurement:
        """What is left of the readings; NaN where there is none."""
        if not on and not self._held:
            return measured
        changed: dict[str, float] = {}
        for name, field in FROZEN.items():
            value = getattr(measured, field)
            changed[field] = self._hold(name, on, value, value)
        for name, field in BIASED.items():
            changed[field] += on.get(name, 0.0)
        for name, field in NOISY.items():
            if name in on:
                changed[field] += on[name] * float(self._noise.standard_normal())
        changed |= {field: math.nan for name, field in MISSING.items() if name in on}
        return measured._replace(**changed)
