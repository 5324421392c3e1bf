"""MCAP files written so that a kill at any moment costs less than a second.

Messages are gathered in chunks of 64 KiB; a chunk is handed to the operating system, complete with checksum and
index, when it is full or when `flush` is called. What the operating system has survives SIGKILL. Index entries are
kept packed (about 100 bytes a chunk), so memory stays flat over hours.
"""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import zstandard

from shake_ros.data.recordings import mcap_reader as codes

CHUNK_SIZE = 64 * 1024
PROFILE, LIBRARY = "ros2", "shake_ros"

_RECORD = struct.Struct("<BQ")
_MESSAGE = struct.Struct("<BQHIQQ")
_ENTRY = struct.Struct("<QQ")


def _text(value: str | bytes) -> bytes:
    raw = value.encode() if isinstance(value, str) else value
    return struct.pack("<I", len(raw)) + raw


def _record(code: int, body: bytes) -> bytes:
    return _RECORD.pack(code, len(body)) + body


class McapWriter:
    """One .mcap file being written.

    Parameters
    ----------
    path : file, which must not exist.
    compression : "zstd" or "" for none.

    Attributes
    ----------
    counts : messages of each channel so far.
    first, last : earliest and latest time of receipt [ns].
    """

    def __init__(self, path: Path, compression: str = "") -> None:
        self.counts: dict[int, int] = {}
        self.first, self.last = 2**63 - 1, 0
        self._compressor = zstandard.ZstdCompressor(level=1) if compression == "zstd" else None
        self._compression = compression
        self._file = path.open("xb", buffering=0)
        self._schemas: list[bytes] = []
        self._channels: list[bytes] = []
        self._chunk = bytearray()
        self._entries: dict[int, bytearray] = {}
        self._span = (2**63 - 1, 0)
        self._chunk_index = bytearray()
        self._chunks = 0
        self._position = 0
        self._put(codes.MAGIC + _record(codes.HEADER, _text(PROFILE) + _text(LIBRARY)))

    def add_schema(self, name: str, encoding: str, data: bytes) -> int:
        """Declare a message type; returns its number."""
        number = len(self._schemas) + 1
        record = _record(codes.SCHEMA, struct.pack("<H", number) + _text(name) + _text(encoding) + _text(data))
        self._schemas.append(record)
        self._put(record)
        return number

    def add_channel(self, topic: str, schema: int, metadata: dict[str, str]) -> int:
        """Declare a topic; returns its number."""
        number = len(self._channels) + 1
        pairs = b"".join(_text(key) + _text(value) for key, value in metadata.items())
        head = struct.pack("<HH", number, schema) + _text(topic) + _text("cdr")
        record = _record(codes.CHANNEL, head + _text(pairs))
        self._channels.append(record)
        self.counts[number] = 0
        self._put(record)
        return number

    def write(self, channel: int, received: int, data: bytes, published: int | None = None) -> None:
        """Append a serialised message, received and published at those times [ns]."""
        sequence = self.counts[channel]
        entries = self._entries.get(channel)
        if entries is None:
            entries = self._entries[channel] = bytearray()
        entries += _ENTRY.pack(received, len(self._chunk))
        stamp = received if published is None else published
        self._chunk += _MESSAGE.pack(codes.MESSAGE, 22 + len(data), channel, sequence & 0xFFFFFFFF, received, stamp)
        self._chunk += data
        self.counts[channel] = sequence + 1
        first, last = self._span
        self._span = (received if received < first else first, received if received > last else last)
        if len(self._chunk) >= CHUNK_SIZE:
            self.flush()

    def flush(self) -> None:
        """Hand everything so far to the operating system as a complete chunk."""
        if not self._chunk:
            return
        raw = bytes(self._chunk)
        packed = self._compressor.compress(raw) if self._compressor else raw
        first, last = self._span
        head = struct.pack("<QQQI", first, last, len(raw), zlib.crc32(raw)) + _text(self._compression)
        chunk = _record(codes.CHUNK, head + struct.pack("<Q", len(packed)) + packed)
        start, offsets, indexes = self._position, bytearray(), bytearray()
        for channel, entries in self._entries.items():
            offsets += struct.pack("<HQ", channel, start + len(chunk) + len(indexes))
            indexes += _record(codes.MESSAGE_INDEX, struct.pack("<H", channel) + _text(bytes(entries)))
        self._put(chunk + bytes(indexes))
        index = struct.pack("<QQQQ", first, last, start, len(chunk)) + _text(bytes(offsets))
        index += struct.pack("<Q", len(indexes)) + _text(self._compression) + struct.pack("<QQ", len(packed), len(raw))
        self._chunk_index += _record(codes.CHUNK_INDEX, index)
        self._chunks += 1
        self.first, self.last = min(self.first, first), max(self.last, last)
        self._chunk.clear()
        self._entries.clear()
        self._span = (2**63 - 1, 0)

    def close(self) -> None:
        """Write the last chunk, the summary and the footer."""
        if self._file.closed:
            return
        self.flush()
        self._put(_record(codes.DATA_END, struct.pack("<I", 0)))
        total, (first, last) = sum(self.counts.values()), (self.first, self.last)
        if not total:
            first = last = 0
        counts = b"".join(struct.pack("<HQ", number, count) for number, count in self.counts.items())
        sizes = (total, len(self._schemas), len(self._channels), 0, 0, self._chunks, first, last)
        statistics = _record(codes.STATISTICS, struct.pack("<QHIIIIQQ", *sizes) + _text(counts))
        groups = {
            codes.SCHEMA: b"".join(self._schemas),
            codes.CHANNEL: b"".join(self._channels),
            codes.STATISTICS: statistics,
            codes.CHUNK_INDEX: bytes(self._chunk_index),
        }
        start, at, offsets = self._position, self._position, b""
        for code, group in groups.items():
            if group:
                offsets += _record(codes.SUMMARY_OFFSET, struct.pack("<BQQ", code, at, len(group)))
            at += len(group)
        summary = b"".join(groups.values()) + offsets
        footer = _RECORD.pack(codes.FOOTER, 20) + struct.pack("<QQ", start, at)
        checksum = zlib.crc32(footer, zlib.crc32(summary))
        self._put(summary + footer + struct.pack("<I", checksum) + codes.MAGIC)
        self._file.close()

    def abandon(self) -> None:
        """Close the file as it is, without a summary."""
        self._file.close()

    def _put(self, data: bytes) -> None:
        view = memoryview(data)
        while len(view):
            view = view[self._file.write(view) :]
        self._position += len(data)
