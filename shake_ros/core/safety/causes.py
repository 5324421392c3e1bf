"""Causes of an interlock: what is watched, in which unit, from which threshold, with which action and latch.

Two classes of action as laboratories know them. Program interlock: the motion ramps to a hold, with the pressure on
(`program_hold`) or with an orderly stop of the hydraulics behind it (`program_stop`). Hydraulic interlock
(`hydraulic_interlock`): valve to null and pressure off, at once.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from shake_ros.core.quantities import Parameters, ShakeError, choice, quantity, strict_keys

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


CAUSES: dict[str, Cause] = {
    # what people and other computers say
    "stop": Cause("-", "the service `stop`", 1.0),
    "stale_command": Cause("s", "age of the newest command", 10.0),
    "command_lost": Cause("s", "age of the newest command", 100.0),
    "command_not_finite": Cause("-", "commands that are not finite numbers", 1e9),
    "command_range": Cause("-", "size of a command", 1e9),
    "command_jump": Cause("-", "step from one command to the next", 2.0),
    "two_commanders": Cause("-", "commands that a second publisher could have sent", 1e9),
    "tracking_error": Cause("m", "distance of the position from the reference", 10.0),
    "stale_reference": Cause("s", "age of the newest reference, once one has come", 10.0),
    "deadline_overruns": Cause("1/s", "periods missed within a second", 1e4),
    "clock_jump": Cause("s", "step of the clock against the monotonic one", 1e6),
    "link_loss": Cause("-", "share of samples or commands lost within a second", 1.0),
    "target_trip": Cause("-", "interlock of the target computer", 1.0),
    # what the sensors say, in the order of sensors.watch
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
    # last, since the numbers on the wire are in this order
    "operator_gone": Cause("s", "age of the newest sign of the operator's page, at the stage run", 600.0),
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
SENSED: tuple[str, ...] = (
    "position_soft",
    "position_hard",
    "velocity",
    "acceleration",
    "sensor_frozen",
    "sensor_jump",
    "sensor_implausible",
    "valve_implausible",
    "supply_pressure_low",
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
        "s", "at full span, until the table must have come to the reference", low=0.0, high=600.0, live=True
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
