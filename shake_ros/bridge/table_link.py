"""A real table as the host sees it: samples with host stamps and SI values in, commands by their stamps out.

A channel takes a raw value to SI with scale, offset, sign and limits, and the command back.

The target's clock on the host's: offset and drift from the quickest datagrams.

d = arrival − target time is the offset plus the way of the datagram, which is never shorter than its least. So the
smallest d of each BUCKET is kept, and a straight line through those of the last WINDOW buckets is offset and drift.
The offset includes the shortest transit, some 10 µs on a cable: only a second clock could distinguish the two.
"""

from __future__ import annotations

import dataclasses
import math
from collections import OrderedDict, deque
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from shake_ros.bridge import wire
from shake_ros.bridge.ends import Host
from shake_ros.bridge.wire import key_for
from shake_ros.quantities import Parameters, ShakeError, choice, quantity, strict_keys
from shake_ros.realtime import SECOND, LastSecond
from shake_ros.safety.causes import NUMBERS

UNITS = {
    "position": "m",
    "acceleration": "m/s^2",
    "pressure_a": "Pa",
    "pressure_b": "Pa",
    "pressure_supply": "Pa",
}


@dataclass(frozen=True)
class IoChannel(Parameters):
    """One measured channel: value = sign · scale · (raw − offset); beyond its limits it is no reading."""

    raw_unit: str = choice("unit of the raw value")
    unit: str = choice("unit of the value")
    present: bool = quantity("", "whether the target has this channel")
    scale: float = quantity("unit/raw_unit", "value for one raw unit", low=1e-12, high=1e12)
    offset: float = quantity("raw_unit", "raw value at zero", low=-1e12, high=1e12)
    sign: int = quantity("-", "1, or -1 where the channel counts the other way", low=-1, high=1)
    lowest: float = quantity("unit", "smallest value that can be", low=-1e12, high=1e12)
    highest: float = quantity("unit", "largest value that can be", low=-1e12, high=1e12)

    def value(self, raw: float) -> float:
        """SI value of a raw one; NaN where it is absent, not finite or beyond the limits.

        >>> channel = IoChannel("V", "m", True, 0.015, 0.1, -1, -0.15, 0.15)
        >>> round(channel.value(2.1), 6), channel.value(12.0)
        (-0.03, nan)
        """
        value = self.sign * self.scale * (raw - self.offset)
        return value if self.present and self.lowest <= value <= self.highest else math.nan


@dataclass(frozen=True)
class Valve(Parameters):
    """The command: raw = sign · scale · u + offset, within ±limit of u."""

    raw_unit: str = choice("unit of the raw value")
    scale: float = quantity("raw_unit", "raw value of the full command", low=1e-12, high=1e12)
    offset: float = quantity("raw_unit", "raw value of the valve's null", low=-1e12, high=1e12)
    sign: int = quantity("-", "1, or -1 where the valve is connected the other way", low=-1, high=1)
    limit: float = quantity("-", "largest command that is sent", low=0.0, high=1.0)

    def raw(self, u: float) -> float:
        """Raw value of a command."""
        return self.sign * self.scale * min(max(u, -self.limit), self.limit) + self.offset


@dataclass(frozen=True)
class BridgeParameters(Parameters):
    """Where the target computer is, and its channels."""

    address: str = choice("of the target computer")
    port: int = quantity("-", "UDP port of the target computer", low=1, high=65535)
    local_address: str = choice("of this machine on that network")
    key_file: str = choice("shared key in hexadecimal digits; empty: none, loopback addresses only")
    period: float = quantity("s", "of the target's samples", low=1e-5, high=0.1)
    channels: Any = dataclasses.field(default=None)
    valve: Any = dataclasses.field(default=None)

    @classmethod
    def from_mapping(cls, mapping: Mapping[str, Any], where: str) -> BridgeParameters:
        """Build from a YAML mapping; `channels` holds every channel, `valve` the command."""
        if not isinstance(mapping, Mapping) or not isinstance(mapping.get("channels"), Mapping):
            raise ShakeError(f"{where}: expected names, and under 'channels' {', '.join(UNITS)}")
        names = [f.name for f in dataclasses.fields(cls)]
        strict_keys(mapping, names, where, names)
        channels = {}
        for name, content in strict_keys(mapping["channels"], UNITS, where, UNITS, kind="channel").items():
            channel = channels[name] = IoChannel.from_mapping(content, f"{where}: channels.{name}")
            if channel.unit != UNITS[name]:
                raise ShakeError(f"{where}: channels.{name}.unit = '{channel.unit}' must be {UNITS[name]}")
            if channel.sign == 0 or channel.lowest >= channel.highest:
                raise ShakeError(f"{where}: channels.{name}: sign 0, or lowest not below highest")
        valve = Valve.from_mapping(mapping["valve"], f"{where}: valve")
        if valve.sign == 0:
            raise ShakeError(f"{where}: valve.sign = 0")
        return super().from_mapping({**mapping, "channels": channels, "valve": valve}, where)


BUCKET = SECOND // 10  # [ns]
WINDOW = 100  # buckets
ENOUGH = 10  # buckets before a drift is fitted
JUMP = 50_000_000  # a distance from the line that no way of a datagram explains [ns]
PATIENCE = 20  # so many of them in a row are another clock


