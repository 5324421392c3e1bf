"""The text of a file that somebody else wrote: its encoding is found, and what is no text is refused by its name."""

from __future__ import annotations

import re
from pathlib import Path

from shake_ros.core.quantities import ShakeError

BOMS = {b"\xef\xbb\xbf": "utf-8", b"\xff\xfe": "utf-16-le", b"\xfe\xff": "utf-16-be"}
KINDS = {  # first bytes → what the file is, and what to do where nothing here reads it
    b"PK\x03\x04": ("an Excel file (.xlsx) or another archive", "save it as CSV"),
    b"\xd0\xcf\x11\xe0": ("an old Excel file (.xls)", "save it as .xlsx or as CSV"),
    b"TDSm": ("a National Instruments TDMS file", "export it as text"),
    b"\x89HDF": ("an HDF5 file, as MATLAB writes with -v7.3", "save it with -v7"),
    b"MATLAB 7.3": ("a MATLAB .mat file of version 7.3", "save it with -v7"),
    b"MATLAB 5.0": ("a MATLAB .mat file", "export it as text"),
    b"\x1f\x8b": ("a gzip archive", "unpack it"),
    b"%PDF": ("a PDF", "ask for the numbers"),
    b"\x89MCAP": ("a recording (.mcap)", "give it where recordings are read"),
}
CONTROL = re.compile("[\x00-\x08\x0e-\x1b\x7f]")
HIGH = re.compile(rb"[\x80-\xff]+")


def first_bytes(path: Path) -> bytes:
    """The first 600 bytes of a file; a ShakeError where it cannot be read."""
    try:
        with path.open("rb") as file:
            return file.read(600)
    except (OSError, ValueError) as error:
        raise ShakeError(f"{path}: cannot be read ({getattr(error, 'strerror', None) or error})") from None


def kind_of(head: bytes) -> tuple[str, str]:
    """What a file is by its first bytes, and what to do with it; two empty texts where it may be text."""
    return next((kind for mark, kind in KINDS.items() if head.startswith(mark)), ("", ""))


def read_text(path: Path, largest: float = float("inf")) -> str:
    """The text of a file with every line ended by LF, without the marks of its encoding and of the end of the file.

    Raises
    ------
    ShakeError : it cannot be read, is larger than `largest` [bytes], empty, or no text; with what it is instead.
    """
    what, remedy = kind_of(first_bytes(path))
    if what:
        raise ShakeError(f"{path}: is {what}: {remedy}")
    if path.stat().st_size > largest:
        raise ShakeError(f"{path}: is larger than {largest / 1e6:.0f} MB")
    text = decoded(path.read_bytes().rstrip(b"\x1a"))
    text = text.replace("\r\r\n", "\n").replace("\r\n", "\n").replace("\r", "\n").rstrip("\x00\x1a\n ")
    if not text.strip():
        raise ShakeError(f"{path}: is empty")
    if strange := CONTROL.search(text):
        place = strange.start()
        line = text.count("\n", 0, place) + 1
        raise ShakeError(f"{path}, line {line}: is not text (byte 0x{ord(text[place]):02x} at {place})")
    return text


def decoded(raw: bytes) -> str:
    """Bytes as text: UTF-8 or UTF-16, with or without their mark, GBK, Windows-1251 or Windows-1252.

    Headings are too short for the statistics of a general detector, which takes 'µm' for Chinese; the shape of the runs
    of bytes above 127 decides: Chinese ones are even and stand apart from Latin letters.

    >>> decoded("Weg [µm]".encode("cp1252")), decoded("位移(um)".encode("gbk")), decoded("t;x".encode("utf-16-le"))
    ('Weg [µm]', '位移(um)', 't;x')
    """
    for mark, name in BOMS.items():
        if raw.startswith(mark):
            return raw[len(mark) :].decode(name, errors="replace")
    for name, zeros in (("utf-16-le", raw[1:2000:2]), ("utf-16-be", raw[0:2000:2])):
        if zeros and zeros.count(0) > 0.9 * len(zeros):
            return raw.decode(name, errors="replace")
    try:
        return raw.decode("utf-8")
    except UnicodeDecodeError:
        pass
    runs = list(HIGH.finditer(raw))
    chinese = all(
        len(run[0]) % 2 == 0 and all(b"\xa1"[0] <= lead <= b"\xd7"[0] for lead in run[0][::2]) for run in runs
    )
    beside = any(
        raw[run.start() - 1 : run.start()].isalpha() or raw[run.end() : run.end() + 1].isalpha() for run in runs
    )
    if chinese and not beside:
        return raw.decode("gb18030", errors="replace")
    cyrillic = sum(len(run[0]) for run in runs if len(run[0]) > 2 and min(run[0]) >= 0xC0)
    name = "cp1251" if 2 * cyrillic > sum(len(run[0]) for run in runs) else "cp1252"
    return raw.decode(name, errors="replace")
