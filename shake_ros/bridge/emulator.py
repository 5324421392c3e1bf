"""A target computer in software: the compiled table in real time behind the datagrams, with an interlock of its own.

It trusts nobody. Its watchdog is the interlock's: without a valid command the valve ramps to null (`stale_command`),
then the pressure goes off (`command_lost`). The host asks for stages; whether they are reached is decided here.

Its faults come on the command line with a time, or are switched while it runs.

NAME@START+DURATION=VALUE: from START [s] after the start of the first session for DURATION [s] (to the end where left
out); VALUE in SI units where the fault has one.
"""

from __future__ import annotations

import math
import re
import struct
import time
from array import array
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import BinaryIO

from shake_ros.bridge import wire
from shake_ros.bridge.ends import TargetLink
from shake_ros.core.plant.parameters import TableParameters
from shake_ros.core.plant.states import SPOOL
from shake_ros.core.plant.table import Measurement
from shake_ros.core.quantities import Parameters, ShakeError, choice, quantity, unknown_name
from shake_ros.core.safety.causes import NUMBERS, InterlockParameters
from shake_ros.core.safety.faults import MACHINE_FAULTS
from shake_ros.core.safety.interlock import Interlock
from shake_ros.core.safety.machine import Machine, PowerUnitParameters
from shake_ros.core.safety.rates import Durations, LastSecond
from shake_ros.core.safety.stages import OFF, RUN

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


SECOND = 1_000_000_000
REMEMBERED = 4096  # measurements whose sending time is kept for the round trip
MOST_STEPS = 1000  # made up for at once after a pause; a longer one is left out
# A row of the journal: wall clock [ns]; true position, velocity, acceleration; command at the valve; stage; number of
# the cause in force; how many faults are on.
JOURNAL = struct.Struct("<qddddBBBx")


@dataclass(frozen=True)
class EmulatorParameters(Parameters):
    """What the emulator emulates, and where it listens."""

    table: str = choice("configuration in config/table, or a YAML file")
    seed: int = quantity("-", "seed of the sensor noise", low=0, high=2**31 - 1)
    start_position: float = quantity("m", "position of the table at the start", low=-10.0, high=10.0)
    interlock: str = choice("configuration in config/interlock, or a YAML file")
    rate: float = quantity("Hz", "sampling rate", low=1.0, high=10000.0)
    clock_drift: float = quantity(
        "-", "how much faster the target's clock runs than this machine's", low=-0.01, high=0.01
    )
    output_watchdog: float = quantity(
        "s", "the output card takes the valve to null if the target stops for so long", low=0.0, high=1.0
    )
    address: str = choice("to listen on")
    port: int = quantity("-", "UDP port to listen on; 0: a free one", low=0, high=65535)
    key_file: str = choice("shared key in hexadecimal digits; empty: none, loopback addresses only")


