"""Faults that the target emulator can have: on the command line with a time, or switched while it runs.

NAME@START+DURATION=VALUE: from START [s] after the start of the first session for DURATION [s] (to the end where left
out); VALUE in SI units where the fault has one.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass

from shake_ros.core.quantities import ShakeError, unknown_name
from shake_ros.core.safety.faults import MACHINE_FAULTS

# fault → unit of its value, "" where it has none
FAULTS: dict[str, str] = {
    **MACHINE_FAULTS,
    "silent": "",  # sends nothing
    "deaf": "",  # hears nothing
}
FORM = re.compile(r"^(\w+)(?:@([\d.]+))?(?:\+([\d.]+))?(?:=(-?[\d.eE+-]+))?$")


@dataclass(frozen=True)
class Fault:
    """A fault from `start` to `end` [s] with its value."""

    name: str
    start: float
    end: float
    value: float


def parse_fault(text: str) -> Fault:
    """A fault as the command line writes it.

    >>> parse_fault("position_bias@2.5+0.5=0.004")
    Fault(name='position_bias', start=2.5, end=3.0, value=0.004)

    Raises
    ------
    ShakeError : another form, an unknown name, a value that is missing or that the fault has not.
    """
    found = FORM.match(text)
    if found is None:
        raise ShakeError(f"fault '{text}' is not NAME@START+DURATION=VALUE")
    name, start, duration, value = found.groups()
    if name not in FAULTS:
        raise unknown_name("fault", name, FAULTS)
    if bool(FAULTS[name]) != (value is not None):
        raise ShakeError(f"fault '{text}': {name} takes {'a value in ' + FAULTS[name] if FAULTS[name] else 'no value'}")
    try:
        begin = float(start or 0.0)
        end = begin + float(duration) if duration else math.inf
        amount = float(value or 0.0)
    except ValueError:
        raise ShakeError(f"fault '{text}': a number cannot be read") from None
    if not math.isfinite(amount):
        raise ShakeError(f"fault '{text}': {value} is not finite")
    return Fault(name, begin, end, amount)


class Switches:
    """Which faults are on."""

    def __init__(self, schedule: Iterable[Fault]) -> None:
        self._schedule = list(schedule)
        self._switched: dict[str, float] = {}

    def switch(self, line: str) -> None:
        """`NAME=VALUE` turns a fault on, `NAME off` off; raises ShakeError for anything else."""
        name, _, rest = line.strip().partition(" ")
        if rest == "off":
            self._switched.pop(name, None)
            self._schedule = [fault for fault in self._schedule if fault.name != name]
        else:
            fault = parse_fault(line.strip())
            self._switched[fault.name] = fault.value

    def on(self, time: float) -> dict[str, float]:
        """Faults that are on at a time [s], with their values."""
        if not self._schedule:
            return self._switched
        scheduled = {fault.name: fault.value for fault in self._schedule if fault.start <= time < fault.end}
        return scheduled | self._switched
