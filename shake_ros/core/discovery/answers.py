"""The answers that a search has before its end, a line each: what is promising, what leads, what has been found."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from shake_ros.core.discovery.problem import ScoredFit, SearchProblem


def promising(effect: str, gain: float) -> str:
    """The effect that promises most before anything is fitted to it. gain : relative fall of the cost [-]."""
    return f"best so far: {effect}, {_first_order(gain)}"


def without_name(place: str, depends_on: Sequence[str], gain: float) -> str:
    """Where something acts that no effect of the list would explain, and on what it depends."""
    depends = " and ".join(name.replace("_", " ") for name in depends_on)
    return f"best so far: unlisted effect, place {place}, depends on {depends}, {_first_order(gain)}"


def _first_order(gain: float) -> str:
    return f"predicted to remove {100.0 * gain:.0f} % of the residual"


def leads(problem: SearchProblem, effect: str, after: ScoredFit, before: ScoredFit) -> str:
    """The effect that is best so far."""
    return f"best so far: {effect}, {_held_out(problem, after, before)}"


def found_by_now(problem: SearchProblem, names: Sequence[str], final: ScoredFit, declared: ScoredFit) -> str:
    """All that has been added, with what it leaves."""
    return f"best so far: {' + '.join(names)}, {_held_out(problem, final, declared)}"


def _held_out(problem: SearchProblem, after: ScoredFit, before: ScoredFit) -> str:
    """What two models leave on validation data."""
    noise = problem.validation.noise_cost()
    ratios = [np.sqrt(m.validation_cost / noise) for m in (after, before)]
    return f"{ratios[0]:.1f} × the noise on validation data (declared model: {ratios[1]:.1f})"
