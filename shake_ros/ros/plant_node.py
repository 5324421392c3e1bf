"""Node `plant`: the simulated table with its sensors, stepped by commands (lock-step) or by the clock."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

from shake_ros.core.plant.parameters import TableParameters
from shake_ros.core.plant.table import Table
from shake_ros.core.quantities import Parameters, choice, quantity
from shake_ros.ros import interface
from shake_ros.ros.conversions import SECOND
from shake_ros.ros.frame import FIRST_STAMP, Frame, node_settings
from shake_ros.ros.interlock import Interlock
from shake_ros.settings import load_table


@dataclass(frozen=True)
class PlantParameters(Parameters):
    """The node's own settings; those of the table come from its configuration."""

    table: str = choice("configuration in config/table, or a YAML file")
    seed: int = quantity("-", "seed of the sensor noise", low=0, high=2**31 - 1)
    duration: float = quantity("s", "stop after this, 0 for never", low=0.0, high=1e6)
    start_position: float = quantity("m", "position of the table at the start", low=-10.0, high=10.0)
    enabled: bool = quantity("", "moves from the start, without the service `enable`")
    stale_after: float = quantity("s", "a command older than this leads to a safe hold", low=0.001, high=10.0)
    ramp_time: float = quantity("s", "from full command to zero in a safe hold", low=0.0, high=10.0)


class Plant:
    """Publishes measurement k, awaits the command for it (lock-step) or the next tick (real time), advances."""

    def __init__(self, frame: Frame) -> None:
        self.frame = frame
        self.ticks = not frame.lockstep
        settings = PlantParameters.from_mapping(node_settings("plant"), "config/node/plant.yaml")
        own = frame.parameters.declare(settings).value
        self._seed = own.seed
        self._live = frame.parameters.declare(load_table(own.table), accept=self._table)
        self._simulation = self._table(self._live.value)
        self._state = self._simulation.initial_state(own.start_position)
        self._simulation.measure(self._simulation.advance(self._state, 0.0), 0)  # compiles before the first sample
        self._k = 0
        self._stamp = FIRST_STAMP
        self._samples = round(own.duration / frame.sample_time)
        self._ticked = False
        self._started = 0.0
        self._late_commands = 0
        self._lock = Interlock(own.enabled, round(own.stale_after * SECOND), round(own.ramp_time * SECOND))
        self._open_topics()
        self._open_services()
        frame.diagnostics.condition = self._condition
        frame.diagnostics.values |= {
            "safe_holds": lambda: self._lock.holds,
            "late_commands": lambda: self._late_commands,
            "sample": lambda: self._k,
        }

    def _table(self, parameters: TableParameters) -> Table:
        return Table(parameters, self.frame.sample_time, self._seed)

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

    def _open_services(self) -> None:
        for service, answer in (
            (interface.ENABLE, self._on_enable),
            (interface.STOP, self._on_stop),
            (interface.RESET, self._on_reset),
        ):
            self.frame.node.create_service(service.type, service.name, answer)

    def start(self) -> None:
        """In lock-step the first measurement sets the loop going."""
        self._started = time.monotonic()
        if self.frame.lockstep:
            self._publish()

    def tick(self, stamp: int, steps: int) -> None:
        """One or, when late, several periods under the newest command; then the next measurement."""
        arrived = self._commands.take()
        newest = self._commands.input.last_stamp
        if arrived:
            self.frame.diagnostics.latency(arrived - newest)
        if self._ticked:
            self._late_commands += 0 <= newest < stamp - steps * self.frame.period
            for _ in range(steps):
                self._advance(stamp)
        self._ticked = True
        self._stamp = stamp
        self._publish()
        self._stop_when_done(self._k)

    def finish(self) -> None:
        """Nothing to put away."""

    def _publish(self) -> None:
        measured = self._simulation.measure(self._state, self._k)
        stamp = self._stamp
        self._positions.send(stamp, measured.position)
        self._accelerations.send(stamp, measured.acceleration)
        self._pressures_a.send(stamp, measured.pressure_a)
        self._pressures_b.send(stamp, measured.pressure_b)
        self._supply.send(stamp, measured.pressure_supply)
        self._truth.send(stamp, measured.truth_position, measured.truth_velocity, measured.truth_acceleration)
        if self._clock is not None:
            self._clock.send(stamp)
        self.frame.diagnostics.cycles += 1

    def _advance(self, now: int) -> None:
        if self._live.changed:
            self._simulation = self._table(self._live.take())
        self._state = self._simulation.advance(self._state, self._lock.act(now))
        self._k += 1

    def _stop_when_done(self, samples: int) -> None:
        if self._samples and samples >= self._samples:
            elapsed = time.monotonic() - self._started
            self.frame.node.get_logger().info(f"done: {samples} samples in {elapsed:.3f} s")
            self.frame.stop()

    def _on_command(self, stamp: int, u: float) -> None:
        if not self.frame.lockstep:
            self._lock.command(stamp, u)
        elif stamp == self._stamp:
            self._lock.command(stamp, u)
            self._step()
        else:
            self._refuse(f"command for {stamp * 1e-9:.6f} s while the table is at {self._stamp * 1e-9:.6f} s")

    def _on_refused(self, stamp: int, _reason: str) -> None:
        if self.frame.lockstep and stamp == self._stamp:
            self._step()  # under the last good command, until that is stale

    def _step(self) -> None:
        self._stop_when_done(self._k + 1)
        if self.frame.stopping:
            return
        self._advance(self._stamp)
        self._stamp += self.frame.period
        self._publish()

    def _on_doubled(self, stamp: int) -> None:
        self._refuse(f"second command for {stamp * 1e-9:.6f} s: two publishers on {interface.VALVE_COMMAND.name}?")

    def _refuse(self, fault: str) -> None:
        self._lock.fault = fault
        self.frame.diagnostics.fault("command", fault)

    def _condition(self) -> tuple[int, str]:
        publishers = self.frame.node.count_publishers(interface.VALVE_COMMAND.name)
        if publishers > 1 and not self._lock.fault:
            self._refuse(f"{publishers} publishers on {interface.VALVE_COMMAND.name}")
        return self._lock.condition()

    def _on_enable(self, request: Any, response: Any) -> Any:
        self._lock.enabled = request.data
        response.success, response.message = True, self._lock.condition()[1]
        return response

    def _on_stop(self, _request: Any, response: Any) -> Any:
        self._lock.stopped = True
        response.success, response.message = True, self._lock.condition()[1]
        return response

    def _on_reset(self, _request: Any, response: Any) -> Any:
        self._lock.reset()
        self.frame.diagnostics.clear()
        text = self._condition()[1]
        response.success, response.message = not self._lock.fault, text
        return response


def build(frame: Frame) -> Plant:
    """The node in its frame."""
    return Plant(frame)
