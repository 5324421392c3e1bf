"""Recording measured beside the `rosbags` and `mcap` libraries alone, in the same run.

    python -m benchmarks.recordings.recorder [--messages N] [--json FILE]

Messages/s written and read, what a SIGKILL costs, memory over ten simulated minutes at 1 kHz (four topics, as fast
as the machine goes). Sizes and contents are those of the closed loop: position, acceleration, reference, command.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType
from mcap.writer import Writer as LibraryWriter
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin, Writer

from shake_ros.quantities import ShakeError
from shake_ros.recordings.bags import BagWriter, read_table_recording
from shake_ros.recordings.bags.bag import Bag
from shake_ros.recordings.bags.cdr import columns, typestore
from shake_ros.recordings.bags.series import SIGNALS
from shake_ros.recordings.bags.table_writer import serialised
from shake_ros.recordings.bags.writer import CHUNK_SIZE

TOPICS = ("joint_states", "imu", "reference", "valve_command")
PERIOD = 1_000_000  # [ns]
KILL_AFTER = 3.0  # [s]


def samples(count: int) -> list[list[bytes]]:
    """Serialised messages of each topic, 1 ms apart; they are used over and over."""
    stamps = np.arange(count) * PERIOD + 1_000_000_000
    values = np.sin(np.arange(count) * 0.01)[:, None]
    return [serialised(name, stamps, np.repeat(values, len(SIGNALS[name].paths), axis=1)) for name in TOPICS]


def write_ours(path: Path, count: int, block: list[list[bytes]], compression: str = "") -> None:
    """`count` steps of the four topics with our writer."""
    with BagWriter(path, compression) as writer:
        numbers = [writer.add_topic(f"/shake/{name}", SIGNALS[name].type) for name in TOPICS]
        size = len(block[0])
        for k in range(count):
            stamp, row = 1_000_000_000 + k * PERIOD, k % size
            for number, messages in zip(numbers, block, strict=True):
                writer.write(number, stamp, messages[row])


def write_rosbags(path: Path, count: int, block: list[list[bytes]]) -> None:
    """The same with the writer of `rosbags`."""
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        topics = [writer.add_connection(f"/shake/{name}", SIGNALS[name].type, typestore=typestore()) for name in TOPICS]
        size = len(block[0])
        for k in range(count):
            stamp, row = 1_000_000_000 + k * PERIOD, k % size
            for topic, messages in zip(topics, block, strict=True):
                writer.write(topic, stamp, messages[row])


def read_rosbags(path: Path) -> None:
    """Decode everything with `rosbags`."""
    with AnyReader([path]) as reader:
        for connection, _, raw in reader.messages():
            reader.deserialize(raw, connection.msgtype)


def write_mcap(path: Path, count: int, block: list[list[bytes]]) -> None:
    """The same with the writer of `mcap`, in chunks of the same size."""
    with path.open("wb", buffering=0) as file:
        writer = LibraryWriter(file, chunk_size=CHUNK_SIZE, compression=CompressionType.NONE)
        writer.start("ros2", "benchmark")
        schema = writer.register_schema("any", "ros2msg", b"")
        topics = [writer.register_channel(name, "cdr", schema) for name in TOPICS]
        for k in range(count):
            stamp, row = 1_000_000_000 + k * PERIOD, k % len(block[0])
            for topic, messages in zip(topics, block, strict=True):
                writer.add_message(topic, stamp, messages[row], stamp)
        writer.finish()


def read_mcap(path: Path) -> int:
    """Records of a file, scanned with StreamReader of `mcap`."""
    with path.open("rb") as file:
        return sum(1 for _ in StreamReader(file).records)


def scan(path: Path) -> int:
    """Messages of a recording, scanned with our reader."""
    with Bag(path) as bag:
        return sum(1 for _ in bag.messages())


def seconds(act: Callable[[], object]) -> float:
    """Time that an act takes [s]."""
    begin = time.perf_counter()
    act()
    return time.perf_counter() - begin


def memory() -> float:
    """Resident memory of this process now [MB]."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize() / 1e6


def throughput(folder: Path, count: int) -> dict[str, float]:
    """Messages/s written and read, ours and `rosbags`, and their ratios."""
    block, total = samples(10_000), count * len(TOPICS)
    ours, theirs = folder / "ours", folder / "theirs"
    result = {
        "write_ours": total / seconds(lambda: write_ours(ours, count, block)),
        "write_ours_zstd": total / seconds(lambda: write_ours(folder / "zstd", count, block, "zstd")),
        "write_rosbags": total / seconds(lambda: write_rosbags(theirs, count, block)),
    }
    short = folder / "short"  # distinct stamps, as a real recording has them
    write_ours(short, len(block[0]), block)
    total = len(block[0]) * len(TOPICS)
    result["read_ours"] = total / seconds(lambda: read_table_recording(short))
    result["read_rosbags"] = total / seconds(lambda: read_rosbags(short))
    result["write_ratio"] = result["write_ours"] / result["write_rosbags"]
    result["read_ratio"] = result["read_ours"] / result["read_rosbags"]
    return result


