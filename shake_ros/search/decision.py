"""Decision: the odds of one model against another, and which effects may stand for the one that explains most.

All verdicts rest on this one number. A difference of two models counts over what the better one leaves, by its
independent samples, as far as no block of the validation data speaks against it, and no more than on the data of the
fit; for a verdict only beyond what no model explains, since whatever makes that may make the difference as well.

The other model is often the same with one of its effects taken out, or exchanged for a rival (`without`,
`in_its_place`).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass

import numpy as np

from shake_ros.fit.free_parameters import FreeParameters, is_of_recording
from shake_ros.fit.least_squares import best_start
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.search.candidate_effects import CandidateEffect
from shake_ros.search.problem import ScoredFit, SearchProblem

PRIOR = math.log(30.0)  # nats against an effect: about so many are tried
MOST = 1e6  # odds that are reported


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


def tempered(gain: float, variance: float) -> float:
    """Gain in log likelihood that its variance lets count [nats].

    For models that are right the variance of the gain is twice its mean; where it is larger by a factor, the gain
    counts less by that factor.

    >>> tempered(100.0, 200.0), tempered(-100.0, 2000.0)
    (100.0, -10.0)
    """
    return math.copysign(min(abs(gain), 2.0 * gain * gain / max(variance, 1e-9)), gain)


def contradicted(gains: np.ndarray) -> float:
    """Variance of a gain by the blocks that speak against it [nats²].

    That the others differ is no scatter: an earthquake is loud for a few seconds.

    >>> contradicted(np.array([100.0, 1.0, 0.0])), contradicted(np.array([100.0, -10.0]))
    (0.0, 200.0)
    """
    against = np.minimum(gains * np.sign(np.sum(gains)), 0.0)
    return 2.0 * float(against @ against)


def price(effects: int, parameters: int, blocks: int) -> float:
    """What so many effects and parameters have to gain on data of so many blocks of time [nats]."""
    return effects * PRIOR + 0.5 * parameters * math.log(10 * blocks)


def unexplained(problem: SearchProblem, model: ScoredFit) -> float:
    """Validation cost that a model leaves beyond what may be noise [-]."""
    return max(model.validation_cost - problem.settings.remaining_above**2 * problem.validation.noise_cost(), 0.0)


def log_odds(model: ScoredFit, other: ScoredFit, effects: int = 0, left: float = 0.0) -> float:
    """Log odds of a model against another one [nats].

    No more than as much data as were fitted gain, or as many of these as there are validation data: often pieces are
    fitted, and all validation data judge.

    Parameters
    ----------
    effects : that it has in addition. left : cost that no model explains, beyond which its gain counts [-].
    """

    def variance(cost: float) -> float:
        """Of a weighted residual, at least that of what counts as noise, which has 1; for each independent one."""
        return max(cost, 1.0) * model.samples_for_one

    blocks = model.validation_blocks
    samples = max(len(model.fit.residuals), float(np.sum(blocks)) / max(model.validation_cost, 1e-300))
    fitted = samples * (other.estimation_cost - model.estimation_cost - left)
    fitted /= 2.0 * variance(model.estimation_cost)
    gains = other.validation_blocks - (1.0 + left / max(model.validation_cost, 1e-300)) * blocks
    gains /= 2.0 * variance(model.validation_cost)
    more = len(model.fit.x) - len(other.fit.x)
    gain = tempered(float(np.sum(gains)), contradicted(gains))
    return min(gain, fitted) - price(effects, more, len(blocks))


def odds_of(gain: float) -> float:
    """Odds of log odds, up to 10⁶.

    >>> odds_of(0.0), odds_of(50.0)
    (1.0, 1000000.0)
    """
    return min(math.exp(min(gain, 20.0)), MOST)


def decide(problem: SearchProblem, ranking: Sequence[Refit]) -> ForwardStep:
    """The best refit, with those that are indistinguishable from it; of these the best with usual values is named.

    Parameters
    ----------
    ranking : refits, the best first.
    """
    best, sure = ranking[0].result, math.log(problem.settings.sure)
    left = unexplained(problem, best)
    alike = [r for r in ranking if r is ranking[0] or log_odds(best, r.result, left=left) < sure]
    chosen = next((r for r in alike if r.usual), alike[0])
    ranking = (chosen, *(r for r in ranking if r is not chosen))
    return ForwardStep(chosen, ranking, tuple(r.candidate.effect for r in alike if r is not chosen))


MUCH_WORSE = 10.0  # times the score: without such an effect the model is so much worse that its fit need not converge


def without(
    problem: SearchProblem, current: ScoredFit, dropped: CandidateEffect, near: Sequence[TableParameters] = ()
) -> ScoredFit:
    """The fit with an effect taken out and everything else refitted; one that is far worse need not converge.

    near : tables near it. Where there are none, predictor runs lead to it.
    """
    settings = problem.settings
    free, start = taken_out(problem, current, dropped, near)
    reduced = problem.roughly(free, start, near=bool(near))
    if reduced.score < MUCH_WORSE * current.score:
        most = settings.continued_evaluations
        reduced = problem.fitted(free, reduced.fit.x, most, settings.converged, near=True)
    return reduced


def taken_out(
    problem: SearchProblem, current: ScoredFit, dropped: CandidateEffect, near: Sequence[TableParameters]
) -> tuple[FreeParameters, np.ndarray]:
    """What a model without one of its effects is free in, and where its fit starts: there, or at the best of tables."""
    result, names = current.fit, {f.name for f in dropped.free}
    keep = [i for i, f in enumerate(result.free.free) if f.name not in names]
    free = FreeParameters(result.free.base, [result.free.free[i] for i in keep])
    own = [i for i, name in enumerate(free.names) if not is_of_recording(name)]
    starts = np.tile(result.x[keep], (1 + len(near), 1))
    for row, table in zip(starts[1:], near, strict=True):
        row[own] = free.x_on(table)[own]
    return free, best_start(problem.estimation, free, starts) if near else starts[0]


def from_lesser(problem: SearchProblem, current: ScoredFit, lesser: ScoredFit) -> ScoredFit:
    """The current model refitted from the same without an effect: none is worse than that, once its fit has ended."""
    free, names = current.fit.free, lesser.fit.free.names
    rows = np.tile(current.fit.x, (2, 1))
    rows[:, [free.names.index(name) for name in names]] = lesser.fit.x
    strength = next(i for i, name in enumerate(free.names) if name not in names)
    rows[1, strength] = np.clip(0.0, free.low[strength], free.high[strength])
    return problem.converged_from(free, best_start(problem.estimation, free, rows))


def in_its_place(
    problem: SearchProblem, final: ScoredFit, step: ForwardStep, other: CandidateEffect, there: TableParameters
) -> ScoredFit:
    """The final model with another effect in the place of a step's, all parameters refitted.

    there : a table that has the other effect; the fit starts from its values.
    """
    start, own = final.fit, {f.name for f in step.chosen.candidate.free}
    keep = [i for i, name in enumerate(start.free.names) if name not in own]
    more = [f for f in other.free if f.name not in start.free.names]
    base = absent_on(start.free.base, [other], there)
    free = FreeParameters(base, [*(start.free.free[i] for i in keep), *more])
    x = free.x_of({f.name: there.value(f.name) for f in more})
    x[: len(keep)] = start.x[keep]
    settings = problem.settings
    return problem.fitted(free, x, settings.converging_evaluations, settings.continued_tolerance)


def rivals(steps: Sequence[ForwardStep], step: ForwardStep, most: int) -> list[Refit]:
    """Effects that came nearest to a step's, the nearest first, and all that were named beside it."""
    present = {s.chosen.candidate.effect for s in steps}
    others = [r for r in step.ranking if r.candidate.effect not in present]
    near = others[:most]
    return near + [r for r in others if r.candidate.effect in step.alternatives and r not in near]


def absent_on(base: TableParameters, among: Sequence[CandidateEffect], there: TableParameters) -> TableParameters:
    """A table on which some effects are absent until a fit moves their parameters.

    What an effect has beside these on the table `there`, such as the quantity of a function, it has here too; so a fit
    that drops the free parameters drops the effect.
    """
    moved = {p.name for c in among for p in c.free}
    kept = {
        name: value
        for c in among
        for key, value in asdict(there.effects[c.effect]).items()
        if (name := f"effects.{c.effect}.{key}") not in moved
    }
    return base.without([c.effect for c in among]).with_values(kept)
