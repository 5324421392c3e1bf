"""Node `plant`: the simulated table with its sensors, stepped by commands (lock-step) or by the clock."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

from shake_ros.core.plant.parameters import TableParameters
from shake_ros.core.plant.pressure_bounds import PressureWatch
from shake_ros.core.plant.states import VELOCITY
from shake_ros.core.plant.table import Table
from shake_ros.core.quantities import Parameters, ShakeError, choice, quantity
from shake_ros.core.safety.faults import MISSING, MachineFaultParameters
from shake_ros.core.safety.machine import Machine
from shake_ros.core.safety.power_unit import PowerUnitParameters
from shake_ros.ros import interface
from shake_ros.ros.diagnostics import WARN
from shake_ros.ros.frame import FIRST_STAMP, Frame, Writer, node_settings
from shake_ros.ros.interlock import NodeInterlock
from shake_ros.settings import load_table


@dataclass(frozen=True)
class PlantParameters(Parameters):
    """The node's own settings; those of the table come from its configuration."""

    table: str = choice("configuration in config/table, or a YAML file")
    seed: int = quantity("-", "seed of the sensor noise", low=0, high=2**31 - 1)
    duration: float = quantity("s", "stop after this, 0 for never", low=0.0, high=1e6)
    start_position: float = quantity("m", "position of the table at the start", low=-10.0, high=10.0)
    enabled: bool = quantity("", "moves from the start, without the service `enable`")
    interlock: str = choice("configuration in config/interlock, or a YAML file")