def by_hand(folder: Path, count: int) -> dict[str, float]:
    """Messages/s of what is written by hand beside the library that would do it: packing, scanning, decoding."""
    block, total = samples(10_000), count * len(TOPICS)
    ours, theirs = folder / "by_hand", folder / "by_mcap.mcap"
    kind, signal = SIGNALS["joint_states"].type, SIGNALS["joint_states"]
    result = {
        "pack_ours": total / seconds(lambda: write_ours(ours, count, block)),
        "pack_mcap": total / seconds(lambda: write_mcap(theirs, count, block)),
        "scan_ours": total / seconds(lambda: scan(ours)),
        "scan_mcap": total / seconds(lambda: read_mcap(ours / "by_hand.mcap")),
    }
    messages, store = block[0], typestore()
    result["decode_ours"] = len(messages) / seconds(lambda: columns(messages, kind, signal.choose, 1))
    result["decode_rosbags"] = len(messages) / seconds(lambda: [store.deserialize_cdr(m, kind) for m in messages])
    return result


def child_write(kind: str, path: Path) -> None:
    """Write at 1 kHz until killed; the time of each written step goes to standard output."""
    block = samples(1000)
    if kind == "ours":
        writer = BagWriter(path)
        numbers = [writer.add_topic(f"/shake/{name}", SIGNALS[name].type) for name in TOPICS]
    else:
        other = Writer(path, version=9, storage_plugin=StoragePlugin.MCAP)
        other.open()
        topics = [other.add_connection(f"/shake/{name}", SIGNALS[name].type, typestore=typestore()) for name in TOPICS]
    begin, flushed = time.monotonic_ns(), time.monotonic()
    for k in range(10**9):
        while time.monotonic_ns() < begin + k * PERIOD:
            time.sleep(1e-4)
        stamp = 1_000_000_000 + k * PERIOD
        for i, messages in enumerate(block):
            if kind == "ours":
                writer.write(numbers[i], stamp, messages[k % 1000])
            else:
                other.write(topics[i], stamp, messages[k % 1000])
        if kind == "ours" and time.monotonic() - flushed > 0.5:
            flushed = time.monotonic()
            writer.flush()
        os.write(1, k.to_bytes(8, "little"))


def loss_after_kill(folder: Path, kind: str) -> dict[str, float]:
    """Milliseconds of recording that a SIGKILL costs, and how many messages can be read afterwards."""
    path = folder / f"killed_{kind}"
    child = subprocess.Popen(
        [sys.executable, "-m", "benchmarks.recordings.recorder", "--child", kind, str(path)], stdout=subprocess.PIPE
    )
    assert child.stdout is not None
    child.stdout.read(8)
    written, deadline = 1, time.monotonic() + KILL_AFTER
    while time.monotonic() < deadline:
        written += len(os.read(child.stdout.fileno(), 65536)) // 8
    os.kill(child.pid, signal.SIGKILL)
    written += len(child.communicate()[0]) // 8
    last, kept = 1_000_000_000 - PERIOD, 0
    try:
        with Bag(path) as bag:
            for message in bag.messages():
                last, kept = max(last, message.received), kept + 1
    except ShakeError:
        pass
    lost = 1_000_000_000 + (written - 1) * PERIOD - last
    return {"lost_ms": lost / 1e6, "kept": kept, "written": written * len(TOPICS)}


def growth(folder: Path, minutes: float) -> dict[str, float]:
    """Resident memory while so many minutes are written, and after they are read [MB]."""
    block, count = samples(10_000), int(minutes * 60_000)
    path, result = folder / "long", {}
    with BagWriter(path) as writer:
        numbers = [writer.add_topic(f"/shake/{name}", SIGNALS[name].type) for name in TOPICS]
        for k in range(count):
            if k == count // 10:
                result["write_after_tenth"] = memory()
            for number, messages in zip(numbers, block, strict=True):
                data = messages[k % 10_000]
                stamp = 1_000_000_000 + k * PERIOD
                writer.write(number, stamp, _stamped(data, stamp))
        result["write_at_end"] = memory()
    found = read_table_recording(path)
    assert not found.findings, found.findings
    result["read_at_end"] = memory()
    result["messages"] = count * len(TOPICS)
    return result


def _stamped(data: bytes, stamp: int) -> bytes:
    seconds_, nanoseconds = divmod(stamp, 1_000_000_000)
    return data[:4] + seconds_.to_bytes(4, "little") + nanoseconds.to_bytes(4, "little") + data[12:]


def main() -> int:
    """Run all measurements and print them."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--messages", type=int, default=200_000, help="for the throughput")
    parser.add_argument("--minutes", type=float, default=10.0, help="simulated, for the memory")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--child", nargs=2, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.child:
        child_write(given.child[0], Path(given.child[1]))
        return 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        result = {
            "throughput_messages_per_s": throughput(folder, given.messages // len(TOPICS)),
            "by_hand_messages_per_s": by_hand(folder, given.messages // len(TOPICS)),
            "kill_ours": loss_after_kill(folder, "ours"),
            "kill_rosbags": loss_after_kill(folder, "rosbags"),
            "memory_mb": growth(folder, given.minutes),
        }
    for group, figures in result.items():
        print(group)
        for key, value in figures.items():
            print(f"  {key:24} {value:14,.2f}")
    if given.json:
        given.json.write_text(json.dumps(result, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
