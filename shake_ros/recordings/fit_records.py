"""Recordings on disk → segments that a fit takes, divided at gaps and where the position jumps.

A gap of a few samples parts nothing: every part would begin in the midst of a motion with pressures that nobody knows,
which costs more than a line through a lost command. Filled samples are reported; their acceleration does not count.

A position that jumps within one sample has lost samples that its stamps do not show (a logger that stopped): the
leap is no motion, and a fit must not see it.

Rows of a laboratory's table that are missing or written twice are left out, or filled where that is asked for.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline

from shake_ros.fit.records import SHORTEST, Record
from shake_ros.quantities import ShakeError
from shake_ros.recordings.bags import TableRecording
from shake_ros.recordings.bags.series import broken
from shake_ros.signals.stretches import clipped, restored, stretches
from shake_ros.signals.velocity_filter import integrated

Floats = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
SHORT = 3  # samples of a gap that may be filled without being asked for
HELD = ("command",)  # signals with steps, between which a straight line is drawn; a spline would swing


def without_repeats(values: dict[str, Floats]) -> tuple[dict[str, Floats], int]:
    """A table without rows that repeat the row before to the last digit, and how many these were.

    >>> without_repeats({"time": np.array([0.0, 1.0, 1.0]), "u": np.array([3.0, 4.0, 4.0])})[1]
    1
    """
    table = np.column_stack(list(values.values()))
    same = np.zeros(len(table), dtype=np.bool_)
    same[1:] = ((table[1:] == table[:-1]) | (np.isnan(table[1:]) & np.isnan(table[:-1]))).all(axis=1)
    return {name: column[~same] for name, column in values.items()}, int(same.sum())


@dataclass(frozen=True)
class Bridged:
    """A table with its short gaps filled.

    Attributes
    ----------
    values : columns of shape (n,).
    rows : row of the table before that each sample is, −1 where it was absent, (n,).
    filled : samples of which some value was filled, (n,).
    """

    values: dict[str, Floats]
    rows: npt.NDArray[np.int64]
    filled: Flags

    def __getitem__(self, part: slice) -> Bridged:
        return Bridged({name: column[part] for name, column in self.values.items()}, self.rows[part], self.filled[part])

    @property
    def count(self) -> int:
        """Samples filled."""
        return int(self.filled.sum())

    @property
    def gaps(self) -> int:
        """Gaps filled."""
        return len(stretches(self.filled))


def bridged(values: Mapping[str, Floats], most: int) -> Bridged:
    """A table whose gaps of up to `most` samples are filled.

    Parameters
    ----------
    values : columns of shape (n,), NaN where a cell is empty; `time` rises. Absent rows are those at which the time
        goes on by more than a period.
    """
    number = _numbers(values["time"])
    count = int(number[-1]) + 1
    rows = np.full(count, -1)
    rows[number] = np.arange(len(number))
    whole, filled = np.arange(count), np.zeros(count, dtype=np.bool_)
    found: dict[str, Floats] = {"time": np.interp(whole, number, values["time"])}
    for name in values:
        if name == "time":
            continue
        column = np.full(count, np.nan)
        column[number] = values[name]
        finite = np.isfinite(column)
        fill = _short(~finite, most)
        if finite.sum() > 3 and fill.any():
            curve = np.interp(whole, whole[finite], column[finite])
            if name not in HELD:
                curve = np.asarray(CubicSpline(whole[finite], column[finite])(whole))
            column = np.where(fill, curve, column)
            filled |= fill
        found[name] = column
    kept = (rows >= 0) | _short(rows < 0, most)
    return Bridged({name: column[kept] for name, column in found.items()}, rows[kept], filled[kept])


def longest_short_gap(values: Mapping[str, Floats], most: int) -> int:
    """Samples of the longest gap among those of up to `most` samples; 0 where there is none."""
    number = _numbers(values["time"])
    finite = np.zeros(number[-1] + 1, dtype=np.bool_)
    finite[number] = np.all([np.isfinite(column) for column in values.values()], axis=0)
    return max((gap.stop - gap.start for gap in stretches(_short(~finite, most))), default=0)


def _numbers(time: Floats) -> npt.NDArray[np.int64]:
    """Number of the sample that each row is, from 0; stamps may be off by less than half a period."""
    stamps = np.rint((time - time[0]) * 1e9).astype(np.int64)
    steps = np.diff(time)
    steps = np.where(broken(stamps), np.maximum(np.rint(steps / np.median(steps)), 2.0), 1.0)
    number = np.concatenate(([0.0], np.cumsum(steps)))
    period, first = np.polyfit(number, time - time[0], 1)
    again = np.rint((time - time[0] - first) / period)  # on an even grid, where the stamps are near one
    number = again if (np.diff(again) >= 1.0).all() else number
    return (number - number[0]).astype(np.int64)


def _short(missing: Flags, most: int) -> Flags:
    """Of runs of missing samples those of up to `most` that have neighbours on both sides."""
    short = np.zeros(len(missing), dtype=np.bool_)
    for span in stretches(missing):
        if span.stop - span.start <= most and span.start > 0 and span.stop < len(missing):
            short[span] = True
    return short


SLOWEST = 0.1  # between two samples, from which none of a table's dynamics shows [s]
LEAP = 2.5  # steps of the position above this multiple of its fast ones …
FAST = 99.0  # … which are this percentile of all steps of the recording,
NEIGHBOURS = 4.0  # … and above this multiple of the largest step next to them, are leaps
LONGEST_FILLED = 0.015  # that more than one lost sample may last to be filled, SHORT samples at most [s]


def leaps(position: np.ndarray) -> np.ndarray:
    """Samples k at which the position has leapt since k − 1, ascending.

    >>> x = 1e-3 * np.sin(np.arange(400) / 20.0)
    >>> x[200:] += 1e-3
    >>> leaps(x).tolist()
    [200]
    """
    steps = np.abs(np.diff(position))
    if len(steps) < 3:
        return np.zeros(0, dtype=int)
    padded = np.concatenate([steps[1:2], steps, steps[-2:-1]])
    beside = np.maximum(padded[:-2], padded[2:])
    large = steps > np.maximum(LEAP * np.percentile(steps, FAST), NEIGHBOURS * beside)
    return np.asarray(np.flatnonzero(large) + 1)


def even_parts(recording: TableRecording, driven_by: str = "valve_command") -> list[Bridged]:
    """The segments of a recording without leap and longer gap that are long enough to fit, their short gaps filled.

    Their columns are time, command and, where they were measured, position, acceleration and pressure: that of chamber
    A less that of chamber B [Pa], NaN where its samples are not there.
    """
    columns = {"command": getattr(recording, driven_by)}
    if recording.position_measured:
        columns["position"] = recording.position
    if recording.acceleration is not None:
        columns["acceleration"] = recording.acceleration
    needed = np.isfinite(np.column_stack(list(columns.values()))).all(axis=1)
    if recording.load is not None:
        columns["pressure"] = recording.load
    found = list[Bridged]()
    for rows in _joined(recording, needed):
        whole = bridged({"time": recording.time[rows]} | {n: c[rows] for n, c in columns.items()}, SHORT)
        whole = replace(whole, rows=np.where(whole.rows < 0, -1, whole.rows + rows.start))
        cuts = leaps(whole.values["position"]) if recording.position_measured else ()
        parts = [whole[a:b] for a, b in zip([0, *cuts], [*cuts, len(whole.filled)], strict=True)]
        found += [part for part in parts if len(part.filled) * recording.sample_time >= SHORTEST]
    return found


def _joined(recording: TableRecording, measured: Flags) -> list[slice]:
    """Rows of the segments of a recording, those as one between which a few samples are lost and nothing else is."""
    most = max(1, min(SHORT, int(LONGEST_FILLED / recording.sample_time)))
    time, position = recording.time, np.nan_to_num(recording.position)
    fast = max((float(np.percentile(np.abs(np.diff(position[s])), FAST)) for s in recording.segments), default=0.0)
    found = list[slice]()
    for span in recording.segments:
        if found:
            last = found[-1].stop - 1
            periods = (time[span.start] - time[last]) / recording.sample_time
            leap = abs(position[span.start] - position[last]) > LEAP * fast * periods
            if 1.5 < periods < most + 1.5 and not leap and not measured[last + 1 : span.start].any():
                found[-1] = slice(found[-1].start, span.stop)
                continue
        found.append(span)
    return found


def fit_records(recording: TableRecording, driven_by: str = "valve_command") -> list[Record]:
    """The parts of a recording that a fit takes; a leap or a gap of more than SHORT samples is never bridged.

    Parameters
    ----------
    driven_by : the signal that drives the model: `valve_command` [-] or `force` [N].

    Raises
    ------
    ShakeError : where no part is long enough, samples are too far apart, the driving signal is not there, or it acted
        nowhere; where nothing moves; where a force drives and no position was measured.
    """
    drive = getattr(recording, driven_by)
    if drive is None:
        raise ShakeError(f"{recording.name}: no topic {driven_by}, which drives this model")
    if idle := [f for f in recording.findings if f.kind == "idle" and f.count == len(recording)]:
        raise ShakeError(f"{recording.name}: {idle[0]}: nothing to fit")
    if recording.sample_time > SLOWEST:
        raise ShakeError(
            f"{recording.name}: a sample every {recording.sample_time:.3g} s is too slow to show a table's dynamics; "
            "is the time in milliseconds? Import it with the scale 0.001"
        )
    if not all(np.isfinite(drive[span]).all() for span in recording.segments):
        raise ShakeError(f"{recording.name}: topic {driven_by} holds values that are not finite numbers")
    measured = recording.position_measured
    if driven_by == "force" and not measured:
        raise ShakeError(f"{recording.name}: no position was recorded, which this model needs")
    clip, records = clipped_in(recording), []
    for part in even_parts(recording, driven_by):
        acceleration = part.values.get("acceleration")
        if np.ptp(part.values["position" if measured else "acceleration"]) == 0.0:
            continue  # at rest to the last digit: neither motion nor noise to weigh it by
        if acceleration is not None and np.ptp(acceleration) == 0.0:
            acceleration = None  # a dead channel measures nothing
        command = part.values["command"]
        if measured:
            position = part.values["position"]
        else:
            position = integrated(part.values["acceleration"], command, recording.sample_time)
        before = float(command[0]) if part.rows[0] != 0 or recording.time[0] > 0.0 else 0.0
        pressure = part.values.get("pressure")
        if pressure is not None and not (np.isfinite(pressure).all() and np.ptp(pressure)):
            pressure = None
        signals = command, position, acceleration, pressure
        record = Record(
            recording.name, recording.sample_time, *signals, command_before=before, position_measured=measured
        )
        records.append(_without_unheard(record, part.filled, (part.rows >= 0) & clip[part.rows]))
    moving = recording.position if measured else recording.acceleration
    assert moving is not None
    if not np.ptp(moving[np.isfinite(moving)]):
        still = "joint_states: the position does not move" if measured else "imu: the acceleration does not change"
        raise ShakeError(f"{recording.name}: {still}, nothing to fit")
    if not records:
        raise ShakeError(
            f"{recording.name}: no segment of {SHORTEST:g} s without a gap of more than {SHORT} samples or a jump of "
            "the position; import_csv --bridge N fills gaps of up to N samples"
        )
    return records


def clipped_in(recording: TableRecording) -> Flags:
    """Samples at which the accelerometer of a recording is clipped, shape (n,)."""
    at = np.zeros(len(recording), dtype=np.bool_)
    if recording.acceleration is not None:
        seen = np.isfinite(recording.acceleration)
        at[seen] = clipped(recording.acceleration[seen]) if seen.any() else False
    return at


def _without_unheard(record: Record, filled: Flags, clip: Flags) -> Record:
    """The segment with its lost acceleration ignored; for spectra it follows the position there."""
    valid = ~filled & ~clip
    if record.acceleration is None or valid.all() or not valid.any():
        return record
    felt = restored(record.acceleration, clip & ~filled, np.gradient(record.velocity, record.sample_time))
    return replace(record, acceleration=felt, valid=valid)


def finding_lines(recording: TableRecording) -> list[str]:
    """What reading a recording met, a line each; one on lost samples, on a clipped accelerometer, on leaps."""
    lines = [f"{recording.name}: {finding}" for finding in recording.findings]
    used = even_parts(recording)
    if filled := sum(part.count for part in used):
        gaps = sum(part.gaps for part in used)
        lines.append(
            f"{recording.name}: {filled} lost samples in {gaps} gaps of up to {SHORT} are filled for fits by "
            "interpolation; their acceleration does not count in fits and errors"
        )
    if count := int(clipped_in(recording).sum()):
        lines.append(f"{recording.name}: imu: its {count} clipped samples do not count in fits and errors")
    position = np.nan_to_num(recording.position)
    found = [span.start + k for span in recording.segments for k in leaps(position[span]).tolist()]
    if found:
        seconds = sum(len(part.filled) for part in used) * recording.sample_time
        lines.append(
            f"{recording.name}: joint_states: the position jumps {len(found)} times, first at "
            f"{recording.time[found[0]]:.3f} s; divided there, {seconds:.1f} of {recording.time[-1]:.1f} s are used"
        )
    return lines
