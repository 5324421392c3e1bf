"""rosbag2 folders of MCAP files, written so that a kill at any moment costs less than a second, or made whole.

The metadata have version 8: rosbag2 since Humble, PlotJuggler and Foxglove read it, while version 9 writes the
quality of service as a list that older readers refuse.

Messages are gathered in chunks of 64 KiB; a chunk is handed to the operating system, complete with checksum and
index, when it is full or when `flush` is called. What the operating system has survives SIGKILL. Index entries are
kept packed (about 100 bytes a chunk), so memory stays flat over hours.

Records are laid out by the `mcap` library, but for messages and their index, which are packed here: its Writer makes
objects of both, 0.27 million messages/s against 0.99 million (`python -m benchmarks.recordings.recorder`, pack_mcap and
pack_ours, on a quiet core), and keeps every chunk's index as an object too.
"""

from __future__ import annotations

import json
import os
import shutil
import struct
import tempfile
import zlib
from pathlib import Path
from types import TracebackType
from typing import Any

import yaml
import zstandard
from mcap import records
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC

from shake_ros.quantities import ShakeError
from shake_ros.recordings.bags.bag import METADATA, SUFFIXES, Bag
from shake_ros.recordings.bags.cdr import typestore
from shake_ros.result_folder import writing

CHUNK_SIZE = 64 * 1024
PROFILE, LIBRARY = "ros2", "shake_ros"
NO_SPAN = (2**63 - 1, 0)

_MESSAGE = struct.Struct("<BQHIQQ")
_INDEX = struct.Struct("<BQHI")
_ENTRY = struct.Struct("<QQ")
_MESSAGE_CODE, _INDEX_CODE = int(Opcode.MESSAGE), int(Opcode.MESSAGE_INDEX)


def _packed(*content: records.McapRecord) -> bytes:
    builder = RecordBuilder()
    for record in content:
        record.write(builder)
    data: bytes = builder.end()
    return data


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
        self.first, self.last = NO_SPAN
        self._compressor = zstandard.ZstdCompressor(level=1) if compression == "zstd" else None
        self._compression = compression
        self._file = path.open("xb", buffering=0)
        self._schemas: list[records.Schema] = []
        self._channels: list[records.Channel] = []
        self._chunk = bytearray()
        self._entries: dict[int, bytearray] = {}
        self._span = NO_SPAN
        self._chunk_index = bytearray()
        self._chunks = 0
        self._position = 0
        self._put(MCAP0_MAGIC + _packed(records.Header(PROFILE, LIBRARY)))

    def add_schema(self, name: str, encoding: str, data: bytes) -> int:
        """Declare a message type; returns its number."""
        schema = records.Schema(len(self._schemas) + 1, data, encoding, name)
        self._schemas.append(schema)
        self._put(_packed(schema))
        return schema.id

    def add_channel(self, topic: str, schema: int, metadata: dict[str, str]) -> int:
        """Declare a topic; returns its number."""
        channel = records.Channel(len(self._channels) + 1, topic, "cdr", metadata, schema)
        self._channels.append(channel)
        self.counts[channel.id] = 0
        self._put(_packed(channel))
        return channel.id

    def write(self, channel: int, received: int, data: bytes) -> None:
        """Append a serialised message, received at that time [ns]."""
        sequence = self.counts[channel]
        entries = self._entries.get(channel)
        if entries is None:
            entries = self._entries[channel] = bytearray()
        entries += _ENTRY.pack(received, len(self._chunk))
        self._chunk += _MESSAGE.pack(_MESSAGE_CODE, 22 + len(data), channel, sequence & 0xFFFFFFFF, received, received)
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
        chunk = _packed(records.Chunk(self._compression, packed, last, first, zlib.crc32(raw), len(raw)))
        start, offsets, indexes = self._position, {}, bytearray()
        for channel, entries in self._entries.items():
            offsets[channel] = start + len(chunk) + len(indexes)
            indexes += _INDEX.pack(_INDEX_CODE, 6 + len(entries), channel, len(entries)) + entries
        self._put(chunk + bytes(indexes))
        self._chunk_index += _packed(
            records.ChunkIndex(
                chunk_length=len(chunk),
                chunk_start_offset=start,
                compression=self._compression,
                compressed_size=len(packed),
                message_end_time=last,
                message_index_length=len(indexes),
                message_index_offsets=offsets,
                message_start_time=first,
                uncompressed_size=len(raw),
            )
        )
        self._chunks += 1
        self.first, self.last = min(self.first, first), max(self.last, last)
        self._chunk.clear()
        self._entries.clear()
        self._span = NO_SPAN

    def close(self) -> None:
        """Write the last chunk, the summary and the footer."""
        if self._file.closed:
            return
        self.flush()
        self._put(_packed(records.DataEnd(0)))
        groups = {
            Opcode.SCHEMA: _packed(*self._schemas),
            Opcode.CHANNEL: _packed(*self._channels),
            Opcode.STATISTICS: _packed(self._statistics()),
            Opcode.CHUNK_INDEX: bytes(self._chunk_index),
        }
        start = at = self._position
        offsets = []
        for code, group in groups.items():
            if group:
                offsets.append(records.SummaryOffset(code, at, len(group)))
            at += len(group)
        summary = b"".join(groups.values()) + _packed(*offsets)
        footer = _packed(records.Footer(start, at, 0))[:-4]
        checksum = zlib.crc32(footer, zlib.crc32(summary))
        self._put(summary + footer + struct.pack("<I", checksum) + MCAP0_MAGIC)
        self._file.close()

    def _statistics(self) -> records.Statistics:
        total = sum(self.counts.values())
        return records.Statistics(
            attachment_count=0,
            channel_count=len(self._channels),
            channel_message_counts=self.counts,
            chunk_count=self._chunks,
            message_count=total,
            message_end_time=self.last if total else 0,
            message_start_time=self.first if total else 0,
            metadata_count=0,
            schema_count=len(self._schemas),
        )

    def _put(self, data: bytes) -> None:
        view = memoryview(data)
        while len(view):
            view = view[self._file.write(view) :]
        self._position += len(data)


