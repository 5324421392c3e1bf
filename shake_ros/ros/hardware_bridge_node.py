"""Node `hardware_bridge`: the same topics over a real table, by datagrams to its target computer.

A thread waits for datagrams and publishes each sample at once; commands arrive in the executor's thread and leave as
the answer to the sample whose stamp they bear. While none comes, the interlock's own command goes out each period.
"""

from __future__ import annotations

import sys
import threading
from array import array
from dataclasses import dataclass

from shake_ros.bridge.table_link import UNITS, BridgeParameters, Sample, TableLink
from shake_ros.quantities import Parameters, ShakeError, choice, quantity
from shake_ros.ros import interface
from shake_ros.ros.diagnostics import NO_ANSWER, OK, WARN
from shake_ros.ros.frame import Behaviour, Frame, Reader
from shake_ros.ros.interlock import NodeInterlock, SensorWriters
from shake_ros.safety.causes import OFF, RUN
from shake_ros.settings import load_parameters

WAIT = 0.002  # longest look for a datagram [s]
RESET_TIME = 200_000_000  # the reset is sent for so long, and the target's answer awaited [ns]
LATE = 1.5  # periods without a command of our own to the target
HANDOVER = 1e-4  # one thread waits for the other to give the interpreter away for at most so long [s]


@dataclass(frozen=True)
class HardwareBridgeParameters(Parameters):
    """The node's own settings."""

    bridge: str = choice("configuration in config/bridge, or a YAML file")
    enabled: bool = quantity("", "the start sequence begins without the service `enable`")


class HardwareBridge(Behaviour):
    """Samples out, commands in, the interlock between."""

    def __init__(self, frame: Frame) -> None:
        super().__init__(frame)
        if frame.lockstep:
            raise ShakeError("lockstep = true: a real table does not wait; hardware_bridge runs in real time only")
        if frame.simulated:
            raise ShakeError("use_sim_time = true: a real table has the time of its own target computer")
        own = frame.settings(HardwareBridgeParameters).value
        self._link = TableLink(load_parameters("bridge", own.bridge, BridgeParameters))
        self._late = round(LATE * self._link.parameters.period * 1e9)
        self.interlock = NodeInterlock(frame, own.enabled, self._before_reset)
        self._heard = self._answered = self._reset_until = self._published = 0
        self._confirmed, self._announced = OFF, False  # stage of the target; whether it knows that the host has tripped
        self._delays: array[int] = array("q")
        channels = self._link.parameters.channels
        self._sensors = SensorWriters(frame, [name for name in UNITS if channels[name].present])
        Reader(
            frame,
            interface.VALVE_COMMAND,
            self._on_command,
            lambda _, reason: self.interlock.refused(frame.now(), reason),
            lambda stamp: self.interlock.doubled(frame.now(), stamp),
        )
        frame.diagnostics.condition = self._condition
        frame.diagnostics.groups.append(self._link.report)
        frame.diagnostics.values["datagram_to_topic_p50_us"] = self._median_delay
        self._thread = threading.Thread(target=self._run, name="datagrams", daemon=True)

    def start(self) -> None:
        """Samples are published from now on, also while the other thread is about its report."""
        sys.setswitchinterval(HANDOVER)
        self._thread.start()

    def finish(self) -> None:
        """The target is asked to stop orderly; its watchdog does the rest."""
        self.frame.stopping = True
        if self._thread.ident is not None:
            self._thread.join()
        self._link.send(0.0, OFF, False, False)
        self._link.host.close()

    def _run(self) -> None:
        while not self.frame.stopping:
            sample = self._link.receive(WAIT)
            if sample is not None:
                self._publish(sample)
            with self.interlock.guard:
                now = self.frame.now()
                if sample is not None:
                    self._watch(now, sample)
                elif self._heard:
                    self.interlock.watch(now, "sensor_missing", (now - self._heard) * 1e-9)
                self.interlock.refresh()
                if (
                    sample is None
                    or now - self._answered > self._late
                    or self.interlock.core.tripped != self._announced
                ):
                    self._answer(now)

    def _publish(self, sample: Sample) -> None:
        self._sensors.send(sample.stamp, sample.values)
        self._delays.append(self.frame.now() - sample.arrival)
        diagnostics = self.frame.diagnostics
        diagnostics.sampled()
        if self._published:
            diagnostics.missed += max(0, round((sample.stamp - self._published) / self.frame.period) - 1)
        self._published = sample.stamp

    def _watch(self, now: int, sample: Sample) -> None:
        lock, values = self.interlock, sample.values
        self._heard, self._confirmed = sample.arrival, sample.stage
        readings = values["position"], values["acceleration"], values["pressure_supply"]
        lock.observe(sample.stamp, *readings, self._link.loss(now))
        lock.watch(now, "clock_jump", self._link.jump())
        if now > self._reset_until:
            if sample.tripped:
                lock.report(now, "target_trip", 1.0, f"interlock of the target: {sample.tripped}")
            else:
                lock.clear("target_trip")

    def _answer(self, now: int, stamp: int = -1) -> None:
        """What acts now goes to the target."""
        u = self.interlock.act(now, min(self._confirmed, RUN))
        self._announced = self.interlock.core.tripped
        self._link.send(u, self.interlock.core.stage, now < self._reset_until, self._announced, stamp)
        self._answered = now

    def _on_command(self, stamp: int, u: float) -> None:
        now = self.frame.now()
        with self.interlock.guard:
            if not self._link.knows(stamp):
                return self.interlock.foreign(
                    now, f"command for {stamp * 1e-9:.6f} s, an instant without a measurement"
                )
            self.frame.diagnostics.latency(now - stamp)
            self.interlock.command(stamp, u)
            self._answer(now, stamp)
        return self.frame.pause.begins()

    def _before_reset(self) -> None:
        """The target is asked to reset as well, and given time to do it."""
        self._reset_until = self.frame.now() + RESET_TIME
        self.interlock.clear("target_trip")
        self.interlock.clear("sensor_missing")

    def _median_delay(self) -> str:
        delays, self._delays = sorted(self._delays), array("q")
        return f"{delays[len(delays) // 2] / 1000:.1f}" if delays else ""

    def _condition(self) -> tuple[int, str]:
        if self._link.host.session is None:
            return WARN, f"{NO_ANSWER} at {self._link.parameters.address}:{self._link.parameters.port}"
        level, text = self.interlock.condition()
        if level == OK and self._confirmed != RUN:
            return WARN, f"{text}; the target is not at the stage run"
        return level, text


build = HardwareBridge