class Emulator:
    """Table, power unit, interlock and link, sample by sample.

    Parameters
    ----------
    own, table, unit, interlock : what is emulated.
    link : to the host.
    switches : faults.
    journal : takes a row of JOURNAL each sample, None for none.
    """

    def __init__(
        self,
        own: EmulatorParameters,
        table: TableParameters,
        unit: PowerUnitParameters,
        interlock: InterlockParameters,
        link: TargetLink,
        switches: Switches,
        journal: BinaryIO | None = None,
    ) -> None:
        self.link = link
        self.switches = switches
        self.interlock = Interlock(interlock, enabled=False)
        self.period = round(SECOND / own.rate)
        self.overruns = 0
        self.running = 0
        self.late_answers = 0
        self.round_trips = Durations()
        self.machine = Machine(table, unit, self.period / SECOND, own.seed, own.start_position, OFF)
        self._drift = own.clock_drift
        self._output_watchdog = round(own.output_watchdog * SECOND / self.period)
        self._missed = LastSecond()
        self._journal = journal
        self._sent = array("q", bytes(8 * REMEMBERED))
        self._sampled = array("q", bytes(8 * REMEMBERED))
        self._answered = 0
        self._reset = False
        self._began = -1

    def target_time(self, now: int) -> int:
        """The target's clock at a monotonic time [ns]."""
        return now + round(self._drift * now)

    def step(self, now: int, steps: int) -> None:
        """One sample at target time `now` [ns], `steps` periods after the last one; then send it."""
        on = self.switches.on((now - self._began) / SECOND if self._began >= 0 else -1.0)
        lock, machine = self.interlock, self.machine
        machine.on = on
        self._stand_still(min(steps, MOST_STEPS) - 1)
        if "deaf" not in on:
            self._hear(now)
        if steps > 1:
            self._missed.add(now, steps - 1)
        lock.compare(now, "deadline_overruns", float(self._missed.total(now)))
        u = lock.act(now, machine.confirmed())
        machine.advance(lock.stage, u)
        self.running += lock.stage == RUN
        read = machine.measure()
        lock.observe(now, read.position, read.acceleration, read.pressure_supply)
        if self._began < 0 and self.link.session is not None:
            self._began = now
        if "silent" not in on:
            self._report(now, read, machine.acting)
        if self._journal is not None:
            self._write(read)

    def _stand_still(self, steps: int) -> None:
        """What the table did while the loop stood still: the last output stays, until the output card nulls it."""
        machine, last = self.machine, self.machine.acting
        for k in range(steps):
            machine.advance(self.interlock.stage, last if k < self._output_watchdog else 0.0)

    def _write(self, read: Measurement) -> None:
        assert self._journal is not None
        lock, machine = self.interlock, self.machine
        leading = lock.leading
        truth = read.truth_position, read.truth_velocity, read.truth_acceleration
        number = NUMBERS[leading.cause] if leading else 0
        self._journal.write(JOURNAL.pack(time.time_ns(), *truth, machine.acting, lock.stage, number, len(machine.on)))

    def _hear(self, now: int) -> None:
        """Take the commands that have come."""
        for command, arrival in self.link.commands():
            place = command.answers % REMEMBERED
            if 0 < command.answers <= (self.link.session.sent if self.link.session else 0):
                if self.interlock.stage == RUN:
                    self.round_trips.add(arrival - self._sent[place])
                    self.late_answers += arrival - self._sent[place] > self.period
                stamp = self._sampled[place]
                if math.isfinite(command.u):
                    self.interlock.command(stamp, command.u)
                else:
                    self.interlock.report(now, "command_not_finite", 1.0)
            self._answered = command.sequence
            reset = bool(command.flags & wire.RESET)
            if reset and not self._reset:
                self.interlock.reset()
            self._reset = reset
            self.interlock.enable(command.mode > OFF, command.mode)
            if command.flags & wire.AT_ONCE:
                self.interlock.cut()

    def _report(self, now: int, read: Measurement, u: float) -> None:
        lock = self.interlock
        status = lock.stage
        status |= wire.HOLDING if lock.hold_severity else 0
        status |= wire.TRIPPED if lock.tripped else 0
        leading = lock.leading
        trip = NUMBERS[leading.cause] if leading else 0
        sequence = self.link.send(
            now,
            read.position,
            read.acceleration,
            read.pressure_a,
            read.pressure_b,
            read.pressure_supply,
            float(self.machine.state[SPOOL]),
            self._answered,
            u,
            status,
            trip,
        )
        if sequence:
            self._sent[sequence % REMEMBERED] = time.time_ns()
            self._sampled[sequence % REMEMBERED] = now

    def run(self, going_on: Callable[[], bool]) -> None:
        """Real time with absolute deadlines; periods that passed while the machine was busy are made up for."""
        first = time.monotonic_ns() + self.period
        count, last = 0, -1
        while going_on():
            deadline = first + count * self.period
            left = deadline - time.monotonic_ns()
            if left > 0:
                time.sleep(left / SECOND)
            skipped = max(0, (time.monotonic_ns() - deadline) // self.period)
            self.overruns += skipped
            count += skipped
            self.step(self.target_time(first + count * self.period), count - last)
            last = count
            count += 1

    def summary(self) -> dict[str, object]:
        """What happened, as plain values."""
        return {
            "samples": self.machine.samples,
            "overruns": self.overruns,
            "commands": self.link.received,
            "samples_at_run": self.running,
            "answers_at_run": self.round_trips.count,
            "late_answers": self.late_answers,
            "sessions": self.link.sessions,
            "rejected": {reason: count for reason, count in self.link.rejected.items() if count},
            "round_trip_us": self.round_trips.percentiles(),
            "trips": [
                {
                    "cause": trip.cause,
                    "time_ns": trip.time,
                    "value": trip.value,
                    "limit": trip.limit,
                    "action": trip.action,
                }
                for trip in self.interlock.trips
            ],
        }
