"""Node `plant`: the simulated table with its sensors, stepped by commands (lock-step) or by the clock."""

from __future__ import annotations

import time
from dataclasses import dataclass

from shake_ros.physics.plant.cylinder import PressureWatch
from shake_ros.physics.plant.states import VELOCITY
from shake_ros.physics.plant.table import Table
from shake_ros.quantities import Parameters, ShakeError, choice, quantity
from shake_ros.ros import interface
from shake_ros.ros.diagnostics import OK, WARN
from shake_ros.ros.frame import FIRST_STAMP, Behaviour, Frame, Reader
from shake_ros.ros.interlock import NodeInterlock, SensorWriters
from shake_ros.safety.faults import MISSING, MachineFaultParameters
from shake_ros.safety.machine import Machine, PowerUnitParameters
from shake_ros.settings import load_table


@dataclass(frozen=True)
class PlantParameters(Parameters):
    """The node's own settings; those of the table come from its configuration."""

    table: str = choice("configuration in config/table, or a YAML file")
    seed: int = quantity("-", "seed of the sensor noise", low=0, high=2**31 - 1)
    duration: float = quantity("s", "stop after this, 0 for never", low=0.0, high=1e6)
    start_position: float = quantity("m", "position of the table at the start", low=-10.0, high=10.0)
    enabled: bool = quantity("", "moves from the start, without the service `enable`")
    pace: float = quantity(
        "-", "in lock-step no faster than so many times real time, 0: as fast as possible", low=0.0, high=1e3
    )


class PlantNode(Behaviour):
    """Publishes measurement k, awaits the command for it (lock-step) or the next tick (real time), advances."""

    def __init__(self, frame: Frame) -> None:
        super().__init__(frame)
        self.ticks = not frame.lockstep
        own = frame.settings(PlantParameters).value
        unit = frame.settings(PowerUnitParameters, "power_unit").value
        self.interlock = NodeInterlock(frame, own.enabled)
        self._stamp = FIRST_STAMP
        self._samples = round(own.duration / frame.sample_time)
        self._ticked, self._late_commands = False, 0
        self._started = self._due = 0.0  # on the monotonic clock; the latter the next sample at the pace [s]
        self._apart = frame.sample_time / own.pace if own.pace else 0.0  # two samples at the pace [s]
        self._heard = 0  # when a command came between two ticks, as the executor of composed nodes delivers it [ns]
        self._live = frame.parameters.declare(
            load_table(own.table), accept=lambda parameters: Table(parameters, frame.sample_time)
        )
        self._machine = Machine(
            self._live.value, unit, frame.sample_time, own.seed, own.start_position, self.interlock.core.stage
        )
        self._watch = PressureWatch(self._live.value, frame.sample_time)
        self._faults = frame.parameters.declare(MachineFaultParameters(), "faults.", self._accept_faults)
        self._machine.on = self._faults.take().on()
        self._sensors = SensorWriters(frame)
        self._sensors.declare_noise(self._live.value.sensors)
        self._truth = frame.writer(interface.TRUTH)
        self._clock = frame.writer(interface.CLOCK) if frame.lockstep else None
        self._commands = Reader(
            frame,
            interface.VALVE_COMMAND,
            self._on_command,
            self._on_refused,
            lambda stamp: self.interlock.doubled(self._stamp, stamp),
        )
        frame.diagnostics.values |= {
            "late_commands": lambda: self._late_commands,
            "sample": lambda: self._machine.samples,
            "faults": lambda: " ".join(self._machine.on),
            "pressures": lambda: "; ".join(self._watch.findings()) or "as oil can have them",
        }

    def _accept_faults(self, faults: MachineFaultParameters) -> None:
        if self.frame.lockstep and (off := set(faults.on()) & set(MISSING)):
            raise ShakeError(f"faults.{min(off)}: in lock-step the nodes would wait for ever; use real time")

    def start(self) -> None:
        """In lock-step the first measurement sets the loop going."""
        self._started = time.monotonic()
        if self.frame.lockstep:
            self._publish()

    def tick(self, stamp: int, steps: int) -> None:
        """One or, when late, several periods under the newest command; then the next measurement."""
        self.frame.diagnostics.whole_run.sampled()
        arrived = self._commands.take() or self._heard
        self._heard = 0
        newest = self._commands.input.last_stamp
        if arrived and newest >= 0:
            self.frame.diagnostics.latency(arrived - newest)
        if self._ticked:
            self._late_commands += 0 <= newest < stamp - steps * self.frame.period
            for earlier in range(steps - 1, -1, -1):  # each at its own time, so that a stale command is one
                self._advance(stamp - earlier * self.frame.period)
            self.interlock.tick(stamp, steps - 1)
        self._ticked, self._stamp = True, stamp
        self._publish()
        self._stop_when_done(self._machine.samples)

    def _publish(self) -> None:
        if self._faults.changed:
            self._switch()
        measured, stamp = self._machine.measure(), self._stamp
        self._sensors.send(stamp, measured._asdict())
        self._truth.send(stamp, measured.truth_position, measured.truth_velocity, measured.truth_acceleration)
        if self._clock is not None:
            self._clock.send(stamp)
        self.interlock.observe(stamp, measured.position, measured.acceleration, measured.pressure_supply)
        self.interlock.refresh()
        self.frame.diagnostics.cycles += 1

    def _switch(self) -> None:
        """Faults that come on or go; said at once, with the sample's stamp, so that a recording has it."""
        on = self._machine.on = self._faults.take().on()
        text = ", ".join(f"{name} {value:g}" for name, value in on.items()) or "none"
        self.frame.diagnostics.event("fault", WARN, text, {"time_ns": self._stamp, "faults": " ".join(on)})

    def _advance(self, now: int) -> None:
        machine = self._machine
        if self._live.changed:
            machine.change(self._live.take())
            self._sensors.declare_noise(self._live.value.sensors)
            self._watch = PressureWatch(self._live.value, self.frame.sample_time)
        u = self.interlock.act(now, machine.confirmed())
        machine.advance(self.interlock.core.stage, u)
        position, velocity = machine.state[: VELOCITY + 1]
        self._watch.observe(position, velocity, *machine.table.pressures(machine.state))

    def _stop_when_done(self, samples: int) -> None:
        if self._samples and samples >= self._samples:
            self.frame.say(OK, f"done: {samples} samples in {time.monotonic() - self._started:.3f} s")
            self.frame.stop()

    def _on_command(self, stamp: int, u: float) -> None:
        if self.frame.lockstep and stamp != self._stamp:
            reason = f"command for {stamp * 1e-9:.6f} s while the table is at {self._stamp * 1e-9:.6f} s"
            return self.interlock.foreign(self._stamp, reason)
        self._heard = self.frame.now()
        self.interlock.command(stamp, u)
        return self._step() if self.frame.lockstep else None

    def _on_refused(self, stamp: int, reason: str) -> None:
        self.interlock.refused(self._stamp, reason)
        if self.frame.lockstep and stamp == self._stamp:
            self._step()  # under the last good command, until that is stale

    def _step(self) -> None:
        self._stop_when_done(self._machine.samples + 1)
        if self.frame.stopping:
            return
        self._advance(self._stamp)
        self._stamp += self.frame.period
        if self._apart:
            self._wait()
        self._publish()

    def _wait(self) -> None:
        """Keep the pace; what comes late is not made up for."""
        now = time.monotonic()
        self._due = max(now, self._due + self._apart)
        time.sleep(self._due - now)


build = PlantNode
