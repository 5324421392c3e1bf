"""A recording as a whole: its files, its topics, their messages in stored order, and what a reader met in them.

Every storage file is opened by itself and `metadata.yaml` is used only for the order of files and for a
comparison of counts. `rosbags` joins the topics of metadata.yaml with those of the files on type, hash *and*
quality of service, and yields nothing where the two texts differ, as they do in bags converted by older tools
(both `talker` bags and `convert_a` of rosbag2's own test resources). Here the files decide.
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple

import zstandard

from shake_ros.quantities import ShakeError
from shake_ros.recordings.bags import storage
from shake_ros.recordings.bags.storage import Channel, McapFile, SqliteFile
from shake_ros.settings import read_yaml


@dataclass(frozen=True)
class Finding:
    """One kind of trouble on one topic."""

    # damage (of the file: cut, checksum, metadata that do not fit), skipped (a channel that cannot be used),
    # undecodable, joint, publishers, covariance (data declared as not measured), clock (stamps of another one),
    # missing_stamp, reversed_time, restart (time jumps back to an earlier run), duplicate, gap, jitter, not_a_number,
    # clipping, constant, unit (a size that suggests another one), resampled, idle (the command did not act), absent (an
    # optional signal that is not there or not usable)
    kind: str
    topic: str  # full topic name, empty where the whole recording is meant
    count: int  # how many samples, messages or places
    text: str  # the sentence for a person, with the first place where it happens
    time: float | None = None  # first place, seconds from the first sample [s]; None where it has none

    def __str__(self) -> str:
        return f"{self.topic}: {self.text}" if self.topic else self.text


ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
METADATA = "metadata.yaml"
SUFFIXES = (".mcap", ".db3", ".mcap.zstd", ".db3.zstd")
DAMAGES_LISTED = 20


class Message(NamedTuple):
    """One message as stored: topic, time of receipt [ns], serialised bytes."""

    topic: str
    received: int
    data: bytes


@dataclass(frozen=True)
class BagTopic:
    """A topic of a recording. `refusal` says why its messages cannot be used; empty where they can."""

    name: str
    type: str
    count: int
    channel: Channel
    refusal: str = ""


def _refusal(channel: Channel) -> str:
    if channel.encoding != "cdr":
        return f"is serialised as '{channel.encoding}', not as cdr"
    if "/srv/" in channel.type or channel.topic.endswith("/_service_event"):
        return "records service calls, not messages"
    if not channel.type:
        return "has no message type in the file"
    return ""


class Bag:
    """A rosbag2 folder, or one .mcap or .db3 file (also .zstd) by itself.

    Use it as a context manager; `topics` maps full names to `BagTopic`, `findings` grows while messages are read.

    Raises
    ------
    ShakeError
        where the path is no recording, naming what it is instead.
    """

    def __init__(self, path: Path | str) -> None:
        self.path = Path(path)
        self.findings: list[Finding] = []
        self.metadata: dict[str, Any] = {}
        self.topics: dict[str, BagTopic] = {}
        self._temporary: tempfile.TemporaryDirectory[str] | None = None
        try:
            self._files = [self._open_file(file) for file in self._list_files()]
            self._survey()
        except OSError as error:
            self.close()
            raise ShakeError(f"{self.path}: cannot be read ({error.strerror or error})") from None
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Bag:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Remove unpacked copies."""
        if self._temporary is not None:
            self._temporary.cleanup()
            self._temporary = None

    @property
    def complete(self) -> bool:
        """Whether every file was closed properly."""
        return all(file.complete for file in self._files)

    @property
    def message_count(self) -> int:
        """Messages in all files, of every topic."""
        return sum(topic.count for topic in self.topics.values())

    def messages(self, topics: Collection[str] | None = None) -> Iterator[Message]:
        """Messages of the named topics (all usable ones by default) in stored order, one chunk in memory at a time."""
        names = {name for name, topic in self.topics.items() if not topic.refusal}
        if topics is not None:
            names &= set(topics)
        for file in self._files:
            for channel, received, data in file.messages(lambda channel: channel.topic in names):
                if data[:4] == ZSTD_MAGIC:
                    try:
                        data = zstandard.ZstdDecompressor().stream_reader(data).read(storage.LARGEST_RECORD)
                    except (zstandard.ZstdError, MemoryError):
                        self._damage(f"{file.path.name}: a message of '{channel.topic}' cannot be decompressed")
                        continue
                yield Message(channel.topic, received, data)

    def _damage(self, text: str) -> None:
        finding = Finding("damage", "", 1, " ".join(text.split()))
        if finding not in self.findings and len(self.findings) < DAMAGES_LISTED:
            self.findings.append(finding)

    def _list_files(self) -> list[Path]:
        path = self.path
        if path.is_file():
            if path.name == METADATA:
                raise ShakeError(f"{path}: name the folder of the recording, not its {METADATA}")
            return [path]
        if not path.is_dir():
            raise ShakeError(f"{path}: no such recording")
        found = sorted((file for file in path.iterdir() if file.name.endswith(SUFFIXES)), key=natural_order)
        if (path / METADATA).is_file():
            named = self._files_of_metadata()
            if named:
                return named
        elif found:
            self._damage(f"{METADATA} is missing (a recording that was killed); the files themselves are read")
        if not found:
            raise ShakeError(f"{path}: not a recording: neither {METADATA} nor a .mcap or .db3 file in it")
        stems = {re.sub(r"_\d+$", "", file.name[: file.name.index(".")]) for file in found}
        if len(stems) > 1 or len({file.name[file.name.index(".") :] for file in found}) > 1:
            raise ShakeError(
                f"{path}: several recordings in one folder, name one of {', '.join(f.name for f in found)}"
            )
        return found

    def _files_of_metadata(self) -> list[Path]:
        try:
            content = read_yaml(self.path / METADATA)
            self.metadata = dict(content["rosbag2_bagfile_information"])
            names = [Path(str(name)).name for name in self.metadata["relative_file_paths"]]
        except ShakeError as error:
            self._damage(f"{error}; the files themselves are read")
            return []
        except (KeyError, TypeError, ValueError):
            self._damage(f"{METADATA} is not that of a rosbag2 recording; the files themselves are read")
            return []
        present = [self.path / name for name in names if (self.path / name).is_file()]
        for name in names:
            if not (self.path / name).is_file():
                self._damage(f"file '{name}' named by {METADATA} is missing")
        if names and not present:
            raise ShakeError(f"{self.path}: none of the files named by {METADATA} is there ({', '.join(names)})")
        return present

    def _open_file(self, path: Path) -> McapFile | SqliteFile:
        with path.open("rb") as file:
            magic = file.read(16)
        if magic.startswith(ZSTD_MAGIC):
            path = self._unpack(path)
            with path.open("rb") as file:
                magic = file.read(16)
        if magic.startswith(storage.MAGIC):
            return McapFile(path, self._damage)
        if magic.startswith(storage.SQLITE_MAGIC):
            return SqliteFile(path, self._damage)
        if magic.startswith(b"#ROSBAG V"):
            raise ShakeError(f"{path}: a ROS 1 bag; convert it with rosbags-convert")
        if not magic:
            raise ShakeError(f"{path}: is empty")
        raise ShakeError(f"{path}: neither MCAP nor SQLite (begins with {magic[:8]!r})")

    def _unpack(self, path: Path) -> Path:
        """A copy of a zstd-compressed file in a temporary folder; what a cut file holds is kept."""
        if self._temporary is None:
            self._temporary = tempfile.TemporaryDirectory(prefix="shake_ros-")
        target = Path(self._temporary.name, path.name.removesuffix(".zstd"))
        with path.open("rb") as packed, target.open("wb") as out:
            reader = zstandard.ZstdDecompressor().stream_reader(packed)
            try:
                while block := reader.read(1 << 20):
                    out.write(block)
            except zstandard.ZstdError as error:
                self._damage(f"{path.name}: {error}; what precedes it is kept")
        return target

    def _survey(self) -> None:
        for file in self._files:
            file.survey()
            for number, channel in file.channels.items():
                count = file.counts.get(number, 0)
                known = self.topics.get(channel.topic)
                if known is not None and known.type != channel.type:
                    reason = f"has two types, {known.type} and {channel.type}"
                    self.topics[channel.topic] = BagTopic(known.name, known.type, known.count + count, channel, reason)
                    continue
                total = count + (known.count if known else 0)
                self.topics[channel.topic] = BagTopic(channel.topic, channel.type, total, channel, _refusal(channel))
        for topic in self.topics.values():
            if topic.refusal and topic.count:
                self.findings.append(Finding("skipped", topic.name, topic.count, f"{topic.refusal}; left out"))
        declared = self.metadata.get("message_count")
        if isinstance(declared, int) and declared != self.message_count:
            self._damage(f"{METADATA} declares {declared} messages, the files hold {self.message_count}")


def natural_order(path: Path) -> list[tuple[int, str]]:
    """Sort key by which part_10 follows part_9."""
    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", path.name)]
