"""A real table as the host sees it: samples with host stamps and SI values in, commands by their stamps out."""

from __future__ import annotations

from collections import OrderedDict
from typing import NamedTuple

from shake_ros.bridge import wire
from shake_ros.bridge.channels import UNITS, BridgeParameters
from shake_ros.bridge.clock import TargetClock
from shake_ros.bridge.host import Host
from shake_ros.bridge.session import key_for
from shake_ros.core.safety.causes import NUMBERS
from shake_ros.core.safety.rates import LastSecond

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
    """Host, clock and channels of one table.

    Parameters
    ----------
    parameters : of the link.
    """

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
