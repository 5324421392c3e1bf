"""Both ends of the link: the host's, which asks for a session, and the target's, which offers it.

The host takes measurements and sends commands, the target the other way round, each command once; both count what they
refuse.
"""

from __future__ import annotations

import secrets
import select
import socket
import struct
import time
from collections import Counter, OrderedDict
from collections.abc import Callable

from shake_ros.bridge import wire
from shake_ros.bridge.wire import Session, numeric, session_key
from shake_ros.quantities import ShakeError
from shake_ros.realtime import SECOND

HELLO_PERIOD = 0.1  # [s] between two hellos
SILENCE = 0.5  # after so long without a measurement [s] a new session is asked for
BUFFER = 1 << 20  # of the socket [bytes]
TIMESPEC = struct.Struct("@qq")
SO_TIMESTAMPNS = 35  # of Linux, not in Python's socket module
MOST_AT_ONCE = 64  # datagrams that are looked at in one call


def udp_socket(address: str, port: int) -> socket.socket:
    """A bound socket whose datagrams bear the time of their arrival; raises ShakeError where it cannot be bound."""
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        made.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER)
        made.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
        made.bind((numeric(address), port))
        made.setblocking(False)
    except (OSError, ShakeError) as error:
        made.close()
        raise ShakeError(f"address {address}:{port}: {getattr(error, 'strerror', None) or error}") from None
    return made


def receive(link: socket.socket) -> tuple[bytes, int, tuple[str, int]] | None:
    """The next datagram, when it arrived [ns, wall clock] and from where; None where none waits."""
    try:
        data, ancillary, _, sender = link.recvmsg(wire.LARGEST, 64)
    except BlockingIOError:
        return None
    except ConnectionError:  # nobody listened at the other end; the next try is as good
        return b"", time.time_ns(), ("", 0)
    for level, kind, content in ancillary:
        if level == socket.SOL_SOCKET and kind == SO_TIMESTAMPNS and len(content) >= TIMESPEC.size:
            seconds, nanoseconds = TIMESPEC.unpack_from(content)
            return data, seconds * SECOND + nanoseconds, sender
    return data, time.time_ns(), sender


class LinkEnd:
    """What both ends have: a socket, a shared key (empty for none), a session, and counts of what came."""

    def __init__(self, address: str, port: int, key: bytes, clock: Callable[[], float]) -> None:
        self.key = key
        self.session: Session | None = None
        self.rejected: Counter[str] = Counter()  # datagrams that were refused or could not be sent, by reason
        self.received = self.sessions = 0
        self._clock = clock
        self._socket = udp_socket(address, port)

    def _send(self, data: bytes, to: tuple[str, int]) -> None:
        try:
            self._socket.sendto(data, to)
        except OSError:  # a link that is down or full: the other end's watchdog is what counts
            self.rejected["unsent"] += 1

    def close(self) -> None:
        """Give the socket back."""
        self._socket.close()


