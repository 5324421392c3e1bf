"""The band in which the command explains the response, and what no filter of the command explains in it.

Noise in the valve, friction that catches and rings the oil column, and play shake a laboratory's table by as much as a
small earthquake does. Its phase is nobody's doing: a free run cannot have it, and a fit to it bends the table until the
run is calm. Above the highest frequency at which a linear filter of the command explains any of the acceleration, it
is compared no more; below, what the filter leaves counts as noise. A nonlinear table keeps its whole band: what its
nonlinearity adds to a wide command is partly coherent with it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from shake_ros.core.identification.recordings import ExplainedBand, Record
from shake_ros.core.identification.velocity_filter import low_pass

MEMORY, STEP = 1.0, 0.005  # of the filter, and between its coefficients [s]
EXPLAINS = 0.15  # part of the acceleration's power in a band, up to which the command explains nothing there
MUCH = 0.1  # part of its whole power that lies above at least
LOWEST, PER_OCTAVE = 2.0, 3  # bands that are looked at [Hz]


def explained_band(records: Sequence[Record]) -> float:
    """The frequency above which the command explains nothing of a good part of the acceleration [Hz]; else infinite."""
    if any(r.acceleration is None for r in records):
        return math.inf
    highest = 0.5 / max(r.sample_time for r in records)
    edges = np.geomspace(LOWEST, highest, round(PER_OCTAVE * math.log2(highest / LOWEST)) + 1)
    shares = np.mean([_shares(r, edges) for r in records], axis=0)
    explains = np.flatnonzero(shares[1] < (1.0 - EXPLAINS) * shares[0])
    edge = explains[-1] + 1 if len(explains) else 0
    return float(edges[edge]) if np.sum(shares[0, edge:]) > MUCH else math.inf


def _shares(record: Record, edges: np.ndarray) -> np.ndarray:
    """Acceleration by band and what a filter of the command leaves of it, in parts of its power, shape (2, m)."""
    felt = _felt(record)
    signals = np.array([felt, _unexplained(record, felt[:, None])[:, 0]])
    power = np.abs(np.fft.rfft(signals - signals.mean(axis=1, keepdims=True))) ** 2
    lines = np.fft.rfftfreq(len(felt), record.sample_time)
    above_noise = np.maximum(power - record.acceleration_noise() ** 2 * len(felt), 0.0)
    inside = (lines[:, None] >= edges[:-1]) & (lines[:, None] < edges[1:])
    return np.asarray(above_noise @ inside / power[0].sum())


def limited(records: Sequence[Record], band: float, learnt: Sequence[Record] = ()) -> list[Record]:
    """The recordings, compared below a frequency [Hz] alone; what the command does not explain there is their noise.

    The noise is what is left by the linear filter that explains most of the other recordings: a filter fitted to the
    recording itself would explain chance as well.

    Parameters
    ----------
    learnt : recordings to which such filters are fitted; a recording without others has its own.
    """
    equations = [_Normal.of(r) for r in learnt]
    found = []
    for r in records:
        signals = _signals(r)
        filters = _filters([n for n in equations if n.run != r.run and np.array_equal(n.lags, _lags(r))])
        left = low_pass(_unexplained(r, signals, filters).T, r.sample_time, band)
        whole = low_pass((signals - signals.mean(axis=0)).T, r.sample_time, band)
        levels = np.minimum(np.std(left, axis=1), np.std(whole, axis=1))  # the filter of another motion may not fit
        found.append(replace(r, explained=ExplainedBand(band, *levels.tolist())))
    return found


@dataclass(frozen=True)
class _Normal:
    """Normal equations of a recording's filters. square : shape (lags, lags). right : shape (lags, 2)."""

    run: int
    lags: np.ndarray
    square: np.ndarray
    right: np.ndarray

    @classmethod
    def of(cls, record: Record) -> _Normal:
        """Those of a recording."""
        terms, signals = _terms(record), _signals(record)
        return cls(record.run, _lags(record), terms.T @ terms, terms.T @ (signals - signals.mean(axis=0)))


def _felt(record: Record) -> np.ndarray:
    assert record.acceleration is not None
    return np.where(record.whole, record.acceleration, 0.0)[record.start :]


def _signals(record: Record) -> np.ndarray:
    """Velocity [m/s] and acceleration [m/s²] from the recording's `start` on, shape (n, 2)."""
    return np.column_stack([record.velocity[record.start :], _felt(record)])


def _lags(record: Record) -> np.ndarray:
    """Samples by which the terms of a filter are late."""
    return np.arange(0, round(MEMORY / record.sample_time), max(round(STEP / record.sample_time), 1))


def _terms(record: Record) -> np.ndarray:
    """The command at each lag of a filter about its mean, from the recording's `start` on, shape (n, lags)."""
    lags = _lags(record)
    u = np.concatenate([np.full(lags[-1], record.command_before), record.commands])
    n = len(record.commands)
    terms = np.column_stack([u[lags[-1] - k : lags[-1] - k + n] for k in lags])[record.start :]
    return np.asarray(terms - terms.mean(axis=0))


def _filters(equations: Sequence[_Normal]) -> np.ndarray | None:
    """The filters that explain most of velocity and acceleration of some recordings, shape (lags, 2); None of none."""
    if not equations:
        return None
    square = np.sum([e.square for e in equations], axis=0)
    right = np.sum([e.right for e in equations], axis=0)
    return np.asarray(np.linalg.lstsq(square, right, rcond=None)[0])


def _unexplained(record: Record, signals: np.ndarray, filters: np.ndarray | None = None) -> np.ndarray:
    """What filters of the command leave of signals, shape (n, k); those of least squares where none are given."""
    terms, signals = _terms(record), signals - signals.mean(axis=0)
    if filters is None:
        filters = np.linalg.lstsq(terms, signals, rcond=None)[0]
    return np.asarray(signals - terms @ filters)
