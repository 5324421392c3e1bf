"""Rules of the search: what it takes to add an effect, and when two effects are told apart.

Costs are mean squares of weighted residuals; those of the held-out recordings also block of time by block of time, so
that a difference can be held against its own scatter.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from scipy.special import stdtrit

from shake_ros.core.discovery.candidates import Candidate
from shake_ros.core.identification.fit import Fit


@dataclass(frozen=True)
class Policy:
    """How hard the search looks and what it takes for an improvement.

    refits : most candidates refitted per step. evaluations : most trial points of a first refit.
    polished : most candidates refitted further. final_evaluations : most trial points of such a refit.
    converging : most trial points of the chosen one. least_learned : fall of the fitted recordings' cost below which an
    effect is not added, however much it helps those held out. clear : fall of the held-out cost from which its spread
    over blocks of time is not asked for.
    worth_polishing : ratio to the best score up to which a candidate is refitted further.
    least_gain : fall of the held-out cost below which an effect is not added. margin : relative difference of
    held-out cost within which two effects count as not told apart. most_effects : stop after that many.
    rival : ratio to the best score up to which a candidate is converged as well, and is not told apart where the
    fitted and the held-out recordings prefer different ones.
    chance : probability with which a smaller fall, somewhere among all candidates tried, may be chance.
    significant : standard errors by which held-out costs must differ to tell effects within `rival` apart.
    least_screened : predicted gain below which a candidate is not refitted at first. much_left : ratio of the held-out
    cost to that of the noise from which the others are refitted too, before the search gives up.
    at_noise : ratio to the cost that the noise alone leaves, up to which nothing more is looked for.
    clearly_above, weak, far_less : a function without a name is estimated where the held-out cost is more than
    `clearly_above` times that of the noise and a listed effect leaves more than the part `weak` of it; it is taken
    where it leaves less than the part `far_less` of what the listed effect leaves.
    promising, freeing : parts of what stands above the noise that freeing a late parameter must promise, and take.
    """

    refits: int = 9
    evaluations: int = 5
    polished: int = 4
    final_evaluations: int = 25
    worth_polishing: float = 3.0
    converging: int = 60
    least_gain: float = 0.03
    least_learned: float = 0.003
    clear: float = 0.3
    chance: float = 0.03
    margin: float = 0.03
    rival: float = 1.3
    significant: float = 3.0
    most_effects: int = 3
    least_screened: float = 0.003
    much_left: float = 1.3
    at_noise: float = 1.05
    clearly_above: float = 2.0
    weak: float = 0.35
    far_less: float = 0.5
    promising: float = 0.2
    freeing: float = 0.4


@dataclass(frozen=True)
class Attempt:
    """A candidate refitted together with all free parameters. Costs are mean squares of weighted residuals.

    blocks : held-out cost of each block of time, shape (b,); empty where it was not asked for.
    """

    candidate: Candidate
    fit: Fit
    learn: float
    hold: float
    screened_gain: float
    blocks: np.ndarray = field(default_factory=lambda: np.zeros(0))

    @property
    def score(self) -> float:
        """Geometric mean of the two costs: small where both the fitted and the unseen recordings agree."""
        return math.sqrt(self.learn * self.hold)

    @property
    def usual(self) -> bool:
        """Whether its fitted values are such as are met on real tables."""
        table = self.fit.free.table(self.fit.x)
        return all(low <= table.value(name) <= high for name, (low, high) in self.candidate.usual.items())


def told_apart(best: Attempt, other: Attempt, policy: Policy, noise: float = 0.0) -> bool:
    """Whether the recordings decide between the best attempt and another one.

    They do not where the scores are all but equal, nor where they are near each other and either the fitted recordings
    speak for one of the two, those held out for the other, or the difference varies so much from block to block of the
    held-out recordings that it may be chance, or it is smaller than what the better of the two leaves unexplained above
    the noise: whatever makes that may make the difference as well.

    Parameters
    ----------
    noise : held-out cost that the sensor noise alone leaves [-]
    """
    if other.score <= (1.0 + policy.margin) * best.score:
        return False
    if other.score > policy.rival * best.score:
        return True
    if other.learn <= best.learn or other.hold <= best.hold or other.hold - best.hold < best.hold - noise:
        return False
    return significance(best, other) > policy.significant


def significance(best: Attempt, other: Attempt) -> float:
    """Mean over its standard error of the difference between two held-out costs, block by block; inf without blocks."""
    if len(best.blocks) < 2 or len(best.blocks) != len(other.blocks):
        return math.inf
    difference = other.blocks - best.blocks
    return float(np.mean(difference) / max(np.std(difference, ddof=1) / math.sqrt(len(difference)), 1e-300))


def beyond_chance(chance: float, tried: int, blocks: int) -> float:
    """Standard errors that the best of so many candidates exceeds with no more than this probability by chance [-].

    Bonferroni's bound on Student's distribution, since the standard error itself comes from a few blocks.

    >>> round(beyond_chance(0.03, 1, 1000), 2), round(beyond_chance(0.03, 30, 25), 2)
    (1.88, 3.47)
    """
    return float(-stdtrit(max(blocks - 1, 1), chance / max(tried, 1)))


def pays(best: Attempt, learn: float, blocks: np.ndarray, hold: float, policy: Policy, tried: int = 1) -> bool:
    """Whether an attempt is better than the model without it, beyond chance.

    Parameters
    ----------
    learn, hold, blocks : costs of the model without it on the recordings to learn from and on those held out, the
        latter block by block as well. tried : number of candidates of which this is the best.
    """
    if best.learn > (1.0 - policy.least_learned) * learn or best.hold > (1.0 - policy.least_gain) * hold:
        return False
    if best.hold <= (1.0 - policy.clear) * hold:
        return True
    without = Attempt(best.candidate, best.fit, learn, hold, 0.0, blocks)
    return significance(best, without) > beyond_chance(policy.chance, tried, len(blocks))