class TargetClock:
    """Maps the target's time to the host's."""

    def __init__(self) -> None:
        self.jumps = 0
        self.last_jump = 0.0
        self._restart()

    def _restart(self) -> None:
        self._least: deque[tuple[int, int]] = deque(maxlen=WINDOW)
        self._bucket: tuple[int, int] | None = None
        self._bucket_end = 0
        self._origin = 0
        self._offset = 0
        self._drift = 0.0
        self._far = 0
        self.samples = 0

    @property
    def ready(self) -> bool:
        """Whether a few datagrams have come, so that one slow one does not set the offset."""
        return self.samples >= PATIENCE

    @property
    def offset(self) -> float:
        """Host time minus target time at the newest bucket [s]."""
        return self._offset / SECOND

    @property
    def drift(self) -> float:
        """How much faster the host's clock goes than the target's [-]."""
        return self._drift

    def add(self, target_time: int, arrival: int) -> None:
        """A datagram: when it was sent [ns, target's clock], and when it came [ns, host's clock]."""
        distance = arrival - target_time
        if self.samples and abs(distance - self._at(target_time)) > JUMP:
            self._far += 1
            if self._far < PATIENCE:
                return
            self.last_jump = abs(distance - self._at(target_time)) / SECOND
            self.jumps += 1
            self._restart()
        self._far = 0
        self.samples += 1
        if self._bucket is None or target_time >= self._bucket_end:
            self._close(target_time)
            self._bucket = (target_time, distance)
            self._bucket_end = target_time + BUCKET
        elif distance < self._bucket[1]:
            self._bucket = (target_time, distance)
        if len(self._least) < ENOUGH:
            smallest = min([one[1] for one in self._least] + [self._bucket[1]])
            self._origin, self._offset, self._drift = target_time, smallest, 0.0

    def _close(self, now: int) -> None:
        if self._bucket is None:
            return
        self._least.append(self._bucket)
        if len(self._least) < ENOUGH:
            return
        first = self._least[0]
        t = np.array([one[0] - first[0] for one in self._least], dtype=np.float64)
        d = np.array([one[1] - first[1] for one in self._least], dtype=np.float64)
        middle, height = float(t.mean()), float(d.mean())
        t -= middle
        self._drift = float(t @ d) / float(t @ t)
        self._origin = now
        self._offset = first[1] + round(height + self._drift * (now - first[0] - middle))

    def _at(self, target_time: int) -> int:
        return self._offset + round(self._drift * (target_time - self._origin))

    def to_host(self, target_time: int) -> int:
        """Host time of a target time [ns]."""
        return target_time + self._at(target_time)


REMEMBERED = 1024  # samples whose stamp a command may bear
CAUSE_NAMES = {number: name for name, number in NUMBERS.items()}


class Sample(NamedTuple):
    """One sample of the table."""

    stamp: int  # the sampling instant on the host's clock [ns]
    arrival: int  # of the datagram [ns]
    values: dict[str, float]  # by channel, SI; NaN where there is no reading
    stage: int  # that the target has reached
    tripped: str  # cause of the target's interlock, empty where it is well


class TableLink:
    """Host, clock and channels of one table."""

    def __init__(self, parameters: BridgeParameters) -> None:
        self.parameters = p = parameters
        self.host = Host(p.address, p.port, p.local_address, key_for(p.key_file, p.address, p.local_address))
        self.clock = TargetClock()
        self._sequences: OrderedDict[int, int] = OrderedDict()
        self._stamp = self._newest = 0
        self._lost, self._lost_before = LastSecond(), 0
        self._received = LastSecond()

    def receive(self, timeout: float) -> Sample | None:
        """The next sample; None after `timeout` [s] without one, or while the clock is not known yet."""
        came = self.host.receive(timeout)
        if came is None:
            return None
        message, arrival = came
        self.clock.add(message.target_time, arrival)
        if not self.clock.ready:
            return None
        self._stamp = stamp = max(self.clock.to_host(message.target_time), self._stamp + 1)
        self._newest = self._sequences[stamp] = message.sequence
        if len(self._sequences) > REMEMBERED:
            self._sequences.popitem(last=False)
        channels = self.parameters.channels
        values = {name: channels[name].value(getattr(message, name)) for name in UNITS}
        tripped = CAUSE_NAMES.get(message.trip, "of its own") if message.status & wire.TRIPPED else ""
        return Sample(stamp, arrival, values, message.status & wire.STAGE_MASK, tripped)

    def knows(self, stamp: int) -> bool:
        """Whether one of the latest samples bears this stamp."""
        return stamp in self._sequences

    def send(self, u: float, stage: int, reset: bool, at_once: bool, stamp: int = -1) -> None:
        """A command as the answer to the sample of a stamp, of the newest where it is left out."""
        answers = self._sequences.get(stamp, self._newest)
        flags = (wire.RESET if reset else 0) | (wire.AT_ONCE if at_once else 0)
        self.host.send(answers, self.parameters.valve.raw(u), stage, flags)

    def loss(self, now: int) -> float:
        """Share of the samples of the last second that never came; call it once a sample."""
        lost, self._lost_before = self.host.lost - self._lost_before, self.host.lost
        self._lost.add(now, lost)
        self._received.add(now, 1)
        total = self._lost.total(now)
        return total / (total + self._received.total(now))

    def jump(self) -> float:
        """Size [s] of a jump of either clock since the last call, else 0."""
        found, self.clock.last_jump = self.clock.last_jump, 0.0
        return found

    def report(self) -> dict[str, object]:
        """Counts and clock, for /diagnostics."""
        host, clock = self.host, self.clock
        return {
            "link.received": host.received,
            "link.lost": host.lost,
            "link.late": host.late,
            "link.sessions": host.sessions,
            **{f"link.rejected.{reason}": host.rejected[reason] for reason in wire.REASONS},
            "clock.offset_s": f"{clock.offset:.9f}",
            "clock.drift_ppm": f"{clock.drift * 1e6:.3f}",
            "clock.jumps": clock.jumps,
        }
