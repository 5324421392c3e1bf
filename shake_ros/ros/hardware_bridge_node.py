"""Node `hardware_bridge`: the plant's face over a real table, by datagrams to its target computer.

A thread waits for datagrams and publishes each measurement at once, stamped with the target's clock mapped to ROS
time; commands arrive in the executor's thread and leave as the answer to the measurement whose stamp they bear.
"""

from __future__ import annotations

import math
import threading
from array import array
from collections import OrderedDict
from dataclasses import dataclass

from shake_ros.bridge import wire
from shake_ros.bridge.channels import UNITS, BridgeParameters
from shake_ros.bridge.clock import TargetClock
from shake_ros.bridge.host import Host
from shake_ros.bridge.session import key_for
from shake_ros.core.quantities import Parameters, ShakeError, choice, quantity
from shake_ros.core.safety.causes import NUMBERS
from shake_ros.core.safety.interlock import OFF, RUN
from shake_ros.core.safety.rates import LastSecond
from shake_ros.ros import interface
from shake_ros.ros.diagnostics import OK, WARN
from shake_ros.ros.frame import Frame, node_settings
from shake_ros.ros.interlock import NodeInterlock
from shake_ros.settings import find, read_yaml

WAIT = 0.002  # longest look for a datagram [s]
REMEMBERED = 1024  # measurements whose stamp a command may bear
RESET_TIME = 200_000_000  # the reset is sent for so long, and the target's answer awaited [ns]
NEAR = 3  # periods between a measurement and the reference that it is compared with
LATE = 1.5  # periods without a command of our own to the target
CAUSE_NAMES = {number: name for name, number in NUMBERS.items()}
TOPICS = {
    "position": interface.JOINT_STATES,
    "acceleration": interface.IMU,
    "pressure_a": interface.PRESSURE_A,
    "pressure_b": interface.PRESSURE_B,
    "pressure_supply": interface.PRESSURE_SUPPLY,
}


@dataclass(frozen=True)
class HardwareBridgeParameters(Parameters):
    """The node's own settings."""

    bridge: str = choice("configuration in config/bridge, or a YAML file")
    interlock: str = choice("configuration in config/interlock, or a YAML file")
    enabled: bool = quantity("", "the start sequence begins without the service `enable`")


