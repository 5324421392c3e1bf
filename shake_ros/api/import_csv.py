"""`import_csv`: convert a laboratory's table of columns into a recording on our topics."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from shake_ros.quantities import ShakeError, unknown_name
from shake_ros.recordings.bags import TableRecording, read_table_recording, write_table_recording
from shake_ros.recordings.bags.bag import Finding
from shake_ros.recordings.fit_records import SHORT, bridged, longest_short_gap, without_repeats
from shake_ros.recordings.second_file import brought, clock_between, clock_line
from shake_ros.recordings.tables.proposal import LONGEST_STEP, Proposal, propose
from shake_ros.recordings.tables.table import Column, ColumnTable, read_table
from shake_ros.recordings.tables.units import quantity_of

SIGNALS = {
    "command": "valve command, −1 … 1",
    "position": "position [m]",
    "acceleration": "acceleration [m/s²]",
    "force": "external force on the table [N]",
    "pressure_a": "absolute pressure of chamber A [Pa]",
    "pressure_b": "the same of chamber B [Pa]; a fit uses the difference of both",
    "pressure_load": "pressure of chamber A less that of chamber B [Pa], of one transducer",
    "pressure_supply": "absolute pressure of the supply [Pa]; no fit uses it",
}
OF_SECOND = tuple(name for name in SIGNALS if name not in ("command", "position"))  # what a second file may bring
WANTED = {name: name.partition("_")[0] for name in ("time", *SIGNALS)}  # quantity of each column
Columns = dict[str, npt.NDArray[np.float64]]


def import_proposal(file: str | Path, *, skip: int | None = None, decimal: str = "") -> Proposal:
    """What the columns of a table could be, by their names and units, and the command that imports them.

    Parameters
    ----------
    file, skip, decimal : as of `import_csv`.

    Raises
    ------
    ShakeError
        No table can be read.

    Examples
    --------
    >>> import tempfile
    >>> import shake_ros as sr
    >>> file = Path(tempfile.mkdtemp()) / "run.csv"
    >>> rows = [f"{5 * k};{0.1 * (k % 7):.1f};{k % 5}" for k in range(400)]
    >>> _ = file.write_text("\\n".join(["Zeit [ms];Ventil [V];Weg [mm]", *rows]))
    >>> found = sr.import_proposal(file)
    >>> found.rate, [column.could_be for column in found.columns]
    (200.0, ['time', 'command', 'position'])
    """
    return propose(file, skip, decimal)


def import_csv(
    file: str | Path,
    out: str | Path,
    *,
    command: str,
    position: str | None = None,
    time: str | None = None,
    rate: float | None = None,
    skip: int | None = None,
    decimal: str = "",
    bridge: int = 0,
    also: Sequence[Mapping[str, str | float | Path]] = (),
    same_clock: bool = False,
    overwrite: bool = False,
    **signals: str | None,
) -> TableRecording:
    """Write the columns of a table as a rosbag2 recording.

    Parameters
    ----------
    file : text, .xlsx, .tdms, or .mat.
    out : folder of the recording.
    command, position, signals : a column's name or its number from 1: valve command [-]; and of position [m],
        acceleration [m/s²], force on the table [N], pressure_a, pressure_b, pressure_load, pressure_supply [Pa] those
        that there are, position or acceleration among them.
        The unit in the heading, or in a row of units, takes it to SI units; a factor (`"CHANNEL0*0.01"`), and what is
        added then (`"mA*0.125-1.5"`), stand in for it.
    time : column of the time [s].
    rate : sampling rate, if no column holds the time [Hz].
    skip : lines above the table, if they are not recognised.
    decimal : point or comma, if the numbers do not decide it.
    bridge : samples of the longest gap that is filled by interpolation; 0 fills none.
    also : further files, each with `file`, `time` or `rate` and its own columns, of which an acceleration is one. Their
        clocks are found by the correlation of the acceleration with the position.
    same_clock : the time of the further files is that of the first.
    overwrite : replace an existing recording.

    Returns
    -------
    TableRecording
        As read back from the folder; its `findings` say what was not as it should be, and what was done about it.

    Raises
    ------
    ShakeError
        One line with file, line and column.

    Examples
    --------
    >>> import tempfile
    >>> import shake_ros as sr
    >>> folder = Path(tempfile.mkdtemp())
    >>> lines = [f"{k / 100:.2f};{0.1 * k:.1f};{k}" for k in range(5)]
    >>> _ = (folder / "run.csv").write_text("\\n".join(["t;u;x_mm", *lines]))
    >>> recording = sr.import_csv(folder / "run.csv", folder / "bag", time="t", command="u", position="x_mm*1e-3")
    >>> len(recording), recording.sample_time, recording.position[-1].item()
    (5, 0.01, 0.004)
    """
    path, findings = Path(file), list[Finding]()
    for name in signals:
        if name not in OF_SECOND:
            raise unknown_name("signal", name, SIGNALS)
    known = {name: text for name, text in {"position": position, **signals}.items() if text is not None}
    given = {"command": command, **known}
    if not {"position", "acceleration"} & {*given, *(name for more in also for name in more)}:
        raise ShakeError(f"{path}: --position or --acceleration is needed: a command alone shows no motion")
    how = {"rate": rate, "skip": skip, "decimal": decimal}
    values = _read(path, given, time, how, bridge, findings)
    for more in also:
        values = _with(path, values, more, same_clock, bridge, findings)
    stamps, valve, motion = values.pop("time"), values.pop("command"), values.pop("position", None)
    write_table_recording(out, stamps, valve, motion, **values, overwrite=overwrite)  # type: ignore[arg-type]
    recording = read_table_recording(out)
    return replace(recording, findings=(*findings, *recording.findings))


def _read(
    path: Path,
    signals: Mapping[str, str],
    time: str | None,
    how: Mapping[str, object],
    bridge: int,
    findings: list[Finding],
) -> Columns:
    """The columns of one file in SI units, its time among them; repairs and assumptions are reported."""
    rate = None if how.get("rate") is None else float(str(how["rate"]))
    skip = None if how.get("skip") is None else int(str(how["skip"]))
    if (time is None) == (rate is None):
        raise ShakeError(f"{path}: give either the column of the time or the sampling rate")
    if skip is not None and skip < 0:
        raise ShakeError(f"--skip {skip}: a number of lines is needed")
    if bridge < 0:
        raise ShakeError(f"--bridge {bridge}: a number of samples is needed")
    texts = dict(signals) if time is None else {"time": time, **signals}
    columns = {name: Column.parse(text) for name, text in texts.items()}
    table = read_table(path, skip, str(how.get("decimal") or ""))
    found = table.signals(columns, WANTED)
    values = {name: signal.values for name, signal in found.items()}
    findings += [Finding("skipped", "", 0, f"{path.name}: {note}") for note in table.notes]
    if notes := [signal.note for signal in found.values() if signal.note]:
        findings.append(Finding("unit", "", 0, f"{path.name}: {'; '.join(notes)}"))
    lengths = {columns[name].name: len(x) for name, x in values.items()}
    if len(set(lengths.values())) > 1:
        text = ", ".join(f"{name} {count}" for name, count in lengths.items())
        raise ShakeError(f"{path}: variables differ in length: {text}")
    if rate is not None:
        return _mended({"time": _steps(len(next(iter(values.values()))), rate), **values}, path, bridge, findings)
    _is_time(table, columns["time"], found["time"].unit, values["time"])
    values, repeats = without_repeats(values)
    if repeats:
        findings.append(Finding("duplicate", "", repeats, f"{path.name}: {repeats} rows are repeated; left out"))
    return _mended(values, path, bridge, findings)


def _is_time(table: ColumnTable, column: Column, unit: str, time: npt.NDArray[np.float64]) -> None:
    """A count of samples, and a time without a unit that may be in milliseconds, are no time in seconds."""
    if column.scale is not None or unit:
        return
    name = table.name(table.place(column.name))
    if quantity_of(name) == "index":
        raise ShakeError(
            f"{table.path}: column '{name}' counts samples: give --rate, or its period: --time '{name}*0.005'"
        )
    step = float(np.median(np.diff(time))) if len(time) > 1 else 0.0
    if step >= LONGEST_STEP:
        raise ShakeError(
            f"{table.path}: column '{name}' names no unit and goes on by {step:g} a row: in ms? "
            f"--time '{name}*0.001'; in s? --time '{name}*1'"
        )


def _mended(values: Columns, path: Path, bridge: int, findings: list[Finding]) -> Columns:
    """The table with its short gaps filled, where that is asked for."""
    _check_time(path, values["time"])
    if bridge:
        found = bridged(values, bridge)
        text = f"{found.count} samples in {found.gaps} gaps of up to {bridge} samples are filled by interpolation"
        findings += [Finding("gap", "", found.count, f"{path.name}: {text}")] if found.count else []
        values = found.values
    elif longest := longest_short_gap(values, SHORT):
        what = "gaps of one sample" if longest == 1 else f"gaps of up to {longest} samples"
        text = f"{path.name}: has {what}, which divide it into segments: --bridge {longest} fills them"
        findings.append(Finding("gap", "", 0, text))
    return values


def _with(
    path: Path,
    first: Columns,
    more: Mapping[str, str | float | Path],
    same_clock: bool,
    bridge: int,
    findings: list[Finding],
) -> Columns:
    """The first file's columns with those of another one on its stamps."""
    other = Path(str(more["file"]))
    how = {name: more.get(name) for name in ("rate", "skip", "decimal")}
    signals = {n: str(v) for n, v in more.items() if n not in ("file", "time", *how) and v is not None}
    for name in signals:
        if name not in OF_SECOND or name in first:
            reason = "is in the first file" if name in first else "belongs into the first file, on one clock"
            raise ShakeError(f"{other}: the {name} {reason}; a second file brings {', '.join(OF_SECOND)}")
    if "acceleration" not in signals and not same_clock:
        raise ShakeError(f"{other}: without an acceleration its clock cannot be related to that of {path}")
    if "position" not in first and not same_clock:
        raise ShakeError(f"{path}: without a position the clock of {other} cannot be related to it (--same-clock?)")
    time = more.get("time")
    second = _read(other, signals, None if time is None else str(time), how, bridge, findings)
    clock = None if same_clock else clock_between(first, second, (path, other))
    if clock is not None:
        findings.append(Finding("resampled", "", len(second["time"]), clock_line(clock, (path, other))))
    values = brought(first, second, clock)
    if len(values["time"]) < 2:
        raise ShakeError(f"{other}: was not recorded while {path} was")
    return values


def _steps(count: int, rate: float) -> npt.NDArray[np.float64]:
    if not (np.isfinite(rate) and rate > 0):
        raise ShakeError(f"--rate {rate:g}: a positive number of hertz is needed")
    return np.arange(count) / rate


def _check_time(path: Path, time: npt.NDArray[np.float64]) -> None:
    if len(time) < 2:
        raise ShakeError(f"{path}: {len(time)} rows of numbers, at least 2 are needed")
    if not np.isfinite(time).all():
        raise ShakeError(f"{path}: row {int(np.argmax(~np.isfinite(time))) + 1} of the table has no time")
    falls = np.diff(np.rint(time * 1e9)) <= 0
    if falls.any():
        row = int(np.argmax(falls)) + 2
        count = int(falls.sum())
        raise ShakeError(
            f"{path}: time does not rise at row {row} of the table ({time[row - 1]:.9g} s), {count} such rows"
        )
