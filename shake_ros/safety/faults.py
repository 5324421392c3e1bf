"""Faults: of the machine (supply, valve, sensors), and of what goes between two nodes.

A fault of the machine is on or off; those with a unit have a value besides. Which are on is a mapping of name to value.
Plant and target emulator have the same.

Everything goes by stamps; nothing here reads a clock, and the same samples with the same seed give the same result.
"""

from __future__ import annotations

import dataclasses
import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from shake_ros.physics.plant.table import Measurement
from shake_ros.quantities import Parameters, quantity

MISSING = {"position_off": "position", "acceleration_off": "acceleration", "pressure_off": "pressure_supply"}
FROZEN = {"position_frozen": "position", "acceleration_frozen": "acceleration"}
BIASED = {"position_bias": "position", "acceleration_bias": "acceleration"}
NOISY = {"position_noise": "position", "acceleration_noise": "acceleration"}


@dataclass(frozen=True)
class MachineFaultParameters(Parameters):
    """The switches of a node: all off, until one is set."""

    supply_failure: bool = quantity("", "the power unit stops", live=True, default=False)
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
        found = {name: float(value) for name in MACHINE_FAULTS if (value := getattr(self, name))}
        return found | ({"valve_stuck_at": self.valve_opening} if self.valve_stuck_at else {})


# fault → unit of its value, "" where it has none
MACHINE_FAULTS: dict[str, str] = {
    field.name: "-" if field.name == "valve_stuck_at" else field.metadata["unit"]
    for field in dataclasses.fields(MachineFaultParameters)
    if field.name != "valve_opening"
}


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


SECOND = 1_000_000_000
Sample = tuple[int, tuple[float, ...]]  # stamp [ns], numbers


@dataclass(frozen=True)
class MessageFaultParameters(Parameters):
    """Faults of one topic: none, until one is set. Bias, noise, jump and NaN hit the first number, in its own unit."""

    delay: float = quantity("s", "delay of a sample", low=0.0, high=10.0, live=True, default=0.0)
    drop: float = quantity("-", "share of the samples that are lost", low=0.0, high=1.0, live=True, default=0.0)
    duplicate: float = quantity("-", "share that comes twice", low=0.0, high=1.0, live=True, default=0.0)
    reorder: float = quantity("-", "share that is swapped with the next", low=0.0, high=1.0, live=True, default=0.0)
    freeze: bool = quantity("", "the numbers stay as they are, under new stamps", live=True, default=False)
    jump: float = quantity("SI", "one sample is off by this, once when it is set", live=True, default=0.0)
    bias: float = quantity("SI", "every sample is off by this", live=True, default=0.0)
    noise: float = quantity("SI", "standard deviation of noise", low=0.0, live=True, default=0.0)
    nan: float = quantity("-", "share of the samples that are not a number", low=0.0, high=1.0, live=True, default=0.0)

    def on(self) -> dict[str, float]:
        """The faults that are on, with their values.

        >>> MessageFaultParameters(delay=0.01, freeze=True).on()
        {'delay': 0.01, 'freeze': 1.0}
        """
        return {name: float(value) for name, value in vars(self).items() if value}


class MessageFaults:
    """The samples of one topic in, what is left of them out.

    Parameters
    ----------
    seed : of what is left to chance.

    >>> faults = MessageFaults(1)
    >>> faults.apply(MessageFaultParameters(delay=0.002))
    >>> [faults.carry(k * 1_000_000, (float(k),)) for k in range(4)]
    [[], [], [(0, (0.0,))], [(1000000, (1.0,))]]
    """

    def __init__(self, seed: int) -> None:
        self.parameters = MessageFaultParameters()
        self._random = np.random.default_rng(seed)
        self._frozen: tuple[float, ...] | None = None
        self._jump = 0.0
        self._swapped: Sample | None = None
        self._line: deque[Sample] = deque()

    def apply(self, parameters: MessageFaultParameters) -> None:
        """Take other faults, between two samples; a jump happens where it is set anew."""
        if parameters.jump != self.parameters.jump:
            self._jump = parameters.jump
        self.parameters = parameters

    def carry(self, stamp: int, values: tuple[float, ...]) -> list[Sample]:
        """What leaves when the sample of a stamp [ns] comes, in the order in which it leaves."""
        leaving = [(stamp, self._numbers(values))]
        leaving = self._swap(self._double(self._lose(leaving)))
        self._line.extend(leaving)
        due = stamp - round(self.parameters.delay * SECOND)
        found = []
        while self._line and self._line[0][0] <= due:
            found.append(self._line.popleft())
        return found

    def _happens(self, share: float) -> bool:
        """Whether chance hits this sample."""
        return share > 0.0 and float(self._random.random()) < share

    def _numbers(self, values: tuple[float, ...]) -> tuple[float, ...]:
        p = self.parameters
        if p.freeze:
            if self._frozen is None:
                self._frozen = values
            values = self._frozen
        else:
            self._frozen = None
        first = values[0] + p.bias + self._jump
        self._jump = 0.0
        if p.noise > 0.0:
            first += p.noise * float(self._random.standard_normal())
        return (math.nan if self._happens(p.nan) else first, *values[1:])

    def _lose(self, leaving: list[Sample]) -> list[Sample]:
        return [] if self._happens(self.parameters.drop) else leaving

    def _double(self, leaving: list[Sample]) -> list[Sample]:
        return 2 * leaving if self._happens(self.parameters.duplicate) else leaving

    def _swap(self, leaving: list[Sample]) -> list[Sample]:
        """A sample that was kept back leaves behind this one; or this one is kept back."""
        if self._swapped is not None:
            kept, self._swapped = self._swapped, None
            return [*leaving, kept]
        if leaving and self._happens(self.parameters.reorder):
            self._swapped = leaving[0]
            return leaving[1:]
        return leaving
