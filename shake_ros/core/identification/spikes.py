"""Spikes of one sample in a recorded command, which the valve never saw.

Where a logger samples at another rate than the controller writes, it may catch a word half written at each beat of the
two. Such a sample stands out from both neighbours and from all that is around. The valve has not seen it where the
velocity does not answer: a finite impulse response g from the command u without spikes to the velocity, then the share
h of the spikes s that the rest shows, v − g∗u = h g∗s, each by least squares.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt

from shake_ros.core.identification.recordings import Record

Floats = NDArray[np.float64]
RARE = 8.0  # of the robust deviation of the second differences, above which a sample is looked at
ALONE = 4.0  # times as large as any second difference around it
AROUND = 6  # samples on either side
OPPOSITE = 0.25  # second differences beside a spike are of the other sign, half as large; a corner has none there
FEWEST = 5  # in a recording: a beat returns
FOLLOWED = 8.0  # up to which command and velocity are compared: commands reach as far [Hz]
LAGS = np.arange(-0.03, 0.081, 0.01)  # of the response, some before zero for the filters that look ahead [s]
SEEN = 0.5  # share from which the valve has seen the spikes


def spikes(commands: Floats) -> NDArray[np.int64]:
    """Samples that are spikes, ascending; none where there are fewer than FEWEST.

    >>> u = np.sin(np.arange(1000) / 20.0)
    >>> u[50::100] += 0.5
    >>> spikes(u).tolist()
    [50, 150, 250, 350, 450, 550, 650, 750, 850, 950]
    """
    out = np.zeros(len(commands))
    out[1:-1] = commands[1:-1] - 0.5 * (commands[:-2] + commands[2:])
    size = np.abs(out)
    limit = RARE * 1.4826 * float(np.median(size))
    found = []
    for k in np.flatnonzero(size > max(limit, 1e-3 * float(np.ptp(commands)))).tolist():
        if not AROUND <= k < len(commands) - AROUND:
            continue
        beside = np.concatenate([size[k - AROUND : k - 1], size[k + 2 : k + AROUND + 1]])
        if max(out[k - 1] / out[k], out[k + 1] / out[k]) < -OPPOSITE and size[k] > ALONE * float(np.max(beside)):
            found.append(k)
    return np.array(found if len(found) >= FEWEST else [], dtype=np.int64)


def without(commands: Floats, places: NDArray[np.int64]) -> Floats:
    """The command with the mean of its neighbours at some samples."""
    if not len(places):
        return commands
    smooth = commands.copy()
    smooth[places] = 0.5 * (commands[places - 1] + commands[places + 1])
    return smooth


def unseen_spikes(records: Sequence[Record]) -> list[NDArray[np.int64]]:
    """The spikes of each recording that its valve has not seen; none of any where the motion follows them."""
    places = [spikes(r.commands) for r in records]
    answered = shown = 0.0
    for record, at in zip(records, places, strict=True):
        if not len(at):
            continue
        smooth = without(record.commands, at)
        of_command, of_spikes = (_lagged(record, u) for u in (smooth, record.commands - smooth))
        velocity = _slow(record, record.velocity)
        response = np.linalg.lstsq(of_command, velocity, rcond=None)[0]
        expected = of_spikes @ response
        answered += float(expected @ (velocity - of_command @ response)) / record.sample_time
        shown += float(expected @ expected) / record.sample_time
    return places if answered < SEEN * shown or not shown else [p[:0] for p in places]


def _slow(record: Record, values: Floats) -> Floats:
    """What of a signal is slower than FOLLOWED, without mean and phase."""
    sections = butter(2, min(2.0 * FOLLOWED * record.sample_time, 0.9), output="sos")
    return np.asarray(sosfiltfilt(sections, values - np.mean(values)))


def _lagged(record: Record, drive: Floats) -> Floats:
    """The slow part of a drive, a column for each lag."""
    slow = _slow(record, drive)
    return np.column_stack([np.roll(slow, round(lag / record.sample_time)) for lag in LAGS])
