"""References as files: config/reference/*.yaml and the record it names; a drive as such a pair, and where it played.

A table that keeps real time may lose single samples of a drive; few of them are put in by straight lines and counted,
more are an error. The reference on the graph, which has stamps of its own in real time, shows where the drive begins.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml
from numpy.typing import NDArray

from shake_ros.control.reference import REFERENCES
from shake_ros.control.reference.baseline import end_at_rest
from shake_ros.control.reference.motion import EarthquakeRecord, ReferenceParameters
from shake_ros.control.reference.program import Program, Shaping
from shake_ros.control.reference.recorded import RecordedParameters
from shake_ros.quantities import ShakeError, member_from
from shake_ros.recordings.accelerograms import read_accelerogram
from shake_ros.recordings.bags import TableRecording
from shake_ros.recordings.bags.table import ARRAYS
from shake_ros.result_folder import writing
from shake_ros.settings import find, read_yaml
from shake_ros.signals.stretches import energies, stretches


class Reference(NamedTuple):
    """A reference as configured: its kind, its parameters and the shaping."""

    kind: str
    parameters: ReferenceParameters
    shaping: Shaping


def load_reference(name: str) -> Reference:
    """Read config/reference/<name>.yaml, or a path that ends in .yaml.

    Raises ShakeError, naming the file, for an unknown name, an unknown or missing key, or a value out of bounds.
    """
    path = find("reference", name)
    content = read_yaml(path)
    shaping = content.pop("shaping", None) if isinstance(content, dict) and "kind" in content else {}
    if shaping is None:
        raise ShakeError(f"{path}: missing key 'shaping'")
    kind, parameters = member_from(content, REFERENCES, str(path), kind="reference")
    return Reference(kind, parameters, Shaping.from_mapping(shaping, f"{path}: shaping"))


def read_record(parameters: ReferenceParameters) -> EarthquakeRecord | None:
    """The accelerogram that the parameters name; None where they name none."""
    if not isinstance(parameters, RecordedParameters) or not parameters.record:
        return None
    found = read_accelerogram(Path(parameters.record).expanduser(), channel=parameters.channel, unit=parameters.unit)
    return EarthquakeRecord(found.time, found.acceleration)


def make_program(reference: Reference, sample_time: float) -> Program:
    """The program of a configured reference; reads the record it names, relative to the working directory."""
    record = read_record(reference.parameters)
    return Program(reference.kind, reference.parameters, reference.shaping, sample_time, record)


def build_program(name_or_path: str, sample_time: float) -> Program:
    """The program of config/reference/<name>.yaml or of a YAML file, `sample_time` in [s]."""
    return make_program(load_reference(name_or_path), sample_time)


NAME = "drive.yaml"


def write_drive(folder: Path, final: Path, drive: NDArray[np.float64], sample_time: float) -> Path:
    """drive.csv and drive.yaml, which names the file where it will lie, in `final`; the path of drive.yaml there.

    Parameters
    ----------
    drive : (n, 3) position, velocity, acceleration from rest to rest [m], [m/s], [m/s²]; what a recorded one has left
        at its end is taken out by a smooth course.
    sample_time : [s].
    """
    acceleration = end_at_rest(drive[:, 2], sample_time)
    time = np.arange(len(drive)) * sample_time
    reference = {**read_yaml(find("reference", "drive")), "record": str((final / "drive.csv").resolve())}
    text = "# A drive, played as it is.\n" + yaml.safe_dump(reference, sort_keys=False)
    with writing():
        np.savetxt(folder / "drive.csv", np.column_stack([time, acceleration]), fmt=("%.6f", "%.12e"), delimiter=",")
        (folder / NAME).write_text(text, encoding="utf-8")
    return final / NAME


Array = NDArray[np.float64]
MOST_MISSING = 0.01  # share of the samples that straight lines may put in
LONGEST_MISSING = 10  # of them in a row
SAME = 1e-9  # of a motion's power, within which two places fit as well
OTHER = 0.05  # rms of the velocity that was played beside the drive's, from which it is another motion


class Played(NamedTuple):
    """The samples of a drive, from its first one on, and how many of them straight lines put in."""

    recording: TableRecording
    missing: int


def played(recording: TableRecording, drive: Array, sample_time: float, name: str) -> Played:
    """The run of a drive (n, 3) [m], [m/s], [m/s²] in a recording.

    Raises
    ------
    ShakeError : no accelerometer or reference, another sampling rate, another motion, too many samples missing.
    """
    r = recording
    if r.acceleration is None or r.reference is None:
        raise ShakeError(f"{name}: no topic {'imu' if r.acceleration is None else 'reference'}")
    if abs(r.sample_time - sample_time) > 0.01 * sample_time:
        raise ShakeError(f"{name}: a sample every {r.sample_time:g} s, the motion has one every {sample_time:g} s")
    place = np.rint(r.time / sample_time).astype(np.int64)
    reference = _spread(r.reference, place)
    first = _begin(np.nan_to_num(reference[:, 2]), drive[:, 2])
    if first < 0 or first + len(drive) > len(reference):
        raise ShakeError(f"{name}: {len(reference)} samples of the graph do not contain the {len(drive)} of the motion")
    rows = slice(first, first + len(drive))
    missing = ~np.isfinite(_spread(r.acceleration, place)[rows] + _spread(r.position, place)[rows])
    count = int(missing.sum())
    longest = max((gap.stop - gap.start for gap in stretches(missing)), default=0)
    if count > MOST_MISSING * len(drive) or longest > LONGEST_MISSING:
        raise ShakeError(f"{name}: {count} of {len(drive)} samples are missing, {longest} in a row: not evaluated")
    off = reference[rows, 1] - drive[:, 1]
    known = np.isfinite(off)
    if not known.any() or np.sqrt(np.mean(off[known] ** 2)) > OTHER * np.std(drive[:, 1]):
        raise ShakeError(f"{name}: the motion that was played is not the one requested")
    return Played(_whole(r, place, rows, sample_time, name), count)


def _spread(values: Array, place: NDArray[np.int64]) -> Array:
    """The values at their places of an even row, NaN between."""
    row = np.full((int(place[-1]) + 1, *values.shape[1:]), np.nan)
    row[place] = values
    return row


def _begin(found: Array, wanted: Array) -> int:
    """Where one signal lies within another: the last of the places at which they differ least.

    The last, since what a recorder gets at its start may hold the run before of the same motion.
    """
    from scipy.signal import correlate

    if len(found) < len(wanted):
        return -1
    off = energies(found, len(wanted)) - 2.0 * correlate(found, wanted, mode="valid", method="fft")
    near = off <= np.min(off) + SAME * float(np.sum(wanted**2))
    return int(np.flatnonzero(near)[-1])


def _whole(r: TableRecording, place: NDArray[np.int64], rows: slice, sample_time: float, name: str) -> TableRecording:
    """The samples of these rows without a gap: lines between measured ones, the command held."""
    time = np.arange(rows.stop - rows.start) * sample_time

    def line(values: Array) -> Array:
        spread = _spread(values, place)[rows].reshape(len(time), -1)
        for column in spread.T:
            known = np.isfinite(column)
            if known.any():
                column[~known] = np.interp(time[~known], time[known], column[known])
        return spread.reshape(len(time), *values.shape[1:])

    command = _spread(r.valve_command, place)[: rows.stop]
    newest = np.maximum.accumulate(np.where(np.isfinite(command), np.arange(len(command)), 0))
    held = np.nan_to_num(command[newest])[rows]
    assert r.acceleration is not None
    others: dict[str, Any] = {one: line(getattr(r, one)) for one in ARRAYS if getattr(r, one) is not None}
    return replace(
        r,
        name=name,
        time=time,
        sample_time=sample_time,
        valve_command=held,
        position=line(r.position),
        acceleration=line(r.acceleration),
        segments=(slice(0, len(time)),),
        **others,
    )