class HardwareBridge:
    """Measurements out, commands in, the interlock between."""

    ticks = False

    def __init__(self, frame: Frame) -> None:
        self.frame = frame
        if frame.lockstep:
            raise ShakeError("lockstep = true: a real table does not wait; hardware_bridge runs in real time only")
        settings = HardwareBridgeParameters.from_mapping(
            node_settings("hardware_bridge"), "config/node/hardware_bridge.yaml"
        )
        own = frame.parameters.declare(settings).value
        path = find("bridge", own.bridge)
        self._bridge = bridge = BridgeParameters.from_mapping(read_yaml(path), str(path))
        key = key_for(bridge.key_file, bridge.address, bridge.local_address)
        self._host = Host(bridge.address, bridge.port, bridge.local_address, key)
        self._clock = TargetClock()
        self._interlock = NodeInterlock(frame, own.interlock, own.enabled, self._on_reset)
        self._lock = self._interlock.lock
        self._sequences: OrderedDict[int, int] = OrderedDict()
        self._stamp = self._newest = self._heard = self._answered = 0
        self._confirmed = OFF
        self._reset_until = 0
        self._lost, self._lost_before = LastSecond(), 0
        self._received = LastSecond()
        self._reference, self._reference_stamp = math.nan, -1
        self._delays: array[int] = array("q")
        self._writers = {name: frame.writer(TOPICS[name]) for name in UNITS if bridge.channels[name].present}
        frame.reader(interface.VALVE_COMMAND, self._on_command, self._on_refused, self._on_doubled)
        if self._interlock.tracks:
            frame.reader(interface.REFERENCE, self._on_reference)
        frame.diagnostics.condition = self._condition
        self._report()
        self._thread = threading.Thread(target=self._run, name="datagrams", daemon=True)

    def _report(self) -> None:
        host, clock = self._host, self._clock
        self.frame.diagnostics.values |= {
            "link.received": lambda: host.received,
            "link.lost": lambda: host.lost,
            "link.late": lambda: host.late,
            "link.sessions": lambda: host.sessions,
            **{f"link.rejected.{reason}": lambda reason=reason: host.rejected[reason] for reason in wire.REASONS},
            "clock.offset_s": lambda: f"{clock.offset:.9f}",
            "clock.drift_ppm": lambda: f"{clock.drift * 1e6:.3f}",
            "clock.jumps": lambda: clock.jumps,
            "datagram_to_topic_p50_us": self._median_delay,
        }

    def _median_delay(self) -> str:
        delays, self._delays = sorted(self._delays), array("q")
        return f"{delays[len(delays) // 2] / 1000:.1f}" if delays else ""

    def start(self) -> None:
        """Measurements are published from now on."""
        self._heard = self.frame.now()
        self._thread.start()

    def tick(self, stamp: int, steps: int) -> None:
        """Keeps no time of its own."""

    def finish(self) -> None:
        """The target is asked to stop orderly; its watchdog does the rest."""
        self.frame.stopping = True
        if self._thread.ident is not None:
            self._thread.join()
        self._host.send(self._newest, self._bridge.valve.raw(0.0), OFF, 0)
        self._host.close()

    def _run(self) -> None:
        while not self.frame.stopping:
            came = self._host.receive(WAIT)
            now = self.frame.now()
            if came is None:
                with self._interlock.guard:
                    self._silent(now)
                continue
            self._measured(*came)

    def _silent(self, now: int) -> None:
        """No datagram: the sensors are missing."""
        if self._newest:
            self._lock.compare(now, "sensor_missing", (now - self._heard) * 1e-9)
        self._interlock.refresh()
        self._answer(now)

    def _measured(self, message: wire.Measurement, arrival: int) -> None:
        clock, channels = self._clock, self._bridge.channels
        clock.add(message.target_time, arrival)
        self._heard = arrival
        if not clock.ready:
            return
        stamp = max(clock.to_host(message.target_time), self._stamp + 1)
        self._stamp, self._newest = stamp, message.sequence
        self._sequences[stamp] = message.sequence
        if len(self._sequences) > REMEMBERED:
            self._sequences.popitem(last=False)
        values = {name: channels[name].value(getattr(message, name)) for name in UNITS}
        for name, writer in self._writers.items():
            if not math.isnan(values[name]):
                writer.send(stamp, values[name])
            if name == "position":
                self._delays.append(self.frame.now() - arrival)
        with self._interlock.guard:
            self._watch(stamp, message, values)
        self.frame.diagnostics.cycles += 1

    def _watch(self, stamp: int, message: wire.Measurement, values: dict[str, float]) -> None:
        lock, now = self._lock, self.frame.now()
        near = abs(stamp - self._reference_stamp) <= NEAR * self.frame.period
        reference = self._reference if near else math.nan
        lock.observe(stamp, values["position"], values["acceleration"], values["pressure_supply"], reference)
        self._confirmed = message.status & wire.STAGE_MASK
        lost, self._lost_before = self._host.lost - self._lost_before, self._host.lost
        self._lost.add(now, lost)
        self._received.add(now, 1)
        total = self._lost.total(now)
        lock.compare(now, "link_loss", total / (total + self._received.total(now)))
        lock.compare(now, "clock_jump", self._clock.last_jump)
        self._clock.last_jump = 0.0
        if now > self._reset_until:
            self._watch_target(now, message)
        self._interlock.refresh()
        if now - self._answered > LATE * self._bridge.period * 1e9:
            self._answer(now)

    def _watch_target(self, now: int, message: wire.Measurement) -> None:
        if message.status & wire.TRIPPED:
            name = CAUSE_NAMES.get(message.trip, "unknown cause")
            self._lock.report(now, "target_trip", float(message.trip), f"interlock of the target: {name}")
        else:
            self._lock.clear("target_trip")

    def _answer(self, now: int) -> None:
        """A command to the target, whatever acts now."""
        u = self._lock.act(now, min(self._confirmed, RUN))
        flags = wire.RESET if now < self._reset_until else 0
        self._host.send(self._newest, self._bridge.valve.raw(u), self._lock.stage, flags)
        self._answered = now

    def _on_command(self, stamp: int, u: float) -> None:
        now = self.frame.now()
        with self._interlock.guard:
            if stamp not in self._sequences:
                return self._interlock.foreign(now, f"command for {stamp * 1e-9:.6f} s, which no measurement bears")
            self.frame.diagnostics.latency(now - stamp)
            self._lock.command(stamp, u)
            acting = self._lock.act(now, min(self._confirmed, RUN))
            flags = wire.RESET if now < self._reset_until else 0
            self._host.send(self._sequences[stamp], self._bridge.valve.raw(acting), self._lock.stage, flags)
            self._answered = now
        return None

    def _on_refused(self, stamp: int, reason: str) -> None:
        with self._interlock.guard:
            self._interlock.refused(self.frame.now(), reason)

    def _on_doubled(self, stamp: int) -> None:
        with self._interlock.guard:
            reason = f"second command for {stamp * 1e-9:.6f} s: two publishers on {interface.VALVE_COMMAND.name}?"
            self._interlock.foreign(self.frame.now(), reason)

    def _on_reference(self, stamp: int, position: float, *_: float) -> None:
        self._reference, self._reference_stamp = position, stamp

    def _on_reset(self) -> None:
        """Before the interlock's own reset: the target is asked to reset, and given time to do it."""
        self._reset_until = self.frame.now() + RESET_TIME
        self._lock.clear("target_trip")
        self._lock.clear("sensor_missing")

    def _condition(self) -> tuple[int, str]:
        if self._host.session is None:
            return WARN, f"no answer from the target at {self._bridge.address}:{self._bridge.port}"
        level, text = self._interlock.condition()
        if level == OK and self._confirmed != RUN:
            return WARN, f"{text}; the target is not at the stage run"
        return level, text


def build(frame: Frame) -> HardwareBridge:
    """The node in its frame."""
    return HardwareBridge(frame)
