"""Small sound inputs of each reader, made on the spot, and their mutations: what fuzz.py feeds."""

from __future__ import annotations

import functools
import random
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import zstandard
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

from benchmarks.recordings.raw import JOINT_STATE, STORE, joint_state
from shake_ros.recordings.bags import write_table_recording
from shake_ros.settings import find

SAMPLES = 12
ZEROS = 50_000_000  # bytes that pack into two kilobytes
Files = dict[str, bytes]

PLAIN = (
    "nan -nan .nan inf -.inf 1e999 -1e-999 1e308 0 -0 -1 1_000 0x7f 0o17 0b1 1:59:59 99999999999999999999 2001-02-30 "
    "true ~ null '' \"\" [] {} [[]] {a: 1} &a *a <<: *a !!int !!float !!bool !!timestamp !!binary !!set !!omap !!null "
    "!!python/object:os.system !x | > - ? : # % @ ` \x00 \x85 \u2028 \ud7ff \U0001f600 \ufeff"
)
WORDS: tuple[str, ...] = tuple(PLAIN.split(" "))
WORDS += ("9" * 400, "9" * 5000, "1" + ":59" * 200, "-" * 200, "[" * 60, "[" * 5000, "{a: " * 300, "- " * 400, "\t")
WORDS += (
    "!!int ''",
    "!!float ''",
    "!!bool x",
    "!!timestamp x",
    "!!null [1]",
    "? [1, 2]\n: 3",
    "? {a: 1}\n: 2",
    "\n---\n",
)
LAUGHS = "a: &a [x, x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{new}: &{new} [{', '.join([f'*{old}'] * 10)}]\n" for old, new in zip("abcdefgh", "bcdefghi", strict=True)
)


def accelerograms() -> list[Files]:
    """One file of each format."""
    values = np.round(0.3 * np.sin(np.arange(24) * 0.7), 4)

    def rows(count: int, width: int) -> str:
        return "".join(
            "".join(f"{v:{width}.4f}" for v in values[i : i + count]) + "\n" for i in range(0, values.size, count)
        )

    peer = "PEER NGA STRONG MOTION\nSOMEWHERE 01/01/00\nACCELERATION TIME HISTORY IN UNITS OF G\n"
    points = "   24 POINTS OF ACCEL DATA EQUALLY SPACED AT  .005 SEC (UNITS CM/SEC/SEC)\n"
    cdmg = "CORRECTED ACCELEROGRAM\n" + "a station\n" * 24 + "PEAK ACCELERATION = .3 CM/SEC/SEC\n" + points
    numbers = [0] * 48
    numbers[15], numbers[16] = 1, 24
    reals = [1.7e38] * 50
    reals[1] = 200.0
    smc = "1 RAW ACCELEROGRAM\n" + "*\n" * 10
    smc += "".join("".join(f"{v if v else -32768:10d}" for v in numbers[i : i + 8]) + "\n" for i in range(0, 48, 8))
    smc += "".join("".join(f"{v:15.7E}" for v in reals[i : i + 5]) + "\n" for i in range(0, 50, 5))
    cosmos = "Corrected acceleration   (Format v01.20 with 13 text lines)\n" + "text\n" * 12
    cosmos += " 100 Integer-header values follow on   10 lines, Format= (10I8)\n" + ("       4" * 10 + "\n") * 10
    cosmos += " 100 Real-header values follow on  17 lines, Format= (6F13.6)\n"
    cosmos += "".join(
        "".join(f"{5.0 if k == 61 else -999.0:13.6f}" for k in range(i, min(i + 6, 100))) + "\n"
        for i in range(0, 100, 6)
    )
    cosmos += '   1 Comment line(s) follow, each starting with a "|":\n| nothing\n'
    cosmos += "      24  acceleration pts, approx 0 secs, units=cm/sec2(04), Format= (8f10.4)\n"
    texts = (
        peer + "NPTS=     24, DT=   .0050 SEC\n" + rows(5, 15),
        cdmg + rows(8, 10) + "/&\n",
        smc + "| a comment\n" + rows(8, 10),
        cosmos + rows(8, 10) + "End-of-data for acceleration\n",
        "time, acceleration [g]\n" + "".join(f"{k * 0.01:.2f}, {v:.5f}\n" for k, v in enumerate(values)),
        "# a comment\n" + "".join(f"{k * 0.01:.2f};{v:.5f}\n" for k, v in enumerate(values)),
    )
    return [{"record.dat": text.encode()} for text in texts]


def configurations() -> list[Files]:
    """One configuration of each kind, under the kind's name."""
    kinds = {
        "table": "bergamo",
        "interlock": "bergamo",
        "controller": "super_twisting",
        "observer": "sliding_mode",
        "reference": "sine_20mm_2hz",
        "bridge": "volts",
        "emulator": "default",
        "node": "common",
    }
    return [{kind: find(kind, name).read_bytes()} for kind, name in kinds.items()]


