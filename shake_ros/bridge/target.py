"""The target's end of the link: offers sessions, takes each command once, sends measurements."""

from __future__ import annotations

import secrets
import time
from collections import Counter, OrderedDict
from collections.abc import Callable

from shake_ros.bridge import wire
from shake_ros.bridge.host import MOST_AT_ONCE, receive, udp_socket
from shake_ros.bridge.session import Session, new_counts, session_key

MOST_OFFERED = 4  # sessions that were offered and have not begun
BUSY = 0.1  # [s] after its newest command a session is not given up for another


class TargetLink:
    """One socket, one session at a time.

    Parameters
    ----------
    address, port : to listen on; port 0 takes a free one. key : shared, empty for none. clock : steady time [s].
    """

    def __init__(self, address: str, port: int, key: bytes, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self.key = key
        self.session: Session | None = None
        self.peer: tuple[str, int] = ("", 0)
        self.rejected: Counter[str] = new_counts()
        self.received = 0
        self.sessions = 0
        self._offered: OrderedDict[int, tuple[Session, bytes, bytes]] = OrderedDict()
        self._heard = -BUSY
        self._socket = udp_socket(address, port)
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

    def _send(self, data: bytes, to: tuple[str, int]) -> None:
        try:
            self._socket.sendto(data, to)
        except OSError:  # a link that is down or full
            self.rejected["unsent"] += 1

    def close(self) -> None:
        """Give the socket back."""
        self._socket.close()
