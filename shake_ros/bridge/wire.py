"""Datagrams between host (the node `hardware_bridge`) and target computer; docs/reference/datagrams.md is the contract.

Fixed layout, little endian. Each datagram ends with the first 16 bytes of HMAC-SHA256 over all bytes before. Nothing
behind the header is looked at before the tag is right.
"""

from __future__ import annotations

import hmac
import struct
from typing import NamedTuple

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
