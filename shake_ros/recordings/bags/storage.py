"""Storage files of a recording: MCAP, of which a file that ends anywhere still gives all that it holds, and sqlite3.

A killed recorder leaves no summary and no footer; a full disk leaves half a chunk. The scan needs neither summary nor
index: it walks the records, skips a chunk whose checksum is wrong, and stops where the file ends, each time saying so.
Only one chunk is in memory at a time.

Records are parsed by the `mcap` library, but for two things. Its StreamReader takes a short read for a whole record
and gives up at the first damaged one: so the frame of a record (opcode, length) is read here, and a chunk is unpacked
to no more than the size it declares. It also makes an object of every message: 0.34 million messages/s against 1.01
million with the loop of `_messages` (`python -m benchmarks.recordings.recorder`, scan_mcap and scan_ours, quiet core).
"""

from __future__ import annotations

import shutil
import sqlite3
import struct
import tempfile
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import BinaryIO
from urllib.parse import quote

import lz4.frame  # type: ignore[import-untyped]
import zstandard
from mcap import records
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile, McapError
from mcap.opcode import Opcode
from mcap.records import Schema
from mcap.writer import MCAP0_MAGIC

MAGIC = bytes(MCAP0_MAGIC)
SCHEMA, CHANNEL, MESSAGE, CHUNK = int(Opcode.SCHEMA), int(Opcode.CHANNEL), int(Opcode.MESSAGE), int(Opcode.CHUNK)
FOOTER_SIZE = 9 + 20 + len(MAGIC)
LARGEST_RECORD = 1 << 30
NO_FOOTER = "ends without a footer (a recording that was killed or cut)"

_FRAME = struct.Struct("<BQ")
_MESSAGE = struct.Struct("<HIQQ")

Damage = Callable[[str], None]


@dataclass(frozen=True)
class Channel:
    """A topic of one file. `type` is empty where the file names no schema for it."""

    number: int
    topic: str
    type: str
    encoding: str
    schema: records.Schema
    metadata: dict[str, str] = field(default_factory=dict)


class MalformedError(McapError):
    """A record that cannot be what its header says it is."""


UNREADABLE = (McapError, struct.error, ValueError, OverflowError)


class _Body(ReadDataStream):
    """The body of one record: no field reaches over its end, and a text need not be valid UTF-8."""

    def __init__(self, body: bytes) -> None:
        super().__init__(BytesIO(body))

    def read(self, length: int) -> bytes:
        data: bytes = super().read(length)
        if len(data) < length:
            raise EndOfFile
        return data

    def read_prefixed_string(self) -> str:
        return self.read(self.read4()).decode("utf-8", "replace")


def _frames(file: BinaryIO) -> Iterator[tuple[int, bytes, bytes]]:
    """Position, frame and body of each record up to the end of its section; MalformedError where the file ends."""
    while True:
        frame = file.read(_FRAME.size)
        if len(frame) < _FRAME.size:
            raise MalformedError(NO_FOOTER)
        code, length = _FRAME.unpack(frame)
        if code in (Opcode.DATA_END, Opcode.FOOTER):
            return
        position = file.tell()
        body = file.read(length) if length <= LARGEST_RECORD else b""
        if len(body) < length:
            raise MalformedError(f"ends inside a record at byte {position}; what precedes it is kept")
        yield position, frame, body


