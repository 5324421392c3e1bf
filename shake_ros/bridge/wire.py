"""Datagrams between host (the node `hardware_bridge`) and target computer; docs/reference/datagrams.md is the contract.

Fixed layout, little endian. Each datagram ends with the first 16 bytes of HMAC-SHA256 over all bytes before. Nothing
behind the header is looked at before the tag is right.

`Session` says who may speak, and takes each datagram once.

Host and target share a secret key. The host sends a nonce, the target answers with the session's number and a nonce of
its own; both derive the session's key from the two, so nothing that was recorded in one session is worth anything in
the next. A session begins with the first command under its key: a repeated hello ends nothing.
"""

from __future__ import annotations

import hmac
import ipaddress
import os
import secrets
import socket
import stat
import struct
from pathlib import Path
from typing import NamedTuple

from shake_ros.quantities import ShakeError

MAGIC = b"SHK1"
VERSION = 1
HELLO, WELCOME, MEASUREMENT, COMMAND = range(1, 5)
TAG_SIZE = 16
NONCE_SIZE = 16
LARGEST = 512  # a datagram of this size or more is none of ours
HEADER = struct.Struct("<4sBBHQQ")  # magic, version, kind, size, session, sequence
HELLO_BODY = struct.Struct("<16s")  # nonce of the host
WELCOME_BODY = struct.Struct("<16s16s")  # nonce of the host, nonce of the target
MEASUREMENT_BODY = struct.Struct("<q6dQdII")
COMMAND_BODY = struct.Struct("<QdBBHI")
BODIES = {HELLO: HELLO_BODY, WELCOME: WELCOME_BODY, MEASUREMENT: MEASUREMENT_BODY, COMMAND: COMMAND_BODY}
SIZES = {kind: HEADER.size + body.size + TAG_SIZE for kind, body in BODIES.items()}
LAYOUTS = {kind: struct.Struct(HEADER.format + body.format[1:]) for kind, body in BODIES.items()}

# status bits of a measurement
STAGE_MASK = 0x3
HOLDING, TRIPPED, STALE = 0x4, 0x8, 0x10
# flags of a command
RESET, AT_ONCE = 0x1, 0x2


class Rejected(Exception):
    """A datagram that is not taken; the argument is the reason under which it is counted."""


REASONS = ("size", "magic", "version", "kind", "tag", "session", "replay", "content")


class Header(NamedTuple):
    """What every datagram begins with."""

    kind: int
    session: int
    sequence: int


class TableDatagram(NamedTuple):
    """Target → host, once a sample. Raw channel values, in the unit of each channel."""

    session: int
    sequence: int
    target_time: int  # [ns] of the target's own clock
    position: float
    acceleration: float
    pressure_a: float
    pressure_b: float
    pressure_supply: float
    spool: float
    answered: int  # sequence of the newest command that was taken, 0 before the first
    acting: float  # the command that acts
    status: int
    trip: int  # number of the cause in force, 0 for none


class Command(NamedTuple):
    """Host → target, in answer to a measurement."""

    session: int
    sequence: int
    answers: int  # sequence of the measurement
    u: float
    mode: int  # stage that the host asks for: 0 off, 1 low pressure, 2 high pressure, 3 run
    flags: int


def tag(key: bytes, data: bytes) -> bytes:
    """The authentication tag of `data`."""
    return hmac.digest(key, data, "sha256")[:TAG_SIZE]


def _seal(key: bytes, kind: int, session: int, sequence: int, *fields: object) -> bytes:
    data = LAYOUTS[kind].pack(MAGIC, VERSION, kind, SIZES[kind], session, sequence, *fields)
    return data + tag(key, data)


def hello(key: bytes, host_nonce: bytes) -> bytes:
    """The host asks for a session; sealed with the shared key."""
    return _seal(key, HELLO, 0, 0, host_nonce)


def welcome(key: bytes, session: int, host_nonce: bytes, target_nonce: bytes) -> bytes:
    """The target offers a session; sealed with the shared key."""
    return _seal(key, WELCOME, session, 0, host_nonce, target_nonce)


def measurement(key: bytes, message: TableDatagram) -> bytes:
    """A measurement, sealed with the session's key."""
    return _seal(key, MEASUREMENT, *message)


def command(key: bytes, message: Command) -> bytes:
    """A command, sealed with the session's key."""
    return _seal(key, COMMAND, *message, 0, 0)


def header(data: bytes) -> Header:
    """The header of a datagram whose size belongs to its kind; raises Rejected."""
    if not HEADER.size + TAG_SIZE <= len(data) < LARGEST:
        raise Rejected("size")
    magic, version, kind, size, session, sequence = HEADER.unpack_from(data)
    if magic != MAGIC:
        raise Rejected("magic")
    if version != VERSION:
        raise Rejected("version")
    if kind not in SIZES:
        raise Rejected("kind")
    if len(data) != SIZES[kind] or size != SIZES[kind]:
        raise Rejected("size")
    return Header(kind, session, sequence)


def check_tag(key: bytes, data: bytes) -> None:
    """Raise Rejected where the tag is not that of the key."""
    if not hmac.compare_digest(tag(key, data[:-TAG_SIZE]), data[-TAG_SIZE:]):
        raise Rejected("tag")


def read_hello(key: bytes, data: bytes) -> bytes:
    """Nonce of the host."""
    check_tag(key, data)
    nonce: bytes = HELLO_BODY.unpack_from(data, HEADER.size)[0]
    return nonce


def read_welcome(key: bytes, data: bytes) -> tuple[bytes, bytes]:
    """Nonces of host and target."""
    check_tag(key, data)
    host_nonce, target_nonce = WELCOME_BODY.unpack_from(data, HEADER.size)
    return host_nonce, target_nonce