class Host(LinkEnd):
    """One link to one target.

    Parameters
    ----------
    address, port : of the target.
    local_address : of this machine.
    key : shared, empty for none.
    clock : steady time [s].
    """

    def __init__(
        self, address: str, port: int, local_address: str, key: bytes, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self.target = (numeric(address), port)
        super().__init__(local_address, 0, key, clock)
        self.lost = self.late = 0
        self._nonce = b""
        self._asked = -HELLO_PERIOD
        self._heard = 0.0

    def receive(self, timeout: float) -> tuple[wire.TableDatagram, int] | None:
        """The next new measurement and when it arrived [ns, wall clock]; None after `timeout` [s] without one."""
        now = self._clock()
        if self.session is None or now - self._heard > SILENCE:
            self._ask(now)
        for _ in range(MOST_AT_ONCE):
            came = receive(self._socket)
            if came is None:
                if not select.select([self._socket], [], [], timeout)[0]:
                    return None
                continue
            data, arrival, sender = came
            try:
                measurement = self._take(data, sender)
            except wire.Rejected as rejected:
                self.rejected[str(rejected)] += 1
                continue
            if measurement is not None:
                return measurement, arrival
        return None

    def _ask(self, now: float) -> None:
        if now - self._asked >= HELLO_PERIOD:
            if not self._nonce:
                self._nonce = secrets.token_bytes(wire.NONCE_SIZE)
            self._asked = now
            self._send(wire.hello(self.key, self._nonce), self.target)

    def _take(self, data: bytes, sender: tuple[str, int]) -> wire.TableDatagram | None:
        if not data and not sender[0]:
            return None
        head = wire.header(data)
        if head.kind == wire.WELCOME:
            self._welcomed(data, head.session)
            return None
        if head.kind != wire.MEASUREMENT:
            raise wire.Rejected("kind")
        session = self.session
        if session is None or head.session != session.number:
            raise wire.Rejected("session")
        measurement = wire.read_measurement(session.key, data)
        newest = session.window.newest
        if not session.window.accept(measurement.sequence):
            raise wire.Rejected("replay")
        self._heard = self._clock()
        self.received += 1
        if measurement.sequence < newest:
            self.late += 1
            self.lost -= 1
            return None
        self.lost += measurement.sequence - newest - 1
        return measurement

    def _welcomed(self, data: bytes, number: int) -> None:
        host_nonce, target_nonce = wire.read_welcome(self.key, data)
        if not self._nonce or host_nonce != self._nonce:
            raise wire.Rejected("session")
        self._nonce = b""
        self.session = Session(number, session_key(self.key, host_nonce, target_nonce))
        self.sessions += 1
        self._heard = self._clock()
        self.send(0, 0.0, 0, 0)  # the first command begins the session

    def send(self, answers: int, u: float, mode: int, flags: int) -> None:
        """A command in answer to a measurement: raw value of the valve, stage asked for, flags."""
        session = self.session
        if session is not None:
            message = wire.Command(session.number, session.next_sequence(), answers, u, mode, flags)
            self._send(wire.command(session.key, message), self.target)


MOST_OFFERED = 4  # sessions that were offered and have not begun
BUSY = 0.1  # [s] after its newest command a session is not given up for another


class TargetLink(LinkEnd):
    """One socket, one session at a time.

    Parameters
    ----------
    address, port : to listen on; port 0 takes a free one.
    key : shared, empty for none.
    clock : steady time [s].
    """

    def __init__(self, address: str, port: int, key: bytes, clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__(address, port, key, clock)
        self.peer: tuple[str, int] = ("", 0)
        self._offered: OrderedDict[int, tuple[Session, bytes, bytes]] = OrderedDict()
        self._heard = -BUSY
        self.address: tuple[str, int] = self._socket.getsockname()

    def commands(self) -> list[tuple[wire.Command, int]]:
        """Every new command that has come, in order of arrival, and when it did [ns, wall clock]."""
        found = []
        for _ in range(MOST_AT_ONCE):
            came = receive(self._socket)
            if came is None:
                break
            data, arrival, sender = came
            if not sender[0]:
                continue
            try:
                command = self._take(data, sender)
            except wire.Rejected as rejected:
                self.rejected[str(rejected)] += 1
                continue
            if command is not None:
                found.append((command, arrival))
        return found

    def _take(self, data: bytes, sender: tuple[str, int]) -> wire.Command | None:
        head = wire.header(data)
        if head.kind == wire.HELLO:
            self._offer(data, sender)
            return None
        if head.kind != wire.COMMAND:
            raise wire.Rejected("kind")
        session = self.session
        begins = session is None or head.session != session.number
        if begins:
            if head.session not in self._offered or self._busy():
                raise wire.Rejected("session")
            session = self._offered[head.session][0]
        assert session is not None
        command = wire.read_command(session.key, data)
        if not session.window.accept(command.sequence):
            raise wire.Rejected("replay")
        if begins:
            self.session, self.peer = session, sender
            self.sessions += 1
            self._offered.clear()
        self._heard = self._clock()
        self.received += 1
        return command if command.sequence == session.window.newest else None

    def _busy(self) -> bool:
        return self.session is not None and self._clock() - self._heard < BUSY

    def _offer(self, data: bytes, sender: tuple[str, int]) -> None:
        nonce = wire.read_hello(self.key, data)
        if self._busy():
            raise wire.Rejected("session")
        for number, (_, host_nonce, target_nonce) in self._offered.items():
            if host_nonce == nonce:  # asked again: the answer was lost
                self._send(wire.welcome(self.key, number, nonce, target_nonce), sender)
                return
        own = secrets.token_bytes(wire.NONCE_SIZE)
        number = int.from_bytes(own[:8], "little")
        self._offered[number] = (Session(number, session_key(self.key, nonce, own)), nonce, own)
        while len(self._offered) > MOST_OFFERED:
            self._offered.popitem(last=False)
        self._send(wire.welcome(self.key, number, nonce, own), sender)

    def send(self, *fields: float) -> int:
        """A measurement: the fields of `wire.TableDatagram` after the sequence. Returns its sequence, 0 if unsent."""
        session = self.session
        if session is None:
            return 0
        message = wire.TableDatagram(session.number, session.next_sequence(), *fields)  # type: ignore[arg-type]
        self._send(wire.measurement(session.key, message), self.peer)
        return message.sequence