VERSION = 8
FOREVER = {"sec": 9223372036, "nsec": 854775807}
RELIABLE_QOS: dict[str, Any] = {
    "history": 1,
    "depth": 10,
    "reliability": 1,
    "durability": 2,
    "deadline": FOREVER,
    "lifespan": FOREVER,
    "liveliness": 1,
    "liveliness_lease_duration": FOREVER,
    "avoid_ros_namespace_conventions": False,
}


def _yaml(content: Any) -> str:
    """YAML without anchors, as rosbag2 writes it: through JSON every mapping becomes an object of its own."""
    text: str = yaml.safe_dump(json.loads(json.dumps(content)), sort_keys=False)
    return text


def definition_of(kind: str) -> tuple[str, str]:
    """Text of a standard message definition (ros2msg) and its hash; empty where the type is not standard."""
    store = typestore()
    if kind not in store.fielddefs:
        return "", ""
    text, _ = store.generate_msgdef(kind, ros_version=2)
    return text, store.hash_rihs01(kind)


class BagWriter:
    """A rosbag2 folder being written: one .mcap file, and metadata.yaml at the end.

    Parameters
    ----------
    path : folder to make.
    compression : "zstd" or "" for none, of the chunks.
    overwrite : whether an existing recording at `path` is replaced; anything else there is never touched.

    Raises
    ------
    ShakeError
        where something exists at `path` already or the folder cannot be made.
    """

    def __init__(self, path: Path | str, compression: str = "", overwrite: bool = False) -> None:
        self.path = Path(path)
        clear_the_way(self.path, overwrite)
        try:
            self.path.mkdir(parents=True)
            self._mcap = McapWriter(self.path / f"{self.path.absolute().name}.mcap", compression)
        except OSError as error:
            raise ShakeError(f"{self.path}: cannot be written ({error.strerror})") from None
        self._topics: dict[int, dict[str, Any]] = {}
        self._schemas: dict[tuple[str, str], int] = {}
        self._closed = False

    def __enter__(self) -> BagWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def counts(self) -> dict[str, int]:
        """Messages so far by topic."""
        return {str(topic["name"]): self._mcap.counts[number] for number, topic in self._topics.items()}

    def add_topic(
        self,
        name: str,
        kind: str,
        qos: list[dict[str, Any]] | None = None,
        definition: tuple[str, str] | None = None,
        encoding: str = "ros2msg",
    ) -> int:
        """Declare a topic.

        Parameters
        ----------
        name : full name.
        kind : message type such as sensor_msgs/msg/Imu.
        qos : offered profiles in rosbag2's form; reliable and volatile by default.
        definition : text and hash of the type's definition; looked up among the standard ones by default.
        encoding : form of the text, ros2msg or ros2idl.

        Returns
        -------
        number to write messages with
        """
        text, digest = definition_of(kind) if definition is None else definition
        profiles = _yaml([RELIABLE_QOS] if qos is None else qos).strip()
        if (kind, text) not in self._schemas:
            self._schemas[kind, text] = self._mcap.add_schema(kind, encoding if text else "", text.encode())
        metadata = {"offered_qos_profiles": profiles, "topic_type_hash": digest}
        number = self._mcap.add_channel(name, self._schemas[kind, text], metadata)
        self._topics[number] = {
            "name": name,
            "type": kind,
            "serialization_format": "cdr",
            "offered_qos_profiles": profiles,
            "type_description_hash": digest,
        }
        return number

    def write(self, topic: int, received: int, data: bytes) -> None:
        """Append a serialised message with its time of receipt [ns]."""
        self._mcap.write(topic, received, data)

    def flush(self) -> None:
        """Make everything so far safe against a kill of this process."""
        self._mcap.flush()

    def close(self) -> None:
        """Complete the file and write metadata.yaml, which appears whole or not at all."""
        if self._closed:
            return
        self._closed = True
        self._mcap.close()
        temporary = self.path / (METADATA + ".tmp")
        temporary.write_text(_yaml({"rosbag2_bagfile_information": self._metadata()}), encoding="utf-8")
        os.replace(temporary, self.path / METADATA)

    def _metadata(self) -> dict[str, Any]:
        total = sum(self._mcap.counts.values())
        span = {
            "duration": {"nanoseconds": self._mcap.last - self._mcap.first if total else 0},
            "starting_time": {"nanoseconds_since_epoch": self._mcap.first if total else 0},
            "message_count": total,
        }
        file = f"{self.path.absolute().name}.mcap"
        return {
            "version": VERSION,
            "storage_identifier": "mcap",
            "relative_file_paths": [file],
            **span,
            "topics_with_message_count": [
                {"topic_metadata": topic, "message_count": self._mcap.counts[number]}
                for number, topic in self._topics.items()
            ],
            "compression_format": "",
            "compression_mode": "",
            "files": [{"path": file, **span}],
            "custom_data": None,
            "ros_distro": "shake_ros",
        }