class Plant:
    """Publishes measurement k, awaits the command for it (lock-step) or the next tick (real time), advances."""

    def __init__(self, frame: Frame) -> None:
        self.frame = frame
        self.ticks = not frame.lockstep
        content = node_settings("plant")
        unit = PowerUnitParameters.from_mapping(content.pop("power_unit", {}), "config/node/plant.yaml: power_unit")
        settings = PlantParameters.from_mapping(content, "config/node/plant.yaml")
        own = frame.parameters.declare(settings).value
        self._stamp = FIRST_STAMP
        self._samples = round(own.duration / frame.sample_time)
        self._ticked = False
        self._started = 0.0
        self._late_commands = 0
        self._heard = 0  # when a command came between two ticks, as the executor of composed nodes delivers it [ns]
        self._interlock = NodeInterlock(frame, own.interlock, own.enabled)
        self._lock = self._interlock.lock
        self._live = frame.parameters.declare(load_table(own.table), accept=self._accept)
        self._machine = Machine(
            self._live.value,
            frame.parameters.declare(unit, "power_unit.").value,
            frame.sample_time,
            own.seed,
            own.start_position,
            self._lock.stage,
        )
        self._watch = PressureWatch(self._live.value, frame.sample_time)
        self._faults = frame.parameters.declare(MachineFaultParameters(), "faults.", accept=self._accept_faults)
        self._machine.on = self._faults.take().on()
        self._open_topics()
        frame.diagnostics.values |= {
            "late_commands": lambda: self._late_commands,
            "sample": lambda: self._machine.samples,
            "faults": lambda: " ".join(self._machine.on),
            "pressures": lambda: "; ".join(self._watch.findings()) or "as oil can have them",
        }

    def _accept(self, parameters: TableParameters) -> None:
        Table(parameters, self.frame.sample_time, 0)

    def _accept_faults(self, faults: MachineFaultParameters) -> None:
        if self.frame.lockstep and (off := set(faults.on()) & set(MISSING)):
            raise ShakeError(f"faults.{min(off)}: in lock-step the loop would wait for ever; it needs real time")

    def _open_topics(self) -> None:
        self._positions = self.frame.writer(interface.JOINT_STATES)
        self._accelerations = self.frame.writer(interface.IMU)
        self._pressures_a = self.frame.writer(interface.PRESSURE_A)
        self._pressures_b = self.frame.writer(interface.PRESSURE_B)
        self._supply = self.frame.writer(interface.PRESSURE_SUPPLY)
        self._truth = self.frame.writer(interface.TRUTH)
        self._clock = self.frame.writer(interface.CLOCK) if self.frame.lockstep else None
        self._commands = self.frame.reader(
            interface.VALVE_COMMAND, self._on_command, self._on_refused, self._on_doubled
        )

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
        if arrived:
            self.frame.diagnostics.latency(arrived - newest)
        if self._ticked:
            self._late_commands += 0 <= newest < stamp - steps * self.frame.period
            for earlier in range(steps - 1, -1, -1):  # each at its own time, so that a stale command is one
                self._advance(stamp - earlier * self.frame.period)
            self._interlock.tick(stamp, steps - 1)
        if self._interlock.references is not None:
            self._interlock.references.take()
        self._ticked = True
        self._stamp = stamp
        self._publish()
        self._stop_when_done(self._machine.samples)

    def finish(self) -> None:
        """Nothing to put away."""

    def _publish(self) -> None:
        if self._faults.changed:
            self._switch()
        measured = self._machine.measure()
        stamp = self._stamp
        self._send(self._positions, measured.position)
        self._send(self._accelerations, measured.acceleration)
        self._pressures_a.send(stamp, measured.pressure_a)
        self._pressures_b.send(stamp, measured.pressure_b)
        self._send(self._supply, measured.pressure_supply)
        self._truth.send(stamp, measured.truth_position, measured.truth_velocity, measured.truth_acceleration)
        if self._clock is not None:
            self._clock.send(stamp)
        self._interlock.observe(stamp, measured.position, measured.acceleration, measured.pressure_supply)
        self._interlock.refresh()
        self.frame.diagnostics.cycles += 1

    def _send(self, writer: Writer, reading: float) -> None:
        """A reading; a sensor whose cable is off says nothing."""
        if not math.isnan(reading):
            writer.send(self._stamp, reading)

    def _switch(self) -> None:
        """Faults that come on or go; said at once, with the sample's stamp, so that a recording has it."""
        on = self._faults.take().on()
        self._machine.on = on
        text = ", ".join(f"{name} {value:g}" for name, value in on.items()) or "none"
        self.frame.diagnostics.event("fault", WARN, text, {"time_ns": self._stamp, "faults": " ".join(on)})

    def _advance(self, now: int) -> None:
        machine = self._machine
        if self._live.changed:
            machine.change(self._live.take())
            self._watch = PressureWatch(self._live.value, self.frame.sample_time)
        u = self._lock.act(now, machine.confirmed())
        machine.advance(self._lock.stage, u)
        self._watch.observe(*machine.state[: VELOCITY + 1], *machine.table.pressures(machine.state))

    def _stop_when_done(self, samples: int) -> None:
        if self._samples and samples >= self._samples:
            elapsed = time.monotonic() - self._started
            self.frame.node.get_logger().info(f"done: {samples} samples in {elapsed:.3f} s")
            self.frame.stop()

    def _on_command(self, stamp: int, u: float) -> None:
        if not self.frame.lockstep:
            self._heard = self.frame.now()
            self._interlock.command(stamp, u)
        elif stamp == self._stamp:
            self._lock.command(stamp, u)
            self._step()
        else:
            reason = f"command for {stamp * 1e-9:.6f} s while the table is at {self._stamp * 1e-9:.6f} s"
            self._interlock.foreign(self._stamp, reason)

    def _on_refused(self, stamp: int, reason: str) -> None:
        self._interlock.refused(self._stamp, reason)
        if self.frame.lockstep and stamp == self._stamp:
            self._step()  # under the last good command, until that is stale

    def _step(self) -> None:
        self._stop_when_done(self._machine.samples + 1)
        if self.frame.stopping:
            return
        self._advance(self._stamp)
        self._stamp += self.frame.period
        self._publish()

    def _on_doubled(self, stamp: int) -> None:
        reason = f"second command for {stamp * 1e-9:.6f} s: two publishers on {interface.VALVE_COMMAND.name}?"
        self._interlock.foreign(self._stamp, reason)


def build(frame: Frame) -> Plant:
    """The node in its frame."""
    return Plant(frame)