def _unpacked(body: bytes) -> bytes:
    """The records inside a chunk; MalformedError where size, checksum or compression is wrong."""
    try:
        chunk = records.Chunk.read(_Body(body))
        size, packed = chunk.uncompressed_size, chunk.data
        if size > LARGEST_RECORD:
            raise EndOfFile
        if chunk.compression == "zstd":
            packed = zstandard.ZstdDecompressor().stream_reader(packed).read(size)
        elif chunk.compression == "lz4":
            packed = lz4.frame.LZ4FrameDecompressor().decompress(packed, size)
        elif chunk.compression:
            raise MalformedError(f"a chunk's compression '{chunk.compression}' is not known")
    except (EndOfFile, struct.error, OverflowError, UnicodeDecodeError):
        raise MalformedError("a chunk's size is wrong") from None
    except (zstandard.ZstdError, RuntimeError, MemoryError) as error:
        raise MalformedError(f"a chunk cannot be decompressed ({error})") from None
    if len(packed) != size or (chunk.uncompressed_crc and zlib.crc32(packed) != chunk.uncompressed_crc):
        raise MalformedError("a chunk's checksum is wrong")
    return packed


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
        self._schemas: dict[int, records.Schema] = {}

    def survey(self) -> None:
        """Fill `channels` and `counts` from the summary, or from a pass over the file where there is none."""
        try:
            counted = self._read_summary()
        except (*UNREADABLE, OSError):
            counted = self.complete = False
        if not self.complete:
            self._damage(f"{self.path.name}: {NO_FOOTER}")
        if counted:
            return
        self.channels.clear()
        self._schemas.clear()
        counts: dict[int, int] = {}
        for channel, _, _ in self.messages(lambda _: True):
            counts[channel.number] = counts.get(channel.number, 0) + 1
        self.counts = counts

    def messages(self, wanted: Callable[[Channel], bool]) -> Iterator[tuple[Channel, int, bytes]]:
        """Channel, time of receipt [ns] and bytes of each message of the wanted channels, in stored order."""
        chosen: dict[int, Channel | None] = {}
        with self.path.open("rb") as file:
            for block in self._blocks(file):
                try:
                    yield from self._messages(block, wanted, chosen)
                except UNREADABLE as error:
                    reason = f"a record cannot be read ({error}); the rest of its chunk is left out"
                    self._damage(f"{self.path.name}: {reason}")

    def _blocks(self, file: BinaryIO) -> Iterator[bytes]:
        """Runs of whole records: the content of each chunk, or a record that stands outside of chunks."""
        name = self.path.name
        if file.read(len(MAGIC)) != MAGIC:
            self._damage(f"{name}: does not begin as an MCAP file")
            return
        try:
            for position, frame, body in _frames(file):
                if frame[0] == CHUNK:
                    try:
                        yield _unpacked(body)
                    except MalformedError as error:
                        self._damage(f"{name}: {error}, at byte {position}; its messages are left out")
                elif frame[0] in (SCHEMA, CHANNEL, MESSAGE):
                    yield frame + body
        except MalformedError as error:
            self._damage(f"{name}: {error}")

    def _messages(
        self, block: bytes, wanted: Callable[[Channel], bool], chosen: dict[int, Channel | None]
    ) -> Iterator[tuple[Channel, int, bytes]]:
        at, end = 0, len(block)
        while at < end:
            code, length = _FRAME.unpack_from(block, at)
            start = at + _FRAME.size
            at = start + length
            if at > end:
                raise MalformedError("a record runs over the end of its chunk")
            if code == MESSAGE:
                number, _, received, _ = _MESSAGE.unpack_from(block, start)
                if number not in chosen:
                    channel = self.channels.get(number)
                    if channel is None:
                        self._damage(f"{self.path.name}: messages of an undeclared channel {number} are left out")
                    chosen[number] = channel if channel is not None and wanted(channel) else None
                channel = chosen[number]
                if channel is not None:
                    yield channel, received, block[start + _MESSAGE.size : at]
            elif code in (SCHEMA, CHANNEL):
                self._declare(code, block[start:at])

    def _declare(self, code: int, body: bytes) -> None:
        """Take a schema or a channel."""
        if code == SCHEMA:
            schema = records.Schema.read(_Body(body))
            self._schemas[schema.id] = schema
        else:
            channel = records.Channel.read(_Body(body))
            schema = self._schemas.get(channel.schema_id) or records.Schema(0, b"", "", "")
            self.channels[channel.id] = Channel(
                channel.id, channel.topic, schema.name, channel.message_encoding, schema, channel.metadata
            )

    def _read_summary(self) -> bool:
        """Channels and counts from the end of the file; false where there is no footer or it counts nothing."""
        with self.path.open("rb") as file:
            size = file.seek(0, 2)
            if size < FOOTER_SIZE + len(MAGIC):
                return False
            file.seek(size - FOOTER_SIZE)
            end = file.read()
            if end[0] != Opcode.FOOTER or end[-len(MAGIC) :] != MAGIC:
                return False
            self.complete = True
            start = records.Footer.read(_Body(end[_FRAME.size :])).summary_start
            if not 0 < start < size - FOOTER_SIZE:
                return False
            file.seek(start)
            counted = False
            for _, frame, body in _frames(file):
                if frame[0] in (SCHEMA, CHANNEL):
                    self._declare(frame[0], body)
                elif frame[0] == Opcode.STATISTICS:
                    counted = True
                    self.counts = records.Statistics.read(_Body(body)).channel_message_counts
        return counted and bool(self.channels)