def clear_the_way(path: Path, overwrite: bool) -> None:
    """Raise ShakeError where `path` exists; with `overwrite` an old recording is removed, and nothing else is."""
    if not (path.exists() or path.is_symlink()):
        return
    if not overwrite:
        raise ShakeError(f"{path}: exists already; nothing is overwritten")
    content = list(path.iterdir()) if path.is_dir() and not path.is_symlink() else None
    if content is None or any(f.name not in (METADATA, METADATA + ".tmp") and not _storage(f) for f in content):
        raise ShakeError(f"{path}: is not a recording; it is not overwritten")
    shutil.rmtree(path)


def _storage(path: Path) -> bool:
    return path.is_file() and path.name.endswith((*SUFFIXES, ".db3-wal", ".db3-shm"))


def recover(path: Path | str, out: Path | str | None = None) -> tuple[Path, int]:
    """Make a killed or damaged recording whole.

    The messages that can be read are written into a new recording beside the old one. Where `out` is not given, the
    new one takes the old one's name and the old one is kept under that name with `.killed` added.

    Returns
    -------
    folder of the whole recording, number of messages in it
    """
    source = Path(path)
    stem = source.name.split(".")[0]
    kept, final = source.with_name(source.name + ".killed"), source if source.is_dir() else source.with_name(stem)
    if out is not None or kept.exists() or (final != source and final.exists()):
        target = source.with_name(stem + ".recovered") if out is None else Path(out)
        return target, _copy(source, target)
    with writing(), tempfile.TemporaryDirectory(prefix=f".{stem}-", dir=source.parent) as work:
        whole = Path(work, final.name)
        count = _copy(source, whole)
        source.rename(kept)
        whole.rename(final)
    return final, count


def _copy(source: Path, target: Path) -> int:
    count = 0
    with Bag(source) as bag, BagWriter(target) as writer:
        numbers = {}
        for topic in bag.topics.values():
            if topic.refusal:
                continue
            schema, metadata = topic.channel.schema, topic.channel.metadata
            definition = (schema.data.decode("utf-8", "replace"), metadata.get("topic_type_hash", ""))
            profiles = _profiles(metadata.get("offered_qos_profiles", ""))
            numbers[topic.name] = writer.add_topic(topic.name, topic.type, profiles, definition, schema.encoding)
        for message in bag.messages():
            writer.write(numbers[message.topic], message.received, message.data)
            count += 1
    return count


def _profiles(text: str) -> list[dict[str, Any]]:
    try:
        content = yaml.safe_load(text) if text else []
    except yaml.YAMLError:
        return []
    return content if isinstance(content, list) else []
