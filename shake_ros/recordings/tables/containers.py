"""Files that somebody else wrote: text, whose encoding is found, and tables in .xlsx, .tdms and .mat.

.xlsx is read by openpyxl, .tdms by npTDMS, .mat by scipy up to version 7 and by h5py (7.3). openpyxl, npTDMS and h5py
are the extra `files`; where one is not installed, a line says what to do, as it does for any other file that is no
text.
"""

from __future__ import annotations

import importlib
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from shake_ros.quantities import ShakeError
from shake_ros.recordings.tables.layout import Floats

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


Content = tuple[tuple[str, ...], tuple[str, ...], Callable[[int], Floats]]
"""Names, units, and the values of a column by its index."""


def is_workbook(head: bytes) -> bool:
    """Whether a file with these first bytes is an Excel workbook, whose `sheets` are read as text."""
    return head.startswith(b"PK\x03\x04")


def reader_of(path: Path, head: bytes) -> Callable[[Path], Content] | None:
    """What reads a file with these first bytes; None for text, a workbook, and what nothing here reads."""
    marks: dict[bytes, Callable[[Path], Content]] = {
        b"TDSm": _tdms,
        b"MATLAB 5.0": _mat,
        b"MATLAB 7.3": _hdf,
        b"\x89HDF": _hdf,
    }
    found = next((reader for mark, reader in marks.items() if head.startswith(mark)), None)
    return found or (_mat if path.suffix.lower() == ".mat" else None)


def _library(name: str, path: Path) -> Any:
    """An optional library, or the line that says how to do without."""
    try:
        return importlib.import_module(name)
    except ImportError:
        what, remedy = kind_of(path.read_bytes()[:64])
        package = {"nptdms": "npTDMS"}.get(name, name)
        raise ShakeError(f"{path}: is {what}: {remedy}, or install {package} (pip install {package})") from None


def _columns(path: Path, names: list[str], units: list[str], columns: list[Any]) -> Content:
    """Columns of equal length; a ShakeError names the first that is not a column of real numbers when it is read."""
    if not names:
        raise ShakeError(f"{path}: holds no columns of numbers")

    def read(place: int) -> Floats:
        values = np.asarray(columns[place]() if callable(columns[place]) else columns[place])
        if values.dtype.kind == "M":
            values = (values - values[0]) / np.timedelta64(1, "ns") * 1e-9
        if values.dtype.kind not in "fiub" or values.size != max(values.shape, default=0) or values.size < 2:
            raise ShakeError(
                f"{path}: variable '{names[place]}' of shape {values.shape} is not a column of real numbers"
            )
        return np.asarray(values.ravel(), dtype=np.float64)

    return tuple(names), tuple(units), read


def _mat(path: Path) -> Content:
    """The variables of a .mat file of version 7 and older."""
    from scipy.io import loadmat

    try:
        content = loadmat(str(path), appendmat=False)
    except OSError as error:
        raise ShakeError(f"{path}: cannot be read ({error.strerror or error})") from None
    except Exception as error:  # loadmat lets any error of a damaged file through
        raise ShakeError(f"{path}: is not a readable .mat file ({str(error)[:120]})") from None
    names = [name for name in content if not name.startswith("__")]
    return _columns(path, names, [], [content[name] for name in names])


def _hdf(path: Path) -> Content:
    """The data sets of an HDF5 file, such as a .mat file of version 7.3."""
    h5py = _library("h5py", path)
    try:
        with h5py.File(path, "r") as file:
            found: dict[str, Any] = {}
            file.visititems(lambda name, item: found.__setitem__(name, item) if hasattr(item, "shape") else None)
            found = {name: np.asarray(item) for name, item in found.items() if not name.startswith("#")}
    except Exception as error:  # h5py lets any error of a damaged file through
        raise ShakeError(f"{path}: is not a readable HDF5 file ({str(error)[:120]})") from None
    return _columns(path, list(found), [], list(found.values()))


def _tdms(path: Path) -> Content:
    """The channels of a TDMS file; a time from the wave form's increment where no channel holds it."""
    nptdms = _library("nptdms", path)
    try:
        file = nptdms.TdmsFile.read(path)
        groups = [(group.name, channel) for group in file.groups() for channel in group.channels()]
        several = len({group for group, _ in groups}) > 1
        names = [f"{group}/{channel.name}" if several else channel.name for group, channel in groups]
        units = [str(channel.properties.get("unit_string", "")) for _, channel in groups]
        columns: list[Any] = [channel[:] for _, channel in groups]
        step = next((s for _, c in groups if (s := c.properties.get("wf_increment"))), None)
        if step and "time" not in (name.lower() for name in names):
            names, units = ["time", *names], ["s", *units]
            columns = [np.arange(max(map(len, columns))) * float(step), *columns]
    except Exception as error:  # npTDMS lets any error of a damaged file through
        raise ShakeError(f"{path}: is not a readable TDMS file ({str(error)[:120]})") from None
    return _columns(path, names, units, columns)


def sheets(path: Path) -> list[list[str]]:
    """The sheets of an Excel workbook, each as the lines of text that it would be as tab-separated values."""
    openpyxl = _library("openpyxl", path)
    try:
        book = openpyxl.load_workbook(path, read_only=True, data_only=True)
        found = [[_line(row) for row in sheet.iter_rows(values_only=True)] for sheet in book.worksheets]
        book.close()
    except Exception as error:  # openpyxl lets any error of a damaged file through
        raise ShakeError(f"{path}: is not a readable Excel file ({str(error)[:120]})") from None
    return found


def _line(row: tuple[Any, ...]) -> str:
    """A row of cells as tab-separated text."""
    words = ("" if cell is None else repr(cell) if isinstance(cell, float) else str(cell) for cell in row)
    return "\t".join(" ".join(word.split()) for word in words)
