"""Decision: which effects may stand for the one that explains most?

Costs are mean squares of weighted residuals; those of the validation data also block of time by block of time, so that
a difference can be held against its own scatter.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from shake_ros.core.discovery.candidates import CandidateEffect
from shake_ros.core.discovery.problem import ScoredFit
from shake_ros.core.discovery.search_settings import SearchSettings


@dataclass(frozen=True)
class Refit:
    """A candidate refitted together with all free parameters. predicted_gain : relative fall that was foreseen."""

    candidate: CandidateEffect
    result: ScoredFit
    predicted_gain: float

    @property
    def score(self) -> float:
        """Of its fit."""
        return self.result.score

    @property
    def usual(self) -> bool:
        """Whether its fitted values are such as are met on real tables."""
        table = self.result.fit.table
        return all(low <= table.value(name) <= high for name, (low, high) in self.candidate.usual.items())


def ranked(refits: Iterable[Refit]) -> tuple[Refit, ...]:
    """Refits, the best score first."""
    return tuple(sorted(refits, key=lambda r: r.score))


@dataclass(frozen=True)
class ForwardStep:
    """One added effect with the ranking it won and the alternatives that are indistinguishable from it."""

    chosen: Refit
    ranking: tuple[Refit, ...]
    alternatives: tuple[str, ...] = ()


def significance(better: np.ndarray, worse: np.ndarray) -> float:
    """Mean over its standard error of the difference of two costs, block by block; inf without blocks to compare."""
    if len(better) < 2 or len(better) != len(worse):
        return math.inf
    difference = worse - better
    return float(np.mean(difference) / max(np.std(difference, ddof=1) / math.sqrt(len(difference)), 1e-300))


def distinguishable(best: ScoredFit, other: ScoredFit, settings: SearchSettings, noise: float = 0.0) -> bool:
    """Whether the recordings decide between the best refit and another one.

    They do not where the scores are all but equal, nor where they are near each other and either the estimation data
    speak for one of the two, the validation data for the other, or the difference varies so much from block to block of
    the validation data that it may be chance, or it is smaller than what the better of the two leaves unexplained above
    the noise: whatever makes that may make the difference as well.

    Parameters
    ----------
    noise : validation cost that the sensor noise alone leaves [-]
    """
    if other.score <= (1.0 + settings.margin) * best.score:
        return False
    if other.score > settings.rival * best.score:
        return True
    difference = other.validation_cost - best.validation_cost
    if other.estimation_cost <= best.estimation_cost or difference <= 0.0 or difference < best.validation_cost - noise:
        return False
    return significance(best.validation_blocks, other.validation_blocks) > settings.significant


def decide(ranking: Sequence[Refit], settings: SearchSettings, noise: float) -> ForwardStep:
    """The best refit, with those that are indistinguishable from it; of these the best with usual values is named.

    Parameters
    ----------
    ranking : refits, the best first. noise : validation cost that the sensor noise alone leaves [-]
    """
    best = ranking[0].result
    alike = [r for r in ranking if r is ranking[0] or not distinguishable(best, r.result, settings, noise)]
    chosen = next((r for r in alike if r.usual), alike[0])
    ranking = (chosen, *(r for r in ranking if r is not chosen))
    return ForwardStep(chosen, ranking, tuple(r.candidate.effect for r in alike if r is not chosen))
