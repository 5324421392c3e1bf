"""Numbers out of serialised messages and into them, thousands at a time.

A message's layout (where each field stands) follows from its type and from the lengths of its texts and
sequences. Messages of a recording have the same lengths over and over, so the first one is walked field by field
and all others whose length words agree are read as columns of one byte array. Type definitions are those of `rosbags`,
whose `deserialize_cdr` makes an object of every message instead: 0.12 million messages/s against 3.6 million with
`columns` (`python -m benchmarks.recordings.recorder`, decode_rosbags and decode_ours, on a quiet core). Alignment and
byte order are those of CDR as ROS 2 writes it (encapsulation 0x0000 big, 0x0001 little endian).
"""

from __future__ import annotations

import functools
import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

BYTES = ("bool", "byte", "char", "octet")
TEXTS = ("string", "wstring")
LARGEST_ARRAY = 64  # elements of an array that can be named one by one
MISSING_STAMP = np.iinfo(np.int64).min

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]


class UndecodableError(Exception):
    """Bytes that are no message of the expected type."""


@functools.cache
def typestore() -> Typestore:
    """The standard message definitions (ROS 2 Kilted; those used here are the same since Foxy)."""
    return get_typestore(Stores.ROS2_KILTED)


@dataclass
class Layout:
    """Where the fields of one message stand."""

    order: Literal["<", ">"]
    size: int
    # path such as `points[0].positions[0]` → (byte offset, numpy type)
    fields: dict[str, tuple[int, np.dtype[Any]]] = field(default_factory=dict)
    texts: dict[str, str] = field(default_factory=dict)  # path → text
    # (offset, words of 4 bytes) that decide the layout, with the bytes of the texts
    lengths: list[tuple[int, int]] = field(default_factory=list)

    @functools.cached_property
    def deciding(self) -> Integers:
        """Offsets of all bytes that must agree for another message to have this layout."""
        return np.array([at + i for at, count in self.lengths for i in range(count)], dtype=np.int64)


class _Walk:
    """One pass over one message."""

    def __init__(self, data: bytes) -> None:
        if len(data) < 4 or data[0] != 0 or data[1] > 1:
            raise UndecodableError(f"unknown encapsulation {data[:2].hex() or 'of no bytes'}")
        self.data, self.at = data, 4
        self.layout = Layout("<" if data[1] else ">", len(data))

    def align(self, size: int) -> None:
        self.at = (self.at - 4 + size - 1) // size * size + 4

    def length(self) -> int:
        self.align(4)
        if self.at + 4 > len(self.data):
            raise UndecodableError("ends inside a length")
        (value,) = struct.unpack_from(self.layout.order + "I", self.data, self.at)
        self.layout.lengths.append((self.at, 4))
        self.at += 4
        if value > len(self.data) - self.at:
            raise UndecodableError("a length runs over the end")
        return int(value)

    def text(self, path: str) -> None:
        count = self.length()
        raw = self.data[self.at : self.at + count]
        self.layout.texts[path] = raw.rstrip(b"\0").decode("utf-8", "replace")
        self.layout.lengths.append((self.at, count))
        self.at += count

    def numbers(self, paths: list[str], name: str, count: int) -> None:
        """`count` numbers side by side, of which the first ones are named."""
        kind = np.dtype("uint8" if name in BYTES else name).newbyteorder(self.layout.order)
        if count:
            self.align(kind.itemsize)
        if self.at + kind.itemsize * count > len(self.data):
            raise UndecodableError(f"ends inside '{paths[0] if paths else name}'")
        for i, path in enumerate(paths):
            self.layout.fields[path] = (self.at + i * kind.itemsize, kind)
        self.at += kind.itemsize * count

    def value(self, path: str, node: tuple[Any, Any]) -> None:
        """One field by its description in the type store."""
        kind, detail = node
        if kind == Nodetype.BASE and detail[0] in TEXTS:
            self.text(path)
        elif kind == Nodetype.BASE:
            self.numbers([path], detail[0], 1)
        elif kind == Nodetype.NAME:
            self.message(path, detail)
        else:
            (inner, limit) = detail
            count = self.length() if kind == Nodetype.SEQUENCE else int(limit)
            if inner[0] == Nodetype.BASE and inner[1][0] not in TEXTS:
                self.numbers([f"{path}[{i}]" for i in range(min(count, LARGEST_ARRAY))], inner[1][0], count)
            else:
                for i in range(count):
                    self.value(f"{path}[{i}]", inner)

    def message(self, path: str, kind: str) -> None:
        for name, node in typestore().get_msgdef(kind).fields:
            self.value(f"{path}.{name}" if path else name, node)


