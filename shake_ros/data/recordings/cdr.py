"""Numbers out of serialised messages and into them, thousands at a time.

A message's layout (where each field stands) follows from its type and from the lengths of its texts and
sequences. Messages of a recording have the same lengths over and over, so the first one is walked field by field
and all others whose length words agree are read as columns of one byte array: about 0.2 µs a message.
Alignment and byte order are those of CDR as ROS 2 writes it (encapsulation 0x0000 big, 0x0001 little endian).
"""

from __future__ import annotations

import functools
import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

SIZES = {"bool": 1, "byte": 1, "octet": 1, "char": 1, "int8": 1, "uint8": 1, "int16": 2, "uint16": 2, "int32": 4}
SIZES |= {"uint32": 4, "int64": 8, "uint64": 8, "float32": 4, "float64": 8}
CODES = {"int8": "i1", "int16": "i2", "int32": "i4", "int64": "i8", "uint16": "u2", "uint32": "u4", "uint64": "u8"}
CODES |= {"float32": "f4", "float64": "f8"}
TEXTS = ("string", "wstring")
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
    """Where the fields of one message stand.

    Attributes
    ----------
    fields : path such as `points[0].positions[0]` → (byte offset, numpy type code).
    texts : path → text.
    lengths : (offset, words of 4 bytes) that decide the layout, with the bytes of the texts.
    """

    order: str
    size: int
    fields: dict[str, tuple[int, str]] = field(default_factory=dict)
    texts: dict[str, str] = field(default_factory=dict)
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

    def number(self, path: str, name: str, count: int = 1) -> None:
        size = SIZES[name]
        if count:
            self.align(size)
        if self.at + size * count > len(self.data):
            raise UndecodableError(f"ends inside '{path}'")
        if name in CODES and not path.endswith("]"):
            self.layout.fields[path] = (self.at, self.layout.order + CODES[name])
        elif name in CODES:
            for i in range(min(count, 64)):
                self.layout.fields[f"{path[:-2]}[{i}]"] = (self.at + i * size, self.layout.order + CODES[name])
        self.at += size * count

    def value(self, path: str, node: tuple[Any, Any]) -> None:
        """One field by its description in the type store."""
        kind, detail = node
        if kind == Nodetype.BASE:
            self.base(path, detail[0])
        elif kind == Nodetype.NAME:
            self.message(path, detail)
        else:
            (inner, limit) = detail
            count = self.length() if kind == Nodetype.SEQUENCE else int(limit)
            if inner[0] == Nodetype.BASE and inner[1][0] not in TEXTS:
                self.number(f"{path}[]", inner[1][0], count)
            else:
                for i in range(count):
                    self.value(f"{path}[{i}]", inner)

    def base(self, path: str, name: str) -> None:
        if name in TEXTS:
            self.text(path)
        else:
            self.number(path, name)

    def message(self, path: str, kind: str) -> None:
        for name, node in typestore().get_msgdef(kind).fields:
            self.value(f"{path}.{name}" if path else name, node)


def walk(data: bytes, kind: str) -> Layout:
    """The layout of one serialised message of a type; raises UndecodableError."""
    pass_ = _Walk(data)
    pass_.message("", kind)
    return pass_.layout


def columns(
    messages: Sequence[bytes], kind: str, choose: Callable[[Layout], Sequence[str]], width: int
) -> tuple[Integers, Floats]:
    """Stamps and chosen numbers of many messages of one type.

    Parameters
    ----------
    messages : serialised messages.
    kind : message type with a `header`.
    choose : gives the `width` paths to read, from the layout; a path that is not there reads as NaN.

    Returns
    -------
    stamps : (n,) header.stamp [ns]; `MISSING_STAMP` where a message cannot be decoded.
    values : (n, width) chosen numbers; NaN where absent.
    """
    stamps = np.full(len(messages), MISSING_STAMP, dtype=np.int64)
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
                layout = walk(messages[rows[0]], kind)
            except UndecodableError:
                rows, block = rows[1:], block[1:]
                continue
            deciding = layout.deciding
            same = (block[:, deciding] == block[0, deciding]).all(axis=1) & (block[:, 1] == block[0, 1])
            stamps[rows[same]] = _stamps(block[same], layout)
            for column, path in enumerate(choose(layout)):
                if path in layout.fields:
                    values[rows[same], column] = _field(block[same], layout, path)
            rows, block = rows[~same], block[~same]
    return stamps, values


def _field(block: npt.NDArray[np.uint8], layout: Layout, path: str) -> npt.NDArray[Any]:
    at, code = layout.fields[path]
    size = int(code[2:])
    return np.ascontiguousarray(block[:, at : at + size]).view(code)[:, 0]


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
        at, code = layout.fields[path]
        block[:, at : at + int(code[2:])] = column.astype(code).view(np.uint8).reshape(len(stamps), -1)
    return [row.tobytes() for row in block]
