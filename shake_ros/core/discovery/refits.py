"""Refits of candidates, one by one and side by side, and what is measured on them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import TypeVar

import numpy as np

from shake_ros.core.discovery.judging import Attempt
from shake_ros.core.discovery.screening import Screened
from shake_ros.core.identification.fit import Fit, Problem, fit, jacobian
from shake_ros.core.identification.free_parameters import FreeParameters
from shake_ros.core.identification.recordings import RecordingProblem
from shake_ros.core.plant.simulation import workers

T = TypeVar("T")
CONVERGED = 1e-6  # relative change of cost and parameters at which the chosen fit stops
CARRIED = (0.7, 0.4, 0.15, 0.0)  # parts of an effect's strength on the way to its being replaced by another
PARTS = (0.25, 1.0, 2.5)  # multiples of a trial from which a refit may start


def mean_square(residuals: np.ndarray) -> float:
    """Mean square of weighted residuals."""
    return float(residuals @ residuals) / len(residuals)


def held_out(problem: Problem, result: Fit) -> float:
    """Mean square of a fit on recordings it has not seen."""
    return mean_square(np.nan_to_num(problem.residuals(result.free.vectors(result.x))[0], nan=1e6))


def held_out_blocks(problem: RecordingProblem, result: Fit) -> np.ndarray:
    """Mean square of a fit on recordings it has not seen, block of time by block of time, shape (b,)."""
    r = np.nan_to_num(problem.residuals(result.free.vectors(result.x))[0], nan=1e6)
    number = problem.blocks()
    return np.asarray(np.bincount(number, r**2) / np.maximum(np.bincount(number), 1))


def refit_start(problem: Problem, current: Fit, screened: Sequence[Screened]) -> tuple[Fit, np.ndarray]:
    """Best of a batch of starts for one candidate: its trials × parts × (old | predicted) other parameters."""
    candidate = screened[0].candidate
    free = current.free.extended(candidate.free)
    starts = []
    for s in screened:
        trial = dict(candidate.trials[s.trial])
        strength = candidate.strength.name
        signs = (-1.0, 1.0) if candidate.signed else (1.0,)
        parts = {*(sign * p for p in PARTS for sign in signs), s.part}
        for part in parts:
            values = {**trial, strength: candidate.neutral + part * (trial[strength] - candidate.neutral)}
            for others in (current.x, s.x):
                x = free.x_of(values)
                x[: len(current.x)] = others
                starts.append(np.clip(x, free.low, free.high))
    rows = np.array(starts)
    costs = np.array([mean_square(r) for r in np.nan_to_num(problem.residuals(free.vectors(rows)), nan=1e3)])
    return Fit(free, current.x, current.residuals, current.jacobian, current.cost, 0), rows[int(np.argmin(costs))]


def attempt(
    problem: Problem, hold: Problem, current: Fit, screened: Sequence[Screened], evaluations: int, tolerance: float
) -> Attempt:
    """Refit one candidate from its best start."""
    shell, start = refit_start(problem, current, screened)
    result = fit(problem, shell.free, start, evaluations=evaluations, tolerance=tolerance)
    return Attempt(
        screened[0].candidate, result, mean_square(result.residuals), held_out(hold, result), screened[0].gain
    )


def polish(
    problem: Problem, hold: RecordingProblem, tried: Attempt, evaluations: int, tolerance: float = 1e-4
) -> Attempt:
    """Continue a refit towards convergence."""
    return measured(
        hold, tried, fit(problem, tried.fit.free, tried.fit.x, evaluations=evaluations, tolerance=tolerance)
    )


def measured(hold: RecordingProblem, tried: Attempt, result: Fit) -> Attempt:
    """An attempt with another fit of its model, and the costs of that."""
    learn, unseen, blocks = mean_square(result.residuals), held_out(hold, result), held_out_blocks(hold, result)
    return replace(tried, fit=result, learn=learn, hold=unseen, blocks=blocks)


def carried_over(problem: Problem, hold: RecordingProblem, best: Attempt, other: Attempt, evaluations: int) -> Attempt:
    """The other attempt, or a better fit of its model at the end of a path from the best one's.

    The best one's effect is taken out in steps while the other takes over. Of two effects that can stand for each other
    one has its minimum in a long valley that a fit from elsewhere ends in too early.
    """
    candidate, strength = best.candidate, best.candidate.strength.name
    own = {f.name for f in candidate.free}
    keep = [i for i, name in enumerate(best.fit.free.names) if name not in own]
    declared = [best.fit.free.free[i] for i in keep]
    more = [f for f in other.candidate.free if f.name not in best.fit.free.names]
    there, here = best.fit.free.table(best.fit.x), other.fit.free.table(other.fit.x)
    values = {f.name: here.value(f.name) for f in more} | {other.candidate.strength.name: other.candidate.neutral}
    base, full = best.fit.free.base, there.value(strength)
    x = np.append(best.fit.x[keep], FreeParameters(base.with_values(values), more).start())
    for part in CARRIED:
        left = {f.name: there.value(f.name) for f in candidate.free if part > 0.0}
        left |= {strength: candidate.neutral + part * (full - candidate.neutral)} if part > 0.0 else {}
        free = FreeParameters(base.with_values(left), [*declared, *more])
        result = fit(problem, free, x, evaluations=evaluations, tolerance=CONVERGED if part == 0.0 else 1e-3)
        x = result.x
    return measured(hold, other, result) if result.cost < other.fit.cost else other


def on_problem(problem: Problem, result: Fit) -> Fit:
    """The same solution with the residuals and the Jacobian of another problem."""
    r = problem.residuals(result.free.vectors(result.x))[0]
    j = jacobian(problem, result.free, result.x, r)
    return Fit(result.free, result.x, r, j, 0.5 * float(r @ r), len(result.x) + 1)


def side_by_side(work: Callable[[T], Attempt], items: Sequence[T]) -> Iterator[Attempt]:
    """The same work on each item, in their order: fits do not depend on each other, and simulate without the GIL."""
    with ThreadPoolExecutor(workers()) as pool:
        yield from pool.map(work, items)