def read_measurement(key: bytes, data: bytes) -> TableDatagram:
    """A measurement whose tag is right; raises Rejected."""
    check_tag(key, data)
    fields = LAYOUTS[MEASUREMENT].unpack_from(data)
    return TableDatagram(*fields[4:])


def read_command(key: bytes, data: bytes) -> Command:
    """A command whose tag is right; raises Rejected where its mode or its empty fields hold anything else."""
    check_tag(key, data)
    fields = LAYOUTS[COMMAND].unpack_from(data)
    if fields[8] > 3 or fields[10] or fields[11]:
        raise Rejected("content")
    return Command(*fields[4:10])


NO_KEY = b""
SHORTEST_KEY = 16
WINDOW = 64  # sequences behind the newest that may still come, once each
CONTEXT = b"shake_ros session 1"


def read_key(path: Path) -> bytes:
    """The shared key of a file of hexadecimal digits.

    Raises
    ------
    ShakeError : unreadable, readable by others than its owner, not hexadecimal or shorter than 16 bytes.
    """
    try:
        with path.open("rb") as file:
            mode = os.fstat(file.fileno()).st_mode
            content = file.read(4096)
    except OSError as error:
        raise ShakeError(f"{path}: cannot be read ({error.strerror})") from None
    if mode & (stat.S_IRWXG | stat.S_IRWXO):
        raise ShakeError(f"{path}: mode {stat.S_IMODE(mode):03o} lets others read the key; chmod 600 it")
    try:
        key = bytes.fromhex(content.decode("ascii").strip())
    except ValueError:
        raise ShakeError(f"{path}: not a key of hexadecimal digits") from None
    if len(key) < SHORTEST_KEY:
        raise ShakeError(f"{path}: {len(key)} bytes are not a key, {SHORTEST_KEY} are needed")
    return key


def write_key(path: Path) -> None:
    """A new random key of 32 bytes in a file that only its owner may read; an existing file is an error."""
    try:
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    except OSError as error:
        raise ShakeError(f"{path}: cannot be written ({error.strerror})") from None
    with os.fdopen(descriptor, "w") as file:
        file.write(secrets.token_hex(32) + "\n")


def key_for(key_file: str, *addresses: str) -> bytes:
    """The key of a file; without a file no key, which is for loopback addresses only.

    Raises
    ------
    ShakeError : an address beyond this machine without a key, or none that can be found.
    """
    if key_file:
        return read_key(Path(key_file).expanduser())
    for address in addresses:
        if not ipaddress.ip_address(numeric(address)).is_loopback:
            raise ShakeError(f"address {address}: beyond this machine only with a key file")
    return NO_KEY


def numeric(address: str) -> str:
    """The IPv4 address of a name; raises ShakeError where there is none."""
    try:
        return socket.gethostbyname(address)
    except (OSError, UnicodeError):
        raise ShakeError(f"address {address!r}: not found") from None


def session_key(key: bytes, host_nonce: bytes, target_nonce: bytes) -> bytes:
    """The key of a session: HMAC-SHA256 of its two nonces."""
    return hmac.digest(key, CONTEXT + host_nonce + target_nonce, "sha256")


class ReplayWindow:
    """Whether a sequence number is new.

    >>> window = ReplayWindow()
    >>> [window.accept(n) for n in (1, 3, 2, 3, 100, 36, 37, 37)]
    [True, True, True, False, True, False, True, False]
    """

    def __init__(self) -> None:
        self.newest = 0
        self._seen = 0  # bit i: newest − i has come

    def accept(self, sequence: int) -> bool:
        """True once for each sequence from 1 on, unless it is WINDOW or more behind the newest."""
        ahead = sequence - self.newest
        if ahead > 0:
            self._seen = ((self._seen << ahead) | 1) & (2**WINDOW - 1) if ahead < WINDOW else 1
            self.newest = sequence
            return True
        if sequence < 1 or -ahead >= WINDOW or self._seen >> -ahead & 1:
            return False
        self._seen |= 1 << -ahead
        return True


class Session:
    """One session as either end keeps it."""

    def __init__(self, number: int, key: bytes) -> None:
        self.number = number
        self.key = key
        self.sent = 0
        self.window = ReplayWindow()

    def next_sequence(self) -> int:
        """Sequence of the next datagram to send, from 1 on."""
        self.sent += 1
        return self.sent


# worked datagrams: fixed keys, nonces and values, for whoever writes the other side
WORKED_KEY = bytes(range(32))
HOST_NONCE = bytes(range(0x10, 0x20))
TARGET_NONCE = bytes(range(0xA0, 0xB0))
WORKED_SESSION = int.from_bytes(TARGET_NONCE[:8], "little")
WORKED_MEASUREMENT = TableDatagram(
    WORKED_SESSION, 7, 123_456_789_000, 0.0125, -1.5, 9.5e6, 1.05e7, 2.06e7, 0.03125, 6, 0.05, STAGE_MASK, 0
)
WORKED_COMMAND = Command(WORKED_SESSION, 8, 7, -0.25, 3, 0)


def vectors() -> dict[str, bytes]:
    """Name → bytes of the keys and of one datagram of each kind."""
    key = session_key(WORKED_KEY, HOST_NONCE, TARGET_NONCE)
    return {
        "shared key": WORKED_KEY,
        "hello": hello(WORKED_KEY, HOST_NONCE),
        "welcome": welcome(WORKED_KEY, WORKED_SESSION, HOST_NONCE, TARGET_NONCE),
        "session key": key,
        "measurement": measurement(key, WORKED_MEASUREMENT),
        "command": command(key, WORKED_COMMAND),
    }
