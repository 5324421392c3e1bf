"""A target computer in software: the compiled table in real time behind the datagrams, with an interlock of its own.

It trusts nobody. Its watchdog is the interlock's: without a valid command the valve ramps to null (`stale_command`),
then the pressure goes off (`command_lost`). The host asks for stages; whether they are reached is decided here.

Its faults come on the command line with a time, or are switched while it runs.

NAME@START+DURATION=VALUE: from START [s] after the start of the first session for DURATION [s] (to the end where left
out); VALUE in SI units where the fault has one.

The command `target_emulator` runs it in a process without ROS, for the node `hardware_bridge`.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import math
import re
import signal
import struct
import sys
import threading
import time
from array import array
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

from shake_ros.bridge import wire
from shake_ros.bridge.ends import TargetLink
from shake_ros.bridge.wire import key_for, vectors, write_key
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.physics.plant.states import SPOOL
from shake_ros.physics.plant.table import Measurement
from shake_ros.quantities import Parameters, ShakeError, choice, quantity, unknown_name
from shake_ros.realtime import ANY, SECOND, Durations, LastSecond, RealtimeParameters, ask_for, hold_collector
from shake_ros.safety.causes import NUMBERS, OFF, RUN, InterlockParameters
from shake_ros.safety.faults import MACHINE_FAULTS
from shake_ros.safety.interlock import Interlock
from shake_ros.safety.machine import Machine, PowerUnitParameters
from shake_ros.settings import find, load_interlock, load_table, read_yaml

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


WHERE = "config/emulator.yaml"


def parser() -> argparse.ArgumentParser:
    """Arguments of the command."""
    about = "Command `target_emulator`: a target computer in a process without ROS, for the node `hardware_bridge`."
    made = argparse.ArgumentParser(prog="target_emulator", description=about)
    made.add_argument("--address", help="to listen on")
    made.add_argument("--port", type=int, help="UDP port, 0 for a free one")
    made.add_argument("--key", metavar="FILE", dest="key_file", help="shared key; without it loopback addresses only")
    made.add_argument("--make-key", type=Path, metavar="FILE", help="write a new key and end")
    made.add_argument("--test-vector", action="store_true", help="print worked datagrams and end")
    made.add_argument("--table", help="configuration in config/table, or a YAML file")
    made.add_argument("--interlock", help="configuration in config/interlock, or a YAML file")
    made.add_argument("--seed", type=int, help="of the sensor noise")
    made.add_argument("--duration", type=float, default=0.0, help="end after this [s]; 0 = never")
    made.add_argument("--priority", type=int, default=0, help="SCHED_FIFO priority, 0 = usual scheduling")
    made.add_argument("--cpu", type=int, default=ANY, help="the only processor to run on, -1 = any")
    made.add_argument(
        "--journal", type=Path, metavar="FILE", help="write the true motion of the table, 44 bytes for each sample"
    )
    made.add_argument("--report", type=Path, metavar="FILE", help="write what happened as JSON at the end")
    made.add_argument(
        "--fault",
        action="append",
        default=[],
        metavar="NAME@START+DURATION=VALUE",
        help=f"one of {', '.join(FAULTS)}; standard input takes lines NAME=VALUE and 'NAME off'",
    )
    return made


def settings(given: argparse.Namespace) -> tuple[EmulatorParameters, PowerUnitParameters]:
    """The configuration with what the command line changes."""
    content: dict[str, Any] = dict(read_yaml(find("emulator", "default")))
    unit = PowerUnitParameters.from_mapping(content.pop("power_unit", {}), f"{WHERE}: power_unit")
    changes = {field.name: getattr(given, field.name, None) for field in dataclasses.fields(EmulatorParameters)}
    content |= {name: value for name, value in changes.items() if value is not None}
    return EmulatorParameters.from_mapping(content, WHERE), unit


def listen(switches: Switches) -> None:
    """Faults by lines on standard input, in a thread of its own."""
    for line in sys.stdin:
        if not line.strip():
            continue
        try:
            switches.switch(line)
        except ShakeError as error:
            print(f"target_emulator: {error}", file=sys.stderr, flush=True)


def open_journal(path: Path) -> BinaryIO:
    """A new file whose rows can be read while it grows; raises ShakeError where there is one already."""
    try:
        return path.open("xb", buffering=0)
    except OSError as error:
        raise ShakeError(f"{path}: {error.strerror}") from None


def main(arguments: Sequence[str]) -> int:
    """Run until SIGINT, SIGTERM or the end of the duration; returns the exit code."""
    given = parser().parse_args(list(arguments))
    if given.make_key:
        write_key(given.make_key)
        return 0
    if given.test_vector:
        for name, data in vectors().items():
            print(f"{name}: {data.hex()}")
        return 0
    own, unit = settings(given)
    realtime = RealtimeParameters(True, given.priority, given.cpu, given.priority > 0, True, given.priority > 0)
    switches = Switches([parse_fault(text) for text in given.fault])
    link = TargetLink(own.address, own.port, key_for(own.key_file, own.address))
    journal = open_journal(given.journal) if given.journal else None
    try:
        emulator = Emulator(own, load_table(own.table), unit, load_interlock(own.interlock), link, switches, journal)
        ending = threading.Event()
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, lambda *_: ending.set())
        threading.Thread(target=listen, args=(switches,), daemon=True).start()
        hold_collector()
        refused = ask_for(realtime)
        if refused:
            print(f"target_emulator: {refused}; see docs/howto/realtime.md", file=sys.stderr, flush=True)
        print(f"ready {link.address[0]}:{link.address[1]}", flush=True)
        samples = round(given.duration * own.rate)
        emulator.run(lambda: not ending.is_set() and not 0 < samples <= emulator.machine.samples)
    finally:
        link.close()
        if journal is not None:
            journal.close()
    summary = json.dumps(emulator.summary())
    if given.report:
        given.report.write_text(summary + "\n", encoding="utf-8")
    print(summary, flush=True)
    return 0
