"""MCAP files read from front to back, so that a file that ends anywhere still gives all that it holds.

A recorder that was killed leaves no summary and no footer; a disk that was full leaves half a chunk. The
scan needs neither summary nor index: it walks the records, skips a chunk whose checksum is wrong, and stops
where the file ends, each time saying so. Only one chunk is in memory at a time.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

import lz4.frame  # type: ignore[import-untyped]
import zstandard

MAGIC = b"\x89MCAP0\r\n"
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX = range(1, 9)
STATISTICS, SUMMARY_OFFSET, DATA_END = 0x0B, 0x0E, 0x0F
FOOTER_SIZE = 9 + 20 + len(MAGIC)
LARGEST_RECORD = 1 << 30
NO_FOOTER = "ends without a footer (a recording that was killed or cut)"

_LENGTH = struct.Struct("<Q")
_RECORD = struct.Struct("<BQ")
_MESSAGE = struct.Struct("<HIQQ")
_CHUNK = struct.Struct("<QQQI")
_STRING = struct.Struct("<I")
_PAIR = struct.Struct("<HH")
_COUNT = struct.Struct("<HQ")

Damage = Callable[[str], None]


@dataclass(frozen=True)
class Schema:
    """A message type: name such as sensor_msgs/msg/Imu, encoding such as ros2msg, text of its definition."""

    name: str
    encoding: str
    data: bytes


@dataclass(frozen=True)
class Channel:
    """A topic of one file. `type` is empty where the file names no schema for it."""

    number: int
    topic: str
    type: str
    encoding: str
    schema: Schema
    metadata: dict[str, str] = field(default_factory=dict)


class MalformedError(Exception):
    """A record that cannot be what its header says it is."""


def _string(data: bytes, at: int) -> tuple[str, int]:
    raw, end = _bytes(data, at)
    return raw.decode("utf-8", "replace"), end


def _bytes(data: bytes, at: int) -> tuple[bytes, int]:
    (length,) = _STRING.unpack_from(data, at)
    end = at + 4 + length
    if end > len(data):
        raise MalformedError("a text runs over the end of its record")
    return data[at + 4 : end], end


def _schema(data: bytes) -> tuple[int, Schema]:
    (number,) = struct.unpack_from("<H", data)
    name, at = _string(data, 2)
    encoding, at = _string(data, at)
    text, _ = _bytes(data, at)
    return number, Schema(name, encoding, text)


def _channel(data: bytes, schemas: dict[int, Schema]) -> Channel:
    number, schema_number = _PAIR.unpack_from(data)
    topic, at = _string(data, 4)
    encoding, at = _string(data, at)
    pairs, _ = _bytes(data, at)
    metadata, at = {}, 0
    while at < len(pairs):
        key, at = _string(pairs, at)
        metadata[key], at = _string(pairs, at)
    schema = schemas.get(schema_number, Schema("", "", b""))
    return Channel(number, topic, schema.name, encoding, schema, metadata)


def _chunk(data: bytes) -> bytes:
    """The records inside a chunk; raises MalformedError where size, checksum or compression is wrong."""
    _, _, size, checksum = _CHUNK.unpack_from(data)
    compression, at = _string(data, _CHUNK.size)
    (stored,) = _LENGTH.unpack_from(data, at)
    packed = data[at + 8 : at + 8 + stored]
    if len(packed) != stored or size > LARGEST_RECORD:
        raise MalformedError("a chunk's size is wrong")
    try:
        if compression == "":
            records = packed
        elif compression == "zstd":
            records = zstandard.ZstdDecompressor().stream_reader(packed).read(size)
        elif compression == "lz4":
            records = lz4.frame.LZ4FrameDecompressor().decompress(packed, size)
        else:
            raise MalformedError(f"a chunk's compression '{compression}' is not known")
    except (zstandard.ZstdError, RuntimeError, MemoryError) as error:
        raise MalformedError(f"a chunk cannot be decompressed ({error})") from None
    if len(records) != size or (checksum and zlib.crc32(records) != checksum):
        raise MalformedError("a chunk's checksum is wrong")
    return records


class McapFile:
    """One .mcap file.

    Parameters
    ----------
    path : the file; it is opened anew for every pass.
    damage : called with a sentence for each place that cannot be read.
    """

    def __init__(self, path: Path, damage: Damage) -> None:
        self.path = path
        self.channels: dict[int, Channel] = {}
        self.counts: dict[int, int] = {}
        self.complete = False
        self._damage = damage
        self._schemas: dict[int, Schema] = {}

    def survey(self) -> None:
        """Fill `channels` and `counts` from the summary, or from a pass over the file where there is none."""
        try:
            counted = self._read_summary()
        except (struct.error, MalformedError, OSError):
            counted = self.complete = False
        if not self.complete:
            self._damage(f"{self.path.name}: {NO_FOOTER}")
        if counted:
            return
        self.channels.clear()
        self._schemas.clear()
        counts: dict[int, int] = {}
        for channel, _, _ in self.messages(lambda channel: True):
            counts[channel.number] = counts.get(channel.number, 0) + 1
        self.counts = counts

    def messages(self, wanted: Callable[[Channel], bool]) -> Iterator[tuple[Channel, int, bytes]]:
        """Channel, time of receipt [ns] and bytes of each message of the wanted channels, in stored order."""
        chosen: dict[int, Channel | None] = {}
        with self.path.open("rb") as file:
            for records in self._blocks(file):
                yield from self._unpack(records, wanted, chosen)

    def _unpack(
        self, records: bytes, wanted: Callable[[Channel], bool], chosen: dict[int, Channel | None]
    ) -> Iterator[tuple[Channel, int, bytes]]:
        try:
            yield from self._records(records, wanted, chosen)
        except (struct.error, MalformedError) as error:
            self._damage(f"{self.path.name}: a record cannot be read ({error}); the rest of its chunk is left out")

    def _records(
        self, records: bytes, wanted: Callable[[Channel], bool], chosen: dict[int, Channel | None]
    ) -> Iterator[tuple[Channel, int, bytes]]:
        at, end = 0, len(records)
        while at < end:
            code, length = _RECORD.unpack_from(records, at)
            start = at + 9
            at = start + length
            if at > end:
                raise MalformedError("a record runs over the end of its chunk")
            if code == MESSAGE:
                number, _, received, _ = _MESSAGE.unpack_from(records, start)
                if number not in chosen:
                    channel = self.channels.get(number)
                    if channel is None:
                        self._damage(f"{self.path.name}: messages of an undeclared channel {number} are left out")
                    chosen[number] = channel if channel is not None and wanted(channel) else None
                channel = chosen[number]
                if channel is not None:
                    yield channel, received, records[start + _MESSAGE.size : at]
            elif code == SCHEMA:
                number, schema = _schema(records[start:at])
                self._schemas[number] = schema
            elif code == CHANNEL:
                declared = _channel(records[start:at], self._schemas)
                self.channels[declared.number] = declared

    def _blocks(self, file: BinaryIO) -> Iterator[bytes]:
        """Runs of whole records: the content of each chunk, or a record that stands outside of chunks."""
        name = self.path.name
        if file.read(len(MAGIC)) != MAGIC:
            self._damage(f"{name}: does not begin as an MCAP file")
            return
        while True:
            head = file.read(9)
            if len(head) < 9:
                self._damage(f"{name}: {NO_FOOTER}")
                return
            code, length = _RECORD.unpack(head)
            if code in (DATA_END, FOOTER):
                return
            position = file.tell()
            body = file.read(length) if length <= LARGEST_RECORD else b""
            if len(body) < length:
                self._damage(f"{name}: ends inside a record at byte {position}; what precedes it is kept")
                return
            if code == CHUNK:
                try:
                    yield _chunk(body)
                except (MalformedError, struct.error) as error:
                    self._damage(f"{name}: {error}, at byte {position}; its messages are left out")
            elif code in (SCHEMA, CHANNEL, MESSAGE):
                yield head + body

    def _read_summary(self) -> bool:
        """Channels and counts from the end of the file; false where there is no footer or it counts nothing."""
        with self.path.open("rb") as file:
            size = file.seek(0, 2)
            if size < FOOTER_SIZE + len(MAGIC):
                return False
            file.seek(size - FOOTER_SIZE)
            footer = file.read(FOOTER_SIZE)
            if footer[0] != FOOTER or footer[-len(MAGIC) :] != MAGIC:
                return False
            self.complete = True
            (start,) = _LENGTH.unpack_from(footer, 9)
            if not 0 < start < size - FOOTER_SIZE:
                return False
            file.seek(start)
            summary = file.read(size - FOOTER_SIZE - start)
        at, counted = 0, False
        while at < len(summary):
            code, length = _RECORD.unpack_from(summary, at)
            body = summary[at + 9 : at + 9 + length]
            at += 9 + length
            if code == SCHEMA:
                number, schema = _schema(body)
                self._schemas[number] = schema
            elif code == CHANNEL:
                channel = _channel(body, self._schemas)
                self.channels[channel.number] = channel
            elif code == STATISTICS:
                counted = True
                (length,) = _STRING.unpack_from(body, 42)
                self.counts = dict(_COUNT.iter_unpack(body[46 : 46 + length]))
        return counted and bool(self.channels)
