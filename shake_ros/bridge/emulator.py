"""A target computer in software: the compiled table in real time behind the datagrams, with an interlock of its own.

It trusts nobody. Its watchdog is the interlock's: without a valid command the valve ramps to null (`stale_command`),
then the pressure goes off (`command_lost`). The host asks for stages; whether they are reached is decided here.
"""

from __future__ import annotations

import math
import time
from array import array
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from shake_ros.bridge import wire
from shake_ros.bridge.faults import Switches
from shake_ros.bridge.target import TargetLink
from shake_ros.core.plant.parameters import TableParameters
from shake_ros.core.plant.states import SPOOL
from shake_ros.core.plant.table import Measurement, Table
from shake_ros.core.quantities import Parameters, choice, quantity
from shake_ros.core.safety.causes import NUMBERS, InterlockParameters
from shake_ros.core.safety.interlock import HIGH, LOW, OFF, RUN, Interlock
from shake_ros.core.safety.power_unit import PowerUnit, PowerUnitParameters
from shake_ros.core.safety.rates import Spread

SECOND = 1_000_000_000
REACHED = 0.9  # of its pressure confirms a stage
REMEMBERED = 4096  # measurements whose sending time is kept for the round trip
MOST_STEPS = 1000  # made up for at once after a pause; a longer one is left out


@dataclass(frozen=True)
class EmulatorParameters(Parameters):
    """What the emulator emulates, and where it listens."""

    table: str = choice("configuration in config/table, or a YAML file")
    seed: int = quantity("-", "seed of the sensor noise", low=0, high=2**31 - 1)
    start_position: float = quantity("m", "position of the table at the start", low=-10.0, high=10.0)
    interlock: str = choice("configuration in config/interlock, or a YAML file")
    rate: float = quantity("Hz", "sampling rate", low=1.0, high=10000.0)
    clock_drift: float = quantity(
        "-", "how much faster the target's clock goes than this machine's", low=-0.01, high=0.01
    )
    address: str = choice("to listen on")
    port: int = quantity("-", "UDP port to listen on; 0: a free one", low=0, high=65535)
    key_file: str = choice("shared key in hexadecimal digits; empty: none, loopback addresses only")


class Emulator:
    """Table, power unit, interlock and link, sample by sample.

    Parameters
    ----------
    own, table, unit, interlock : what is emulated. link : to the host. switches : faults.
    """

    def __init__(
        self,
        own: EmulatorParameters,
        table: TableParameters,
        unit: PowerUnitParameters,
        interlock: InterlockParameters,
        link: TargetLink,
        switches: Switches,
    ) -> None:
        self.link = link
        self.switches = switches
        self.interlock = Interlock(interlock, enabled=False)
        self.period = round(SECOND / own.rate)
        self.overruns = 0
        self.samples = 0
        self.running = 0
        self.late_answers = 0
        self.round_trips = Spread()
        self._table = Table(table, self.period / SECOND, own.seed)
        self._state = self._table.initial_state(own.start_position)
        self._table.measure(self._table.advance(self._state, 0.0), 0)  # compiles before the first sample
        self._unit = PowerUnit(unit, table.supply.supply_pressure, table.supply.tank_pressure, OFF)
        self._drift = own.clock_drift
        self._sent = array("q", bytes(8 * REMEMBERED))
        self._sampled = array("q", bytes(8 * REMEMBERED))
        self._answered = 0
        self._reset = False
        self._acting = 0.0
        self._held: dict[str, float] = {}
        self._noise = np.random.default_rng(own.seed)
        self._began = -1

    def target_time(self, now: int) -> int:
        """The target's clock at a monotonic time [ns]."""
        return now + round(self._drift * now)

    def step(self, now: int, steps: int) -> None:
        """One sample at target time `now` [ns], `steps` periods after the last one; then send it."""
        on = self.switches.on((now - self._began) / SECOND if self._began >= 0 else -1.0)
        if "deaf" not in on:
            self._hear(now)
        lock = self.interlock
        self._unit.failed = "supply_failure" in on
        u = lock.act(now, self._confirmed())
        if "valve_stuck_at" in on:
            u = on["valve_stuck_at"]
        elif "valve_stuck" in on:
            u = self._held.setdefault("valve", self._acting)
        else:
            self._held.pop("valve", None)
        for _ in range(min(steps, MOST_STEPS)):
            self._table.set_supply_pressure(self._unit.advance(lock.stage, self._table.sample_time))
            self._state = self._table.advance(self._state, u)
        self._acting = u
        self.samples += steps
        self.running += lock.stage == RUN
        read = self._faulty(self._table.measure(self._state, self.samples), on)
        lock.observe(now, read.position, read.acceleration, read.pressure_supply)
        if self._began < 0 and self.link.session is not None:
            self._began = now
        if "silent" not in on:
            self._tell(now, read, u)

    def _confirmed(self) -> int:
        """The stage whose pressure is there."""
        if self._unit.pressure >= REACHED * self._unit.high_pressure:
            return HIGH
        return LOW if self._unit.pressure >= REACHED * self._unit.parameters.low_pressure else OFF

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

    def _faulty(self, measured: Measurement, on: dict[str, float]) -> Measurement:
        """What the faults leave of the readings."""
        if not on:
            self._held.pop("position", None)
            self._held.pop("acceleration", None)
            return measured
        position = measured.position + on.get("position_bias", 0.0)
        acceleration = measured.acceleration + on.get("acceleration_bias", 0.0)
        position += on.get("position_noise", 0.0) * float(self._noise.standard_normal())
        if "position_frozen" in on:
            position = self._held.setdefault("position", position)
        if "acceleration_frozen" in on:
            acceleration = self._held.setdefault("acceleration", acceleration)
        if "position_off" in on:
            position = math.nan
        if "acceleration_off" in on:
            acceleration = math.nan
        return measured._replace(position=position, acceleration=acceleration)

    def _tell(self, now: int, read: Measurement, u: float) -> None:
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
            float(self._state[SPOOL]),
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
            "samples": self.samples,
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
