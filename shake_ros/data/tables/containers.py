"""Tables that are no text: .xlsx (openpyxl), .tdms (npTDMS), .mat up to version 7 (scipy) and 7.3 (h5py).

openpyxl, npTDMS and h5py are the extra `files`; where one is not installed, a line says what to do.
"""

from __future__ import annotations

import functools
import importlib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from shake_ros.core.quantities import ShakeError
from shake_ros.data.tables.cells import Floats
from shake_ros.data.tables.text import kind_of

Content = tuple[tuple[str, ...], tuple[str, ...], Callable[[int], Floats]]
"""Names, units, and the values of a column by its index."""


def reader_of(path: Path, head: bytes) -> Callable[[Path], Content] | None:
    """What reads a file with these first bytes; None for text, and for what nothing here reads."""
    marks: dict[bytes, Callable[[Path], Content]] = {
        b"PK\x03\x04": _xlsx,
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
    """Columns of equal length; a ShakeError names the first that is no column of real numbers when it is asked for."""
    if not names:
        raise ShakeError(f"{path}: holds no columns of numbers")

    def read(place: int) -> Floats:
        values = np.asarray(columns[place]() if callable(columns[place]) else columns[place])
        if values.dtype.kind == "M":
            values = (values - values[0]) / np.timedelta64(1, "ns") * 1e-9
        if values.dtype.kind not in "fiub" or values.size != max(values.shape, default=0) or values.size < 2:
            raise ShakeError(f"{path}: variable '{names[place]}' of shape {values.shape} is no column of real numbers")
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


def _xlsx(path: Path) -> Content:
    """The first sheet of an Excel workbook that holds rows of numbers, read as the text that it would be as CSV."""
    from shake_ros.data.tables.table import table_of

    openpyxl = _library("openpyxl", path)
    try:
        book = openpyxl.load_workbook(path, read_only=True, data_only=True)
        sheets = [[_line(row) for row in sheet.iter_rows(values_only=True)] for sheet in book.worksheets]
        book.close()
    except Exception as error:  # openpyxl lets any error of a damaged file through
        raise ShakeError(f"{path}: is not a readable Excel file ({str(error)[:120]})") from None
    refused = ShakeError(f"{path}: no rows of numbers found")
    for lines in sheets:
        try:
            table = table_of(path, lines, decimal=".")
        except ShakeError as error:
            refused = error
            continue
        width = max(i + 1 for i in table.numbers)
        names = tuple(table.name(i) for i in range(width))
        return names, table.units, functools.partial(_single, table.read)
    raise refused


def _single(read: Callable[[Sequence[int]], list[Floats]], place: int) -> Floats:
    return read([place])[0]


def _line(row: tuple[Any, ...]) -> str:
    """A row of cells as tab-separated text."""
    words = ("" if cell is None else repr(cell) if isinstance(cell, float) else str(cell) for cell in row)
    return "\t".join(" ".join(word.split()) for word in words)