def walk(data: bytes, kind: str) -> Layout:
    """The layout of one serialised message of a type; raises UndecodableError."""
    pass_ = _Walk(data)
    pass_.message("", kind)
    return pass_.layout


_known: dict[tuple[str, int], tuple[Layout, bytes]] = {}  # by type and size the newest layout, and a message's bytes


def _layout(block: npt.NDArray[np.uint8], kind: str) -> Layout:
    """That of the first row; walked only where its deciding bytes are not those of the one before; UndecodableError."""
    data = block[0].tobytes()
    layout, like = _known.get((kind, len(data)), (None, b""))
    if (
        layout is not None
        and data[:2] == like[:2]
        and all(data[a : a + n] == like[a : a + n] for a, n in layout.lengths)
    ):
        return layout
    layout = walk(data, kind)
    _known[kind, len(data)] = layout, data
    return layout


def columns(
    messages: Sequence[bytes], kind: str, choose: Callable[[Layout], tuple[int, Sequence[str]]], width: int
) -> tuple[Integers, Floats, Integers]:
    """Stamps and chosen numbers of many messages of one type.

    Parameters
    ----------
    messages : serialised messages.
    kind : message type with a `header`.
    choose : gives a number and the `width` paths to read, from the layout; a path that is not there reads as NaN.

    Returns
    -------
    stamps : (n,) header.stamp [ns]; `MISSING_STAMP` where a message cannot be decoded.
    values : (n, width) chosen numbers; NaN where absent.
    sources : (n,) number that `choose` gave; −1 where a message cannot be decoded.
    """
    stamps, sources = np.full(len(messages), MISSING_STAMP, dtype=np.int64), np.full(len(messages), -1, dtype=np.int64)
    values = np.full((len(messages), width), np.nan)
    by_size: dict[int, list[int]] = {}
    for i, message in enumerate(messages):
        if message:
            by_size.setdefault(len(message), []).append(i)
    for size, members in by_size.items():
        rows = np.array(members)
        block = np.frombuffer(b"".join([messages[i] for i in members]), dtype=np.uint8).reshape(-1, size)
        while rows.size:
            try:
                layout = _layout(block, kind)
            except UndecodableError:
                rows, block = rows[1:], block[1:]
                continue
            deciding = layout.deciding
            same = (block[:, deciding] == block[0, deciding]).all(axis=1) & (block[:, 1] == block[0, 1])
            stamps[rows[same]] = _stamps(block[same], layout)
            sources[rows[same]], paths = choose(layout)
            for column, path in enumerate(paths):
                if path in layout.fields:
                    values[rows[same], column] = _field(block[same], layout, path)
            rows, block = rows[~same], block[~same]
    return stamps, values, sources


def _field(block: npt.NDArray[np.uint8], layout: Layout, path: str) -> npt.NDArray[Any]:
    at, kind = layout.fields[path]
    return np.ascontiguousarray(block[:, at : at + kind.itemsize]).view(kind)[:, 0]


def _stamps(block: npt.NDArray[np.uint8], layout: Layout) -> Integers:
    if "header.stamp.sec" not in layout.fields:
        return np.full(len(block), MISSING_STAMP, dtype=np.int64)
    seconds = _field(block, layout, "header.stamp.sec").astype(np.int64)
    nanoseconds: Integers = seconds * 1_000_000_000 + _field(block, layout, "header.stamp.nanosec").astype(np.int64)
    return nanoseconds


def filled(template: bytes, kind: str, stamps: Integers, values: dict[str, Floats]) -> list[bytes]:
    """Copies of a serialised message with other stamps [ns] and numbers, one for each stamp.

    Parameters
    ----------
    template : a message of the type, whose texts and sequence lengths are kept.
    values : path → (n,) numbers.
    """
    layout = walk(template, kind)
    block = np.tile(np.frombuffer(template, dtype=np.uint8), (len(stamps), 1))
    numbers: dict[str, npt.NDArray[Any]] = dict(values)
    numbers["header.stamp.sec"], numbers["header.stamp.nanosec"] = np.divmod(stamps, 1_000_000_000)
    for path, column in numbers.items():
        at, number = layout.fields[path]
        block[:, at : at + number.itemsize] = column.astype(number).view(np.uint8).reshape(len(stamps), -1)
    return [row.tobytes() for row in block]
