"""The one search: linearise, propose sets of effects, refit the best, take out what is not needed, until nothing helps.

    fit the model
    repeat
        linearise: its parameters, and every absent effect at finite trials
        propose sets of up to three effects by linear best-subset selection
        refit the best set of each size; keep the one with the best evidence
        take out what the set can do without
    until no set is worth it

The evidence of one model against another is the gain in log likelihood, on estimation and on validation data, tempered
by how much it varies from block to block, less a charge for each parameter and for the number of sets tried.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from shake_ros.fit.model import FreeModel, TriedEffect
from shake_ros.fit.prediction import Levels, Predictor, tuned
from shake_ros.fit.segment import Segment
from shake_ros.fit.solver import Budget, PredictorFit, fit
from shake_ros.search.proposal import EffectSet, linearised, proposals, start

Progress = Callable[[str], None]
PRIOR = math.log(30.0)  # nats against an effect: about so many are tried
OWN_LEVELS = ("force", "acceleration")  # levels of noise that are a recording's own
SHORT, LONG = 8, 16  # Jacobians of a fit that is to be compared, and of one that goes on
NO_FORCE, NO_NOISE = 0.004, 1.1  # random force in parts of the acceleration, and noise over the sensor's, that is none


@dataclass(frozen=True)
class SearchData:
    """Segments that are fitted, segments that choose between models."""

    estimation: tuple[Segment, ...]
    validation: tuple[Segment, ...]


@dataclass(frozen=True)
class Scored:
    """A fitted model, and its log likelihood on the validation data at their own levels of noise, by block, (b,)."""

    fitted: PredictorFit
    validation: np.ndarray

    @property
    def model(self) -> FreeModel:
        """The model."""
        return self.fitted.model


def tempered(better: np.ndarray, worse: np.ndarray) -> float:
    """Gain in log likelihood that its scatter from block to block lets count [nats].

    For models that are right the variance of the gain is twice its mean; where it is larger by a factor, the gain
    counts less by that factor.

    >>> blocks = np.random.default_rng(0).normal(2.0, 2.0, 400)
    >>> bool(abs(tempered(blocks, 0.0 * blocks) / np.sum(blocks) - 1.0) < 0.2)
    True
    """
    d = better - worse
    gain, variance = float(np.sum(d)), float(len(d) * np.var(d))
    return math.copysign(min(abs(gain), 2.0 * gain * gain / max(variance, 1e-9)), gain)


def evidence(more: Scored, less: Scored) -> float:
    """Log odds of one model against another, from estimation and validation data [nats]."""
    parameters = len(more.model.x) - len(less.model.x)
    effects = len(more.model.effects) - len(less.model.effects)
    blocks = len(more.fitted.likelihood)
    on_estimation = tempered(more.fitted.likelihood, less.fitted.likelihood) - 0.5 * parameters * math.log(10 * blocks)
    on_validation = tempered(more.validation, less.validation)
    return on_estimation + on_validation - effects * PRIOR


class SetSearch:
    """The search over one set of data.

    listed : effects that the model may lack. functions : of what no listed effect explains, made for a fitted model.
    budget : how long it may take. progress : called with a line of progress.
    """

    def __init__(
        self,
        data: SearchData,
        listed: Sequence[TriedEffect],
        functions: Callable[[PredictorFit], Sequence[TriedEffect]],
        budget: Budget,
        progress: Progress,
    ) -> None:
        self.data, self.listed, self.functions, self.budget, self.progress = data, listed, functions, budget, progress

    def scored(self, model: FreeModel, levels: Levels, steps: int) -> Scored:
        """A model fitted by so many steps, and scored."""
        fitted = fit(Predictor(self.data.estimation, levels), model, self.budget, steps=steps)
        vector = fitted.model.vectors(fitted.model.x)[0]
        seen = tuned(Predictor(self.data.validation, fitted.prediction.levels), vector, OWN_LEVELS)
        return Scored(fitted, seen.log_likelihood())

    def run(self, model: FreeModel, levels: Levels) -> tuple[Scored, Scored]:
        """The declared model and the best one that is found.

        With listed effects, and where these do not reach the noise with a function of what no listed effect explains.
        """
        self.progress("declared model: fit")
        declared = best = self.scored(model, levels, LONG)
        for candidates in (lambda _: self.listed, self.functions):
            while not self.budget.over() and not at_noise(best):
                found = self._step(best, candidates(best.fitted))
                if found is None:
                    break
                best = found
                self.progress(f"best so far: {names_of(best.model.effects)}")
        return declared, best

    def _step(self, best: Scored, candidates: Sequence[TriedEffect]) -> Scored | None:
        """A better model with a set of effects more, or none."""
        absent = [c for c in candidates if c.name not in best.model.effect_names]
        self.progress(f"screening {len(absent)} effects")
        lin = linearised(best.fitted, absent)
        winner = best
        for s in worth_trying(proposals(lin), len(best.fitted.likelihood)):
            if self.budget.over():
                break
            self.progress(f"refit with {' + '.join(s.names)}")
            result = self.scored(start(best.fitted, s), best.fitted.prediction.levels, SHORT)
            winner = result if evidence(result, winner) > 0.0 else winner
        if winner is best:
            return None
        longer = self.scored(winner.model, winner.fitted.prediction.levels, LONG)
        winner = self._reduced(longer if evidence(longer, winner) > 0.0 else winner)
        return winner if evidence(winner, best) > 0.0 else None

    def _reduced(self, found: Scored) -> Scored:
        """The model without what it can do without."""
        while len(found.model.effects) > 1 and not self.budget.over():
            tried = []
            for effect in found.model.effect_names:
                self.progress(f"is {effect} needed?")
                less = self.scored(found.model.without(effect), found.fitted.prediction.levels, SHORT)
                tried.append((evidence(found, less), less))
            value, less = min(tried, key=lambda t: t[0])
            if value > 0.0:
                return found
            found = less
        return found


def at_noise(found: Scored) -> bool:
    """Whether a model leaves no more than the noise of the sensors."""
    levels = found.fitted.prediction.levels
    return levels.force <= NO_FORCE and levels.acceleration <= NO_NOISE


def worth_trying(found: dict[int, list[EffectSet]], blocks: int) -> list[EffectSet]:
    """The best set of each size that promises more than it costs, and rivals of the best single effect."""

    def net(p: EffectSet) -> float:
        return p.gain - sum(PRIOR + 0.5 * len(t.candidate.free) * math.log(10 * blocks) for t in p.trials)

    chosen = list[EffectSet]()
    singles = [p for p in found.get(1, []) if net(p) > 0.0]
    if singles:
        chosen += [p for p in singles[:3] if net(p) > 0.5 * net(singles[0])]
    for size in (2, 3):
        best = max(found.get(size, []), key=net, default=None)
        if best is not None and chosen and net(best) > 1.05 * max(net(c) for c in chosen):
            chosen.append(best)
    return chosen


def names_of(effects: Sequence[TriedEffect]) -> str:
    """Effects for a reader."""
    return " + ".join(e.called for e in effects) or "nothing is missing"