def recordings(folder: Path) -> list[Files]:
    """Folders of rosbag2: ours with and without compression, another writer's with every storage and compression."""
    angle = np.arange(SAMPLES) * 0.3
    arrays = {"time": np.arange(SAMPLES) * 0.001, "valve_command": np.cos(angle), "position": 0.05 * np.sin(angle)}
    for packing in ("", "zstd"):
        write_table_recording(folder / f"ours_{packing}", **arrays, acceleration=np.sin(angle), compression=packing)
    for storage in StoragePlugin:
        for mode in (CompressionMode.NONE, CompressionMode.MESSAGE, CompressionMode.FILE):
            writer = Writer(folder / f"theirs_{storage.name}_{mode.name}", version=9, storage_plugin=storage)
            if mode != CompressionMode.NONE:
                writer.set_compression(mode, CompressionFormat.ZSTD)
            with writer:
                topics = [
                    writer.add_connection(f"/t/{name}", JOINT_STATE, typestore=STORE)
                    for name in ("valve_command", "joint_states")
                ]
                for k in range(SAMPLES):
                    for topic in topics:
                        stamp = 10**9 + k * 10**6
                        writer.write(topic, stamp, joint_state(stamp, {"table": 0.01 * k}))
    return [
        {file.name: file.read_bytes() for file in sorted(one.iterdir())}
        for one in sorted(folder.iterdir())
        if one.is_dir()
    ]


def mutated_text(data: bytes, chance: random.Random, others: list[bytes]) -> bytes:
    """Words replaced, lines doubled, dropped, moved or spliced from another text, or a change of bytes."""
    if chance.random() < 0.3:
        return mutated_bytes(data, chance, others)
    lines = data.decode("latin-1").split("\n")
    for _ in range(chance.randint(1, 4)):
        at = chance.randrange(len(lines))
        kind = chance.randrange(8)
        words = lines[at].split(" ")
        if kind <= 2:
            words[chance.randrange(len(words))] = chance.choice(WORDS)
            lines[at] = " ".join(words)
        elif kind == 3:
            lines[at:at] = [lines[at]] * chance.choice((1, 1, 2, 50))
        elif kind == 4 and len(lines) > 1:
            del lines[at]
        elif kind == 5:
            other = chance.choice(others).decode("latin-1").split("\n")
            lines[at:at] = other[chance.randrange(len(other)) :][: chance.randint(1, 20)]
        elif kind == 6:
            lines[at] = " " * chance.randrange(6) + lines[at].strip()
        else:
            key = lines[at].partition(":")[0]
            lines[at] = f"{key}: {chance.choice(WORDS)}"
    if chance.random() < 0.002:
        lines[:0] = LAUGHS.split("\n")
    encoding = "utf-8" if chance.random() < 0.9 else chance.choice(("utf-16", "utf-32", "latin-1"))
    return "\n".join(lines).encode(encoding, "replace")


def mutated_bytes(data: bytes, chance: random.Random, others: list[bytes]) -> bytes:
    """Bits, bytes, lengths and floats replaced, pieces cut out, doubled, spliced in, or the end cut off."""
    content = bytearray(data)
    for _ in range(chance.choice((1, 1, 1, 2, 3, 8))):
        if not content:
            break
        at = chance.randrange(len(content))
        kind = chance.randrange(9)
        if kind == 0:
            content[at] ^= 1 << chance.randrange(8)
        elif kind == 1:
            content[at : at + 4] = chance.randbytes(4)
        elif kind == 2:
            del content[at : at + chance.randrange(1, 200)]
        elif kind == 3:
            content[at:at] = content[at : at + chance.randrange(1, 200)]
        elif kind == 4:
            content[at : at + 8] = (2 ** chance.randrange(8, 64) - chance.randrange(2)).to_bytes(8, "little")
        elif kind == 5:
            content[at : at + 8] = struct.pack("<d", chance.choice((float("nan"), float("inf"), -1e308, 5e-324)))
        elif kind == 6:
            other = chance.choice(others)
            start = chance.randrange(max(1, len(other)))
            content[at:at] = other[start : start + chance.randrange(1, 400)]
        elif kind == 7:
            content[at : at + 4] = chance.choice((0, 0xFFFFFFFF, 0x7FFFFFFF, 0x80000000)).to_bytes(4, "little")
        else:
            del content[at:]
    return bytes(content)


@functools.cache
def bombs() -> list[Files]:
    """Files whose content is thousands of times their size."""
    zeros = zstandard.ZstdCompressor().compress(bytes(ZEROS))
    chunk = (
        struct.pack("<QQQI", 0, 1, ZEROS, 0) + struct.pack("<I", 4) + b"zstd" + struct.pack("<Q", len(zeros)) + zeros
    )
    mcap = b"\x89MCAP0\r\n" + struct.pack("<BQ", 6, len(chunk)) + chunk
    return [{"bomb.mcap.zstd": zeros}, {"bomb.db3.zstd": zeros}, {"bomb.mcap": mcap}]


Mutate = Callable[[bytes, random.Random, list[bytes]], bytes]
