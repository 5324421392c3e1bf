"""The stages of the hydraulics, and the causes that take them down: what is watched, its threshold and its action.

The stages go up one by one, each confirmed and for its time; down from a hold, through low pressure. Times are in [ns];
nothing here reads a clock.

A cause has a unit, a threshold, an action and a latch. Two classes of action as laboratories know them. Program
interlock: the motion ramps to a hold, with the pressure on (`program_hold`) or with an orderly stop of the hydraulics
behind it (`program_stop`). Hydraulic interlock (`hydraulic_interlock`): valve to null and pressure off, at once.

What the sensors say about themselves and about the table: one compiled look at each sample.

The speed is the low-passed difference of the position. Position and acceleration are compared by an estimator that
integrates the acceleration and is drawn to the position with a bandwidth ω:

    x̂' = v̂ + 2 ω (x − x̂),   v̂' = a + ω² (x − x̂)

Its distance |x − x̂| stays small where the two belong together: an offset b of the accelerometer leaves b/ω².

The speed is also compared with that of the valve's opening, full speed times command, both low-passed alike; their
difference is low-passed once more, so that the valve's lag and the oil's spring leave little of it.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shake_ros.compiled import njit
from shake_ros.quantities import Parameters, ShakeError, choice, quantity, strict_keys

OFF, LOW, HIGH, RUN = range(4)
STAGES = ("off", "low pressure", "high pressure", "run")


class Stages:
    """The stage that the hydraulics are asked for.

    Attributes
    ----------
    stage : OFF … RUN.
    times : for which OFF, LOW and HIGH last at least [ns].
    """

    def __init__(self) -> None:
        self.stage = OFF
        self.times = (0.0, 0.0, 0.0)
        self._since = -1

    def advance(self, now: int, wanted: int, confirmed: int, *, moving: bool) -> None:
        """Towards `wanted`, as far as the hydraulics have confirmed; RUN is not left while the command acts.

        >>> stages = Stages()
        >>> stages.times = 0.0, 2e9, 1e9
        >>> for now in range(0, 4_000_000_000, 1_000_000_000):
        ...     stages.advance(now, RUN, confirmed=RUN, moving=False)
        ...     print(STAGES[stages.stage])
        low pressure
        low pressure
        high pressure
        run
        """
        while self.stage < wanted and confirmed >= self.stage:
            if self._since < 0 or self.stage == OFF:
                self._since = now
            if now - self._since < self.times[self.stage]:
                return
            self.stage += 1
            self._since = now
        while self.stage > wanted:
            if self.stage == RUN and moving:
                return
            if self.stage == LOW and now - self._since < self.times[LOW]:
                return
            self.stage -= 1
            self._since = now


NONE, INDICATE, PROGRAM_HOLD, PROGRAM_STOP, HYDRAULIC = ACTIONS = (
    "none",
    "indicate",
    "program_hold",
    "program_stop",
    "hydraulic_interlock",
)
SEVERITY = {action: rank for rank, action in enumerate(ACTIONS)}


@dataclass(frozen=True)
class Cause:
    """One thing that is watched.

    Parameters
    ----------
    unit, meaning : of its threshold; the value is compared in this unit.
    high : largest threshold that makes sense.
    below : the cause stands where the value is below the threshold (else above).
    """

    unit: str
    meaning: str
    high: float
    below: bool = False


SENSED_CAUSES: dict[str, Cause] = {  # what the sensors say, in the order of `watch`
    "position_soft": Cause("m", "distance from the middle", 10.0),
    "position_hard": Cause("m", "distance from the middle", 10.0),
    "velocity": Cause("m/s", "speed of the table", 100.0),
    "acceleration": Cause("m/s^2", "measured acceleration", 1e4),
    "sensor_frozen": Cause("s", "time for which a reading has not changed while the valve is open", 10.0),
    "sensor_jump": Cause("m", "step of the position from one sample to the next", 10.0),
    "sensor_implausible": Cause("m", "position against the integral of the acceleration", 10.0),
    "valve_implausible": Cause("m/s", "speed against that of the valve's opening", 100.0),
    "supply_pressure_low": Cause("Pa", "supply pressure at the stage `run`", 1e8, below=True),
    "sensor_missing": Cause("s", "time without a finite reading of position and acceleration", 10.0),
}
SENSED: tuple[str, ...] = tuple(SENSED_CAUSES)
CAUSES: dict[str, Cause] = {
    # what people and other computers say
    "stop": Cause("-", "the service `stop`", 1.0),
    "stale_command": Cause("s", "age of the newest command", 10.0),
    "command_lost": Cause("s", "age of the newest command", 100.0),
    "command_not_finite": Cause("-", "commands that are not finite numbers", 1e9),
    "command_range": Cause("-", "size of a command", 1e9),
    "command_jump": Cause("-", "step from one command to the next", 2.0),
    "two_commanders": Cause("-", "commands that a second publisher may have sent", 1e9),
    "tracking_error": Cause("m", "distance of the position from the reference", 10.0),
    "stale_reference": Cause("s", "age of the newest reference, once one has come", 10.0),
    "deadline_overruns": Cause("1/s", "periods missed within a second", 1e4),
    "clock_jump": Cause("s", "step of the clock against the monotonic one", 1e6),
    "link_loss": Cause("-", "share of samples or commands lost within a second", 1.0),
    "target_trip": Cause("-", "interlock of the target computer", 1.0),
    **SENSED_CAUSES,
    # last, since the numbers on the wire are in this order
    "operator_gone": Cause("s", "time since the operator's page last reported, at the stage run", 600.0),
}
# causes that are younger than 1.0: an interlock that was written before does without
LATER: dict[str, dict[str, Any]] = {"operator_gone": {"threshold": 1.0, "action": NONE, "latch": True}}
NUMBERS: dict[str, int] = {name: number for number, name in enumerate(CAUSES, 1)}  # on the wire; 0 is none
TIMED: tuple[str, ...] = (  # what a machine that is busy for a moment brings about
    "stale_command",
    "command_lost",
    "stale_reference",
    "deadline_overruns",
    "clock_jump",
    "link_loss",
    "sensor_missing",
)


@dataclass(frozen=True)
class Response(Parameters):
    """Threshold, action and latch of one cause."""

    threshold: float
    action: str
    latch: bool

    @property
    def active(self) -> bool:
        """Whether anything happens at all."""
        return self.action != NONE


def _response(name: str, cause: Cause) -> type[Response]:
    fields: list[tuple[str, Any, Any]] = [
        ("threshold", "float", quantity(cause.unit, cause.meaning, low=0.0, high=cause.high, live=True)),
        ("action", "str", choice(f"what follows: {cause.meaning}", ACTIONS, live=True)),
        ("latch", "bool", quantity("", "stands until `reset`", live=True)),
    ]
    return dataclasses.make_dataclass(f"Response_{name}", fields, bases=(Response,), frozen=True)


RESPONSES: dict[str, type[Response]] = {name: _response(name, cause) for name, cause in CAUSES.items()}
Causes: type[Parameters] = dataclasses.make_dataclass(
    "Causes",
    [
        (name, RESPONSES[name].__name__, dataclasses.field(metadata={"meaning": CAUSES[name].meaning}))
        for name in CAUSES
    ],
    bases=(Parameters,),
    frozen=True,
)


@dataclass(frozen=True)
class InterlockParameters(Parameters):
    """Stages, span, estimates and causes of one interlock."""

    low_pressure_time: float = quantity("s", "at low pressure before high pressure follows", low=0.0, high=600.0)
    high_pressure_time: float = quantity("s", "at high pressure before commands act", low=0.0, high=600.0)
    span: float = quantity("-", "master gain of the command", low=0.0, high=1.0, live=True)
    span_time: float = quantity("s", "from no to full span", low=0.0, high=600.0, live=True)
    return_time: float = quantity(
        "s", "at full span, until the table must have reached the reference", low=0.0, high=600.0, live=True
    )
    ramp_time: float = quantity("s", "from the full command to zero in a hold", low=0.0, high=10.0, live=True)
    enable_after_reset: bool = quantity("", "an enabled table starts by itself after `reset`")
    velocity_time: float = quantity("s", "time constant of the speed watched", low=0.0, high=1.0)
    plausibility_bandwidth: float = quantity("rad/s", "of position against acceleration", low=0.1, high=1e3)
    full_speed: float = quantity("m/s", "of the table with the valve fully open", low=0.0, high=100.0)
    valve_time: float = quantity("s", "time constant of the speed against the valve's", low=0.0, high=1.0)
    moving_command: float = quantity("-", "a valve opened further moves the table", low=0.0, high=1.0, live=True)
    causes: Any = dataclasses.field(default=None)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not isinstance(self.causes, Causes):
            raise ShakeError(f"causes: expected a mapping of {', '.join(CAUSES)}")
        if SEVERITY[self.response("stop").action] < SEVERITY[PROGRAM_HOLD]:
            raise ShakeError(
                f"causes.stop.action = '{self.response('stop').action}': `stop` must at least hold the program"
            )
        soft, hard = self.response("position_soft"), self.response("position_hard")
        if soft.active and hard.active and soft.threshold > hard.threshold:
            raise ShakeError(
                f"causes.position_soft.threshold = {soft.threshold:g} m is beyond "
                f"causes.position_hard.threshold = {hard.threshold:g} m"
            )

    def response(self, name: str) -> Response:
        """Threshold, action and latch of a cause."""
        found: Response = getattr(self.causes, name)
        return found

    @property
    def limits(self) -> dict[str, float]:
        """The thresholds of the causes that act."""
        responses = {name: self.response(name) for name in CAUSES}
        return {name: response.threshold for name, response in responses.items() if response.active}

    @classmethod
    def from_mapping(cls, mapping: Mapping[str, Any], where: str) -> InterlockParameters:
        """Build from a YAML mapping; `causes` maps every cause to its threshold, action and latch."""
        if not isinstance(mapping, Mapping) or not isinstance(mapping.get("causes"), Mapping):
            raise ShakeError(f"{where}: expected names, and under 'causes' a mapping of {', '.join(CAUSES)}")
        given = strict_keys({**LATER, **mapping["causes"]}, CAUSES, where, CAUSES, kind="cause")
        causes = {name: RESPONSES[name].from_mapping(given[name], f"{where}: causes.{name}") for name in CAUSES}
        names = [f.name for f in dataclasses.fields(cls)]
        strict_keys(mapping, names, where, names)
        try:
            return cls(**{**mapping, "causes": Causes(**causes)})
        except ShakeError as error:
            raise type(error)(f"{where}: {error}") from None


POSITION_SOFT, POSITION_HARD, SPEED, ACCELERATION, FROZEN, JUMP, IMPLAUSIBLE, VALVE, SUPPLY, MISSING = range(
    len(SENSED)
)
STARTED, LAST_POSITION, LAST_ACCELERATION, VELOCITY, MODEL_POSITION, MODEL_VELOCITY, STILL_X, STILL_A, ABSENT = range(9)
EXPECTED, UNEXPLAINED = 9, 10
MEMORY = 11


def fresh_memory() -> NDArray[np.float64]:
    """Memory before the first sample."""
    return np.zeros(MEMORY)


@njit
def watch(
    limits, memory, values, position, acceleration, supply, expected, moving, dt, velocity_time, valve_time, bandwidth
):
    """Look at one sample.

    Parameters
    ----------
    limits : thresholds in the order of SENSED, shape (10,); infinite (supply: −infinite) where a cause is not active.
    memory, values : of earlier samples, shape (MEMORY,), and the value of each cause, shape (10,); changed in place.
        position [m], acceleration [m/s²], supply [Pa] : the readings.
    moving : whether the valve is open. dt [s].
    expected : speed that belongs to the valve's opening [m/s], NaN where the hydraulics are off. velocity_time,
        valve_time [s], bandwidth [rad/s] : of the three estimates.

    Returns
    -------
    How many causes stand.
    """
    if not (math.isfinite(position) and math.isfinite(acceleration)):
        memory[ABSENT] += dt
        values[MISSING] = memory[ABSENT]
        return 1 if values[MISSING] > limits[MISSING] else 0
    memory[ABSENT] = values[MISSING] = 0.0
    if memory[STARTED] == 0.0:
        memory[STARTED] = 1.0
        memory[LAST_POSITION] = memory[MODEL_POSITION] = position
        memory[LAST_ACCELERATION] = acceleration
    step = position - memory[LAST_POSITION]
    if dt > 0.0:
        memory[VELOCITY] += (step / dt - memory[VELOCITY]) * dt / (dt + velocity_time)
    if math.isfinite(expected):
        memory[EXPECTED] += (expected - memory[EXPECTED]) * dt / (dt + velocity_time)
        unexplained = memory[VELOCITY] - memory[EXPECTED]
        memory[UNEXPLAINED] += (unexplained - memory[UNEXPLAINED]) * dt / (dt + valve_time)
    else:
        memory[EXPECTED], memory[UNEXPLAINED] = memory[VELOCITY], 0.0
    memory[STILL_X] = memory[STILL_X] + dt if moving and step == 0.0 else 0.0
    same = acceleration == memory[LAST_ACCELERATION]
    memory[STILL_A] = memory[STILL_A] + dt if moving and same else 0.0
    error = position - memory[MODEL_POSITION]
    if dt * bandwidth < 0.5:
        memory[MODEL_VELOCITY] += dt * (acceleration + bandwidth * bandwidth * error)
        memory[MODEL_POSITION] += dt * (memory[MODEL_VELOCITY] + 2.0 * bandwidth * error)
    else:  # a long gap: nothing to compare with
        memory[MODEL_POSITION], memory[MODEL_VELOCITY], error = position, memory[VELOCITY], 0.0
    memory[LAST_POSITION], memory[LAST_ACCELERATION] = position, acceleration
    values[POSITION_SOFT] = values[POSITION_HARD] = abs(position)
    values[SPEED] = abs(memory[VELOCITY])
    values[ACCELERATION] = abs(acceleration)
    values[FROZEN] = max(memory[STILL_X], memory[STILL_A])
    values[JUMP] = abs(step)
    values[IMPLAUSIBLE] = abs(error)
    values[VALVE] = abs(memory[UNEXPLAINED])
    values[SUPPLY] = supply
    count = 0
    for i in range(len(values)):
        if i == SUPPLY:
            count += 1 if not supply >= limits[i] else 0
        elif values[i] > limits[i]:
            count += 1
    return count


def prepare() -> None:
    """Compile `watch` now: that takes some tenths of a second, which the first sample must not wait for."""
    count = len(SENSED)
    watch(np.zeros(count), fresh_memory(), np.zeros(count), 0.0, 0.0, 0.0, 0.0, False, 0.0, 0.0, 0.0, 0.0)
