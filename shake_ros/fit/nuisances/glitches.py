"""Glitches in a recorded command, which the valve never saw: spikes of a sample, and bursts of steps and ramps.

Where a logger samples at another rate than the controller writes, or a filter between them stumbles, each beat of the
two leaves samples that stand out from all that is around. The valve has not seen them where the velocity does not
answer: a finite impulse response g from the command u without glitches to the velocity, then the share h of the
glitches s that the rest shows, v − g∗u = h g∗s, each by least squares.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator
from scipy.ndimage import median_filter
from scipy.signal import butter, sosfiltfilt

from shake_ros.fit.records import Record

Floats = NDArray[np.float64]
RARE = 5.0  # of the robust deviation of the second differences, above which the command has a corner
LEAST = 1e-3  # second difference of a corner at least, in parts of the command's range
AROUND = 2.0  # over which that deviation is taken [s]
APART = 6  # samples between corners of one glitch at most
MILDER = 0.5  # sharpest corner that is left without a glitch, at most, in parts of that with it
FEWEST = 5  # glitches in a recording: a beat returns
FOLLOWED = 8.0  # up to which command and velocity are compared: commands reach as far [Hz]
LAGS = np.arange(-0.03, 0.081, 0.01)  # of the response, some before zero for the filters that look ahead [s]
SEEN = 0.5  # share from which the valve has seen the glitches


def glitches(commands: Floats, sample_time: float) -> list[NDArray[np.int64]]:
    """Samples of each glitch, ascending; none where there are fewer than FEWEST.

    A glitch lies between corners that are close together and nearly vanish without it: a step or a ramp alone has no
    corner near its own, and whatever takes the place of a pulse's edge is as sharp.

    >>> u = np.sin(np.arange(1000) / 20.0)
    >>> u[50::100] += 0.5
    >>> [each.tolist() for each in glitches(u, 0.001)][:3]
    [[50], [150], [250]]
    """
    size = _bends(commands)
    around = median_filter(size, min(round(AROUND / sample_time), len(size)), mode="nearest")
    limit = np.maximum(RARE * 1.4826 * np.maximum(around, np.median(size)), LEAST * np.ptp(commands))
    corners = np.flatnonzero(size > limit)
    groups = np.split(corners, np.flatnonzero(np.diff(corners) > APART) + 1) if len(corners) else []
    found = [np.arange(g[0] + 1, g[-1]) for g in groups if len(g) > 2]
    left = _bends(without(commands, found))
    found = [each for each in found if _sharpest(left, each) < MILDER * _sharpest(size, each)]
    return found if len(found) >= FEWEST else []


def _sharpest(bends: Floats, glitch: NDArray[np.int64]) -> float:
    """Largest bend of a glitch with the samples beside it."""
    return float(np.max(bends[glitch[0] - 1 : glitch[-1] + 2]))


def _bends(commands: Floats) -> Floats:
    """Distance of each sample from the middle of its neighbours, shape (n,)."""
    size = np.zeros(len(commands))
    size[1:-1] = np.abs(commands[1:-1] - 0.5 * (commands[:-2] + commands[2:]))
    return size


def without(commands: Floats, found: Sequence[NDArray[np.int64]]) -> Floats:
    """The command with what its neighbours make of it in the glitches."""
    if not found:
        return commands
    place, good = np.arange(len(commands)), np.ones(len(commands), dtype=bool)
    good[np.concatenate(found)] = False
    return np.asarray(PchipInterpolator(place[good], commands[good])(place))


def unseen_glitches(records: Sequence[Record]) -> list[list[NDArray[np.int64]]]:
    """The glitches of each recording that its valve has not seen; none of any where the motion follows them."""
    places = [glitches(r.commands, r.sample_time) for r in records]
    answered = shown = 0.0
    for record, at in zip(records, places, strict=True):
        if not at:
            continue
        smooth = without(record.commands, at)
        of_command, of_glitches = (_lagged(record, u) for u in (smooth, record.commands - smooth))
        velocity = _slow(record, record.velocity)
        response = np.linalg.lstsq(of_command, velocity, rcond=None)[0]
        expected = of_glitches @ response
        answered += float(expected @ (velocity - of_command @ response)) / record.sample_time
        shown += float(expected @ expected) / record.sample_time
    return places if answered < SEEN * shown or not shown else [[] for _ in places]


def _slow(record: Record, values: Floats) -> Floats:
    """What of a signal is slower than FOLLOWED, without mean and phase."""
    sections = butter(2, min(2.0 * FOLLOWED * record.sample_time, 0.9), output="sos")
    return np.asarray(sosfiltfilt(sections, values - np.mean(values)))


def _lagged(record: Record, drive: Floats) -> Floats:
    """The slow part of a drive, a column for each lag."""
    slow = _slow(record, drive)
    return np.column_stack([np.roll(slow, round(lag / record.sample_time)) for lag in LAGS])
