"""The band in which the command explains the response, and what no filter of the command explains in it.

Noise in the valve, friction that catches and rings the oil column, and play shake a laboratory's table by as much as a
small earthquake does. Its phase is nobody's doing: a free run cannot have it. Where much of the acceleration's power
lies above the frequency from which it is not coherent with the command for an octave, a run is compared below that
alone, and should be calm above. A disturbance at one frequency, such as the beat of two clocks, ends no band. What a
linear filter of the command leaves below counts as noise, at each frequency and at each time as much as there is: else
slow drift would hide a specimen's mode, and the loudest seconds all others. Little of what a nonlinear table does lies
beyond: what its nonlinearity adds to a wide command is partly coherent with it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.signal import csd, welch

from shake_ros.fit.records import ExplainedBand, Record
from shake_ros.signals.velocity_filter import low_pass, with_gains

SEGMENT, FEWEST = 4.0, 8  # length of the spectra's segments, in which a lightly damped mode rings out [s]; least number
SHORTEST = 0.5 * FEWEST * SEGMENT  # recording that tells [s]: what rings longer than a segment is not coherent in it
INDEPENDENT = 0.6  # part of the segments, which overlap by half
COHERENT = 0.15  # part of the acceleration's power in an octave, below which the command explains nothing there
MUCH = 0.1  # part of its whole power that lies above at least
LOWEST, PER_OCTAVE = 2.0, 3  # bands that are looked at [Hz]
MEMORY = 1.0  # of a filter [s]
LEAST_POWER = 1e-3  # of noise at a frequency in parts of its largest, and at a time in parts of its mean
NOTHING = 1e-300  # power of a signal that stands still
PER_PERIOD = 2.5  # coefficients of a filter in a period of the highest frequency


def explained_band(records: Sequence[Record]) -> float:
    """The frequency above which the command explains nothing of a good part of the acceleration [Hz]; else infinite."""
    long = [r for r in records if len(r.commands) * r.sample_time >= SHORTEST]
    if not long or any(r.acceleration is None for r in records):
        return math.inf
    highest = 0.5 / max(r.sample_time for r in records)
    edges = np.geomspace(LOWEST, highest, round(PER_OCTAVE * math.log2(highest / LOWEST)) + 1)
    whole, explained = np.mean([_shares(r, edges) for r in long], axis=0)
    above = np.cumsum(whole[::-1])[::-1]
    octaves = [np.convolve(each, np.ones(PER_OCTAVE))[PER_OCTAVE - 1 :] for each in (whole, explained)]
    beyond = (octaves[1] < COHERENT * octaves[0]) & (above > MUCH)
    return float(edges[np.argmax(beyond)]) if beyond.any() else math.inf


def _shares(record: Record, edges: np.ndarray) -> np.ndarray:
    """Acceleration by band beyond its sensor's noise, and what is coherent with the command, of all, shape (2, m)."""
    u, felt, rate = record.commands[record.start :], _felt(record), 1.0 / record.sample_time
    n = min(round(SEGMENT * rate), len(u) // FEWEST)
    lines, of_command = welch(u, rate, nperseg=n)
    power = welch(felt, rate, nperseg=n)[1]
    cross = csd(u, felt, rate, nperseg=n)[1]
    chance = 1.0 / (INDEPENDENT * (2 * len(u) // n - 1))
    coherence = np.abs(cross) ** 2 / np.maximum(of_command * power, 1e-300)
    coherence = np.maximum(coherence - chance, 0.0) / (1.0 - chance)
    above_noise = np.maximum(power - 2.0 * record.acceleration_noise() ** 2 / rate, 0.0)
    inside = (lines[:, None] >= edges[:-1]) & (lines[:, None] < edges[1:])
    return np.asarray(np.array([above_noise, coherence * above_noise]) @ inside / power.sum())


def limited(records: Sequence[Record], band: float, learnt: Sequence[Record] = ()) -> list[Record]:
    """The recordings, compared below a frequency [Hz] alone; what the command does not explain there is their noise.

    The noise is what is left by the linear filter that explains most of the other recordings: a filter fitted to the
    recording itself would explain chance as well.

    Parameters
    ----------
    learnt : recordings to which such filters are fitted; a recording without others has its own.
    """
    equations = [_Normal.of(r, band) for r in learnt]
    found = []
    for r in records:
        own = _Normal.of(r, band)
        others = [n for n in equations if n.run != r.run and n.right.shape == own.right.shape] or [own]
        square, right = np.sum([n.square for n in others], axis=0), np.sum([n.right for n in others], axis=0)
        told = own.terms @ np.linalg.lstsq(square, right, rcond=None)[0]
        # another motion's filter may not fit
        levels = np.minimum(np.std(own.signals - told, axis=0), np.std(own.signals, axis=0))
        signals = _signals(r)
        beyond = float(np.std(signals[:, 1] - own.signals[:, 1]))
        left = signals - signals.mean(axis=0) - told
        lines, gains = _whitening(left, r, band)
        below = low_pass(left.T, r.sample_time, band)
        white = [with_gains(v, r.sample_time, lines, g) for v, g in zip(below, gains, strict=True)]
        level = np.stack([_level(w, r) for w in white])
        found.append(replace(r, explained=ExplainedBand(band, beyond, tuple(levels.tolist()), lines, gains, level)))
    return found


def _whitening(left: np.ndarray, record: Record, band: float) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies [Hz] and gains by which signals, shape (n, 2), become white below a frequency [Hz], and as large."""
    rate = 1.0 / record.sample_time
    lines, power = welch(left, rate, nperseg=min(round(SEGMENT * rate), len(left)), detrend=False, axis=0)
    power = np.maximum(power, LEAST_POWER * np.max(power, axis=0)) + NOTHING
    inside = lines < band
    return lines, np.where(inside, np.sqrt(np.mean(power[inside], axis=0) / power).T, 0.0)


def _level(white: np.ndarray, record: Record) -> np.ndarray:
    """Root mean square of a signal about each sample of a recording, over that of all, shape (n,); from `start` on."""
    square = white**2 / np.mean(white**2 + NOTHING)
    square = uniform_filter1d(square, round(SEGMENT / record.sample_time), mode="nearest")
    return np.sqrt(np.pad(np.maximum(square, LEAST_POWER), (record.start, 0), mode="edge"))


@dataclass(frozen=True)
class _Normal:
    """What a recording tells of its filters below a frequency.

    signals : as `_signals` gives them, shape (n, m). terms : the command at each lag, shape (n, lags), both about
    their means. square, right : normal equations, shapes (lags, lags) and (lags, m).
    """

    run: int
    signals: np.ndarray
    terms: np.ndarray
    square: np.ndarray
    right: np.ndarray

    @classmethod
    def of(cls, record: Record, band: float) -> _Normal:
        """That of a recording from its `start` on."""
        step = max(round(1.0 / (PER_PERIOD * band * record.sample_time)), 1)
        lags, n = np.arange(0, round(MEMORY / record.sample_time), step), len(record.commands)
        u = np.concatenate([np.full(lags[-1], record.command_before), record.commands])
        u = low_pass(u, record.sample_time, band)
        terms = np.column_stack([u[lags[-1] - k : lags[-1] - k + n] for k in lags])[record.start :]
        signals = low_pass(_signals(record).T, record.sample_time, band).T
        terms, signals = terms - terms.mean(axis=0), signals - signals.mean(axis=0)
        return cls(record.run, signals, terms, terms.T @ terms, terms.T @ signals)


def _signals(record: Record) -> np.ndarray:
    """Velocity [m/s], acceleration [m/s²] and, where it was measured, load pressure [Pa], shape (n, 2 or 3)."""
    pressure = () if record.pressure is None else (record.pressure[record.start :],)
    return np.column_stack([record.velocity[record.start :], _felt(record), *pressure])


def _felt(record: Record) -> np.ndarray:
    assert record.acceleration is not None
    return np.where(record.whole, record.acceleration, 0.0)[record.start :]
