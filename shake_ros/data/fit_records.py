"""Recordings on disk → records that a fit takes, each gapless segment by itself, parted where the position jumps.

A position that leaps within one sample has lost samples that its stamps do not tell (a logger that stood still): the
leap is no motion, and a fit must not see it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from shake_ros.core.analysis.clipping import clipped, restored
from shake_ros.core.identification.recordings import SHORTEST, Record
from shake_ros.core.quantities import ShakeError
from shake_ros.data.recordings import TableRecording

SLOWEST = 0.1  # between two samples, from which none of a table's dynamics shows [s]
LEAP = 2.5  # steps of the position above this multiple of its fast ones …
FAST = 99.0  # … which are this percentile of all steps of the recording,
NEIGHBOURS = 4.0  # … and above this multiple of the largest step next to them, are leaps


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


def unbroken(recording: TableRecording) -> list[slice]:
    """The segments of a recording without gap and leap that are long enough to fit."""
    parts = []
    for span in recording.segments:
        cuts = [span.start, *(span.start + leaps(recording.position[span])).tolist(), span.stop]
        parts += [slice(a, b) for a, b in zip(cuts[:-1], cuts[1:], strict=True)]
    return [p for p in parts if (p.stop - p.start) * recording.sample_time >= SHORTEST]


def fit_records(recording: TableRecording, driven_by: str = "valve_command") -> list[Record]:
    """The parts of a recording that a fit takes; a gap or a leap is never bridged.

    Parameters
    ----------
    driven_by : the signal that drives the model: `valve_command` [-] or `force` [N].

    Raises
    ------
    ShakeError : where no part is long enough, samples are too far apart, the driving signal is not there, or it acted
        nowhere.
    """
    drive = getattr(recording, driven_by)
    if drive is None:
        raise ShakeError(f"{recording.name}: no topic {driven_by}, which drives this model")
    if idle := [f for f in recording.findings if f.kind == "idle" and f.count == len(recording)]:
        raise ShakeError(f"{recording.name}: {idle[0]}: nothing to fit")
    if recording.sample_time > SLOWEST:
        raise ShakeError(
            f"{recording.name}: a sample every {recording.sample_time:.3g} s shows none of a table's dynamics; is the "
            "time in milliseconds? Import it with the scale 0.001"
        )
    records, at = [], clipped_in(recording)
    for span in unbroken(recording):
        if not np.all(np.isfinite(drive[span])):
            raise ShakeError(f"{recording.name}: topic {driven_by} holds values that are not finite numbers")
        if np.ptp(recording.position[span]) == 0.0:
            continue  # at rest to the last digit: neither motion nor noise to weigh it by
        acceleration = None if recording.acceleration is None else recording.acceleration[span]
        if acceleration is not None and np.ptp(acceleration) == 0.0:
            acceleration = None  # a dead channel measures nothing
        record = Record(
            recording.name,
            recording.sample_time,
            drive[span],
            recording.position[span],
            acceleration,
            standing=float(drive[span][0]) if span.start or recording.time[0] > 0.0 else 0.0,
        )
        records.append(record if acceleration is None else _without_clipped(record, at[span]))
    if not np.ptp(recording.position[np.isfinite(recording.position)]):
        raise ShakeError(f"{recording.name}: joint_states: the position stands still throughout, nothing to fit")
    if not records:
        raise ShakeError(
            f"{recording.name}: no stretch of {SHORTEST:g} s without a gap or a leap of the position; import_csv "
            "--bridge N fills gaps of up to N samples"
        )
    return records


def clipped_in(recording: TableRecording) -> NDArray[np.bool_]:
    """Samples at which the accelerometer of a recording is clipped, shape (n,)."""
    at = np.zeros(len(recording), dtype=np.bool_)
    if recording.acceleration is not None:
        seen = np.isfinite(recording.acceleration)
        at[seen] = clipped(recording.acceleration[seen]) if seen.any() else False
    return at


def _without_clipped(record: Record, at: NDArray[np.bool_]) -> Record:
    """The record with its clipped acceleration not heard; what looks at spectra sees it follow the position there."""
    if record.acceleration is None or not at.any() or at.all():
        return record
    felt = restored(record.acceleration, at, np.gradient(record.velocity, record.sample_time))
    return replace(record, acceleration=felt, heard=~at)


def finding_lines(recording: TableRecording) -> list[str]:
    """What reading a recording met, a line each, and one on where the position leaps."""
    lines = [f"{recording.name}: {finding}" for finding in recording.findings]
    if count := int(clipped_in(recording).sum()):
        lines.append(f"{recording.name}: imu: its {count} clipped samples count in no fit and in no error")
    found = [span.start + k for span in recording.segments for k in leaps(recording.position[span]).tolist()]
    if found:
        used = sum(p.stop - p.start for p in unbroken(recording)) * recording.sample_time
        lines.append(
            f"{recording.name}: joint_states: the position leaps {len(found)} times, first at "
            f"{recording.time[found[0]]:.3f} s; parted there, {used:.1f} of {recording.time[-1]:.1f} s are used"
        )
    return lines
