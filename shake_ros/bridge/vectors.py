"""Worked datagrams: fixed keys, nonces and values, for whoever writes the other side."""

from __future__ import annotations

from shake_ros.bridge import wire
from shake_ros.bridge.session import session_key

KEY = bytes(range(32))
HOST_NONCE = bytes(range(0x10, 0x20))
TARGET_NONCE = bytes(range(0xA0, 0xB0))
SESSION = int.from_bytes(TARGET_NONCE[:8], "little")
MEASUREMENT = wire.TableDatagram(
    SESSION, 7, 123_456_789_000, 0.0125, -1.5, 9.5e6, 1.05e7, 2.06e7, 0.03125, 6, 0.05, wire.STAGE_MASK, 0
)
COMMAND = wire.Command(SESSION, 8, 7, -0.25, 3, 0)


def vectors() -> dict[str, bytes]:
    """Name → bytes of the keys and of one datagram of each kind."""
    key = session_key(KEY, HOST_NONCE, TARGET_NONCE)
    return {
        "shared key": KEY,
        "hello": wire.hello(KEY, HOST_NONCE),
        "welcome": wire.welcome(KEY, SESSION, HOST_NONCE, TARGET_NONCE),
        "session key": key,
        "measurement": wire.measurement(key, MEASUREMENT),
        "command": wire.command(key, COMMAND),
    }