SQLITE_MAGIC = b"SQLite format 3\0"
UNSIGNED = 2**64 - 1  # a time before 1970 takes the form that it has in an .mcap file


class SqliteFile:
    """One .db3 file; the same face as `McapFile`.

    A write-ahead log beside the file (a recorder that was killed) is part of the recording: both are then read
    from a copy, because SQLite would otherwise have to write into the folder of the recording.
    """

    def __init__(self, path: Path, damage: Damage) -> None:
        self.path = path
        self.channels: dict[int, Channel] = {}
        self.counts: dict[int, int] = {}
        self.complete = True
        self._damage = damage
        self._copy: tempfile.TemporaryDirectory[str] | None = None

    def _connect(self) -> sqlite3.Connection:
        log = self.path.with_name(self.path.name + "-wal")
        if log.is_file() and log.stat().st_size and self._copy is None:
            self._copy = tempfile.TemporaryDirectory(prefix="shake_ros-")
            for file in (self.path, log):
                shutil.copy(file, self._copy.name)
        if self._copy is not None:
            return sqlite3.connect(Path(self._copy.name, self.path.name))
        return sqlite3.connect(f"file:{quote(str(self.path.absolute()))}?mode=ro&immutable=1", uri=True)

    def survey(self) -> None:
        """Fill `channels` and `counts` from the tables."""
        try:
            connection = self._connect()
            try:
                self._read_tables(connection)
            finally:
                connection.close()
        except (sqlite3.Error, KeyError, ValueError, OverflowError) as error:
            self.complete = False
            self._damage(f"{self.path.name}: {error}")

    def _read_tables(self, connection: sqlite3.Connection) -> None:
        definitions: dict[str, Schema] = {}
        tables = {row[0] for row in connection.execute("SELECT name FROM sqlite_master WHERE type='table'")}
        if not {"topics", "messages"} <= tables:
            raise sqlite3.DatabaseError("not a rosbag2 storage: the tables 'topics' and 'messages' are missing")
        if "message_definitions" in tables:
            rows = connection.execute(
                "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
            )
            definitions = {str(row[0]): Schema(0, str(row[2]).encode(), str(row[1]), str(row[0])) for row in rows}
        columns = [row[1] for row in connection.execute("PRAGMA table_info(topics)")]
        for row in connection.execute("SELECT * FROM topics"):
            topic = {name: "" if value is None else value for name, value in zip(columns, row, strict=False)}
            number, kind = int(topic["id"]), str(topic["type"])
            names = {"offered_qos_profiles": "offered_qos_profiles", "type_description_hash": "topic_type_hash"}
            metadata = {new: str(topic[old]) for old, new in names.items() if old in topic}
            schema = definitions.get(kind, Schema(0, b"", "", kind))
            encoding = str(topic.get("serialization_format", "cdr"))
            self.channels[number] = Channel(number, str(topic["name"]), kind, encoding, schema, metadata)
        rows = connection.execute("SELECT topic_id, count(*) FROM messages GROUP BY topic_id")
        self.counts = {number: count for number, count in rows if number in self.channels}

    def messages(self, wanted: Callable[[Channel], bool]) -> Iterator[tuple[Channel, int, bytes]]:
        """Channel, time of receipt [ns] and bytes of each message of the wanted channels, in stored order."""
        chosen = {number: channel for number, channel in self.channels.items() if wanted(channel)}
        if not chosen:
            return
        marks = ",".join("?" * len(chosen))
        connection = self._connect()
        try:
            rows = connection.execute(
                f"SELECT topic_id, timestamp, data FROM messages WHERE topic_id IN ({marks}) ORDER BY id", list(chosen)
            )
            for number, received, data in rows:
                if isinstance(data, bytes) and isinstance(received, int):
                    yield chosen[number], received & UNSIGNED, data
                else:
                    self._damage(f"{self.path.name}: a row of '{chosen[number].topic}' is not a message")
        except (sqlite3.Error, OverflowError) as error:
            self._damage(f"{self.path.name}: {error}; what precedes it is kept")
        finally:
            connection.close()
