"""Both ends of the link in one process, and a relay between them that loses, delays, doubles and breaks."""

from __future__ import annotations

import random
import socket
from collections.abc import Callable, Iterator

import pytest

from shake_ros.bridge import wire
from shake_ros.bridge.emulator import Emulator, EmulatorParameters, Switches, parse_fault
from shake_ros.bridge.ends import Host, TargetLink
from shake_ros.safety.causes import RUN
from shake_ros.safety.machine import PowerUnitParameters
from shake_ros.settings import find, load_interlock, load_table, read_yaml

MS = 1_000_000
KEY = b"a key that both ends have, 32 by"


class Pair:
    """Host and emulator over loopback sockets; the emulator's time goes on by `step` alone."""

    def __init__(self, faults: tuple[str, ...] = (), key: bytes = KEY) -> None:
        self.time = self.stepped = 0
        content = dict(read_yaml(find("emulator", "default"))) | {"port": 0}
        unit = PowerUnitParameters.from_mapping(content.pop("power_unit"), "unit")
        own = EmulatorParameters.from_mapping(content, "emulator")
        self.link = TargetLink("127.0.0.1", 0, KEY, self.clock)
        self.switches = Switches([parse_fault(text) for text in faults])
        self.emulator = Emulator(
            own, load_table(own.table), unit, load_interlock(own.interlock), self.link, self.switches
        )
        self.key = key
        self.host = self.new_host(self.link.address[1])
        self.newest: wire.TableDatagram | None = None

    def clock(self) -> float:
        """Time of both ends [s]: no pause of this machine is seen by either."""
        return self.time * 1e-3

    def new_host(self, port: int) -> Host:
        """Another host that knows the key."""
        return Host("127.0.0.1", port, "127.0.0.1", self.key, self.clock)

    def step(self, u: float | None = None, mode: int = RUN, flags: int = 0) -> wire.TableDatagram | None:
        """One period, and those by which `time` went on besides: measured, taken, and answered unless `u` is None."""
        self.time += 1
        steps = self.time - self.stepped
        self.stepped = self.time
        self.emulator.step(self.time * MS, steps)
        came = self.host.receive(0.0)
        if came is not None:
            self.newest = came[0]
            if u is not None:
                self.host.send(self.newest.sequence, u, mode, flags)
        return came[0] if came else None

    def run(self, steps: int, u: float | None, mode: int = RUN, flags: int = 0) -> list[wire.TableDatagram]:
        """Many periods; what was measured."""
        return [one for _ in range(steps) if (one := self.step(u, mode, flags)) is not None]

    def start(self) -> None:
        """To the stage run."""
        for _ in range(3000):
            self.step(0.0)
            if self.newest is not None and self.newest.status & wire.STAGE_MASK == RUN:
                return
        raise AssertionError(f"not at the stage run: {self.newest}, {self.host.rejected}, {self.link.rejected}")

    def close(self) -> None:
        self.host.close()
        self.link.close()


@pytest.fixture
def make_pair() -> Iterator[Callable[..., Pair]]:
    """Makes host and emulator."""
    pairs: list[Pair] = []

    def make(*faults: str, key: bytes = KEY) -> Pair:
        pairs.append(Pair(faults, key))
        return pairs[-1]

    yield make
    for pair in pairs:
        pair.close()


class Relay:
    """Datagrams from one side to the other, badly; deterministic by its seed and the order of calls."""

    def __init__(self, target: tuple[str, int], seed: int = 2) -> None:
        self.random = random.Random(seed)
        self.front = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.back = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        for one in (self.front, self.back):
            one.bind(("127.0.0.1", 0))
            one.setblocking(False)
        self.port = self.front.getsockname()[1]
        self._target = target
        self._host: tuple[str, int] | None = None
        self._waiting: list[tuple[int, bytes, bool]] = []
        self._turn = 0

    def carry(self) -> None:
        """What has come goes on: 3 % lost, 2 % doubled, 2 % broken, 5 % later."""
        self._turn += 1
        for inward, one in ((True, self.front), (False, self.back)):
            while True:
                try:
                    data, sender = one.recvfrom(2048)
                except BlockingIOError:
                    break
                if inward:
                    self._host = sender
                self._treat(data, inward)
        due = [item for item in self._waiting if item[0] <= self._turn]
        self._waiting = [item for item in self._waiting if item[0] > self._turn]
        for _, data, inward in due:
            if inward:
                self.back.sendto(data, self._target)
            elif self._host is not None:
                self.front.sendto(data, self._host)

    def _treat(self, data: bytes, inward: bool) -> None:
        chance = self.random.random
        if chance() < 0.03:
            return
        if chance() < 0.02:
            broken = bytearray(data)
            broken[self.random.randrange(len(data))] ^= 1 << self.random.randrange(8)
            data = bytes(broken)
        delay = self.random.randrange(1, 5) if chance() < 0.05 else 0
        for _ in range(2 if chance() < 0.02 else 1):
            self._waiting.append((self._turn + delay, data, inward))

    def close(self) -> None:
        self.front.close()
        self.back.close()


@pytest.fixture
def make_relay() -> Iterator[Callable[..., Relay]]:
    """Makes relays."""
    relays: list[Relay] = []

    def make(target: tuple[str, int]) -> Relay:
        relays.append(Relay(target))
        return relays[-1]

    yield make
    for relay in relays:
        relay.close()
