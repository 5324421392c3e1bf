"""rosbag2's sqlite3 storage, read row by row with the standard library."""

from __future__ import annotations

import shutil
import sqlite3
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from urllib.parse import quote

from mcap.records import Schema

from shake_ros.data.recordings.mcap_reader import Channel, Damage

MAGIC = b"SQLite format 3\0"
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
