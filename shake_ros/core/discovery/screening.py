"""Screening: what would each effect, tried at finite values, take off the residual if everything else may adjust?

A score test along finite directions. With the fitted model's residual r and Jacobian J, and the residual r_t with the
effect tried at some values, the best linear combination r + J δ + s (r_t − r) over the parameters' change δ and the
effect's part s tells the cost that a refit would reach at least to first order, at the price of one simulation a trial.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shake_ros.core.discovery.candidates import Candidate
from shake_ros.core.identification.fit import Fit, Problem

LARGEST_PART = 3.0  # the linear prediction is not followed beyond this multiple of a trial


@dataclass(frozen=True)
class Screened:
    """One trial. gain : predicted relative fall of the cost. part : multiple s of the trial. x : start for a refit."""

    candidate: Candidate
    trial: int
    gain: float
    part: float
    x: np.ndarray


def _directions(problem: Problem, fit: Fit, pool: tuple[Candidate, ...]) -> tuple[list[tuple[int, int]], np.ndarray]:
    """(candidate, trial) pairs and the full parameter vectors to try, in one batch."""
    base = fit.free.vectors(fit.x)[0]
    pairs, rows = [], []
    for i, candidate in enumerate(pool):
        for j, trial in enumerate(candidate.trials):
            table = fit.free.table(fit.x).with_values(trial)
            row = table.vector()
            row[fit.free.columns] = base[fit.free.columns]
            pairs.append((i, j))
            rows.append(row)
    return pairs, np.array(rows)


def explained(r: np.ndarray, jacobian: np.ndarray, d: np.ndarray, signed: bool) -> tuple[float, float]:
    """Relative fall of the cost by r + J δ + s d, and the best s within ±LARGEST_PART."""
    q, _ = np.linalg.qr(jacobian)
    r_free, d_free = r - q @ (q.T @ r), d - q @ (q.T @ d)
    power, total = float(d_free @ d_free), float(r @ r)
    if power <= 1e-12 * total:
        return 0.0, 0.0
    part = -float(d_free @ r_free) / power
    part = float(np.clip(part, -LARGEST_PART if signed else 0.0, LARGEST_PART))
    left = r_free + part * d_free
    return 1.0 - float(left @ left) / total, part


def screen(problem: Problem, fit: Fit, pool: tuple[Candidate, ...], seen: int | None = None) -> list[Screened]:
    """All trials of all candidates, the most promising first.

    Parameters
    ----------
    problem, fit : the current fit with its residuals and Jacobian on this problem.
    seen : number of leading residuals that a refit sees, the others are held out. A trial is as promising as the better
        of what it promises on those and on all: an effect that the fitted recordings hardly show may be what the others
        lack. The start for a refit comes from those that it sees.
    """
    pairs, rows = _directions(problem, fit, pool)
    moved = problem.residuals(rows)
    seen = len(fit.residuals) if seen is None else seen
    r, j = fit.residuals, fit.jacobian
    q, triangle = np.linalg.qr(j[:seen])
    result = []
    for (i, trial), other in zip(pairs, moved, strict=True):
        candidate = pool[i]
        d = other - r
        if not np.all(np.isfinite(d)):
            continue
        gain, part = explained(r[:seen], j[:seen], d[:seen], candidate.signed)
        if seen < len(r):
            gain = max(gain, explained(r, j, d, candidate.signed)[0])
        if gain <= 0.0:
            continue
        shift = np.linalg.lstsq(triangle, -q.T @ (r + part * d)[:seen], rcond=1e-10)[0]
        result.append(Screened(candidate, trial, gain, part, fit.x + np.clip(shift, -5.0, 5.0)))
    return sorted(result, key=lambda s: -s.gain)
