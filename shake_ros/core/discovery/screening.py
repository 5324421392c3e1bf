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


def screen(problem: Problem, fit: Fit, pool: tuple[Candidate, ...]) -> list[Screened]:
    """All trials of all candidates, the most promising first."""
    pairs, rows = _directions(problem, fit, pool)
    moved = problem.residuals(rows)
    q, triangle = np.linalg.qr(fit.jacobian)
    r = fit.residuals
    r_free = r - q @ (q.T @ r)
    total = float(r @ r)
    result = []
    for (i, j), other in zip(pairs, moved, strict=True):
        candidate = pool[i]
        d = other - r
        if not np.all(np.isfinite(d)):
            continue
        d_free = d - q @ (q.T @ d)
        power = float(d_free @ d_free)
        if power <= 1e-12 * total:
            continue
        part = -float(d_free @ r_free) / power
        part = float(np.clip(part, -LARGEST_PART if candidate.signed else 0.0, LARGEST_PART))
        left = r_free + part * d_free
        gain = 1.0 - float(left @ left) / total
        shift = np.linalg.lstsq(triangle, -q.T @ (r + part * d), rcond=1e-10)[0]
        result.append(Screened(candidate, j, gain, part, fit.x + np.clip(shift, -5.0, 5.0)))
    return sorted(result, key=lambda s: -s.gain)
