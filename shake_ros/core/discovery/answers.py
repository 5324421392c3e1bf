"""The answers that a search has before its end, a line each."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from shake_ros.core.discovery.problem import ScoredFit, SearchProblem


def without_name(place: str, depends_on: Sequence[str], gain: float) -> str:
    """Where something acts that no effect of the list would explain, and on what it depends.

    gain : relative fall of the cost that is foreseen [-].
    """
    depends = " and ".join(name.replace("_", " ") for name in depends_on)
    promise = f"predicted to remove {100.0 * gain:.0f} % of the residual"
    return f"best so far: unlisted effect, place {place}, depends on {depends}, {promise}"


def found_by_now(problem: SearchProblem, names: Sequence[str], final: ScoredFit, declared: ScoredFit) -> str:
    """All that has been added, with what it leaves of the validation data."""
    noise = problem.validation.noise_cost()
    after, before = (np.sqrt(m.validation_cost / noise) for m in (final, declared))
    left = f"{after:.1f} × the noise on validation data (declared model: {before:.1f})"
    return f"best so far: {' + '.join(names)}, {left}"
