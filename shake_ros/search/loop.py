"""The one search: linearise, propose sets of effects, refit the best, take out what is not needed, until nothing helps.

    fit the model
    repeat
        linearise: its parameters, and every absent effect at finite trials
        propose sets of up to three effects by linear best-subset selection
        begin to refit the best sets of each size, go on with the better half; keep the one that gains most beyond its
            price, of those with evidence if any
        take out what it can do without
        where all its gain is on the data of the fit, go one step on from it
    until no set is worth it
    take out what the model can do without
    refit what could stand in the place of each effect

The evidence of one model against another is the gain in log likelihood, on estimation and on validation data, tempered
by how much it varies from block to block, less a charge for each parameter and for the number of sets tried, and less
a part of what is left by which every effect has to change it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from shake_ros.fit.likelihood import Levels, Likelihood
from shake_ros.fit.model import FreeModel, TriedEffect
from shake_ros.fit.solver import STEPS, Budget, PredictorFit, descend, fit
from shake_ros.search.decision import price, tempered
from shake_ros.search.proposal import EffectSet, Linearised, linearised, proposals, start, weakest

Progress = Callable[[str], None]
ROUNDS = 1, 2, 4  # Jacobians of the fits of many sets, of the better half of them, and of those left
LONG = 16  # of a fit that goes on
SETTLED = 3.0  # gain in log likelihood from which a fit goes on [nats]
MORE = 1.05  # times what a part of it gains, from which a set is fitted further
TIGHT = 0.03  # random force of the other start of the first fit, in parts of the acceleration: a loose one can stay so
WORSE = 1.5  # times what the best set leaves, from which another one is fitted no further
FIELD, CLOSEST = 4, 3  # sets of each size whose fit is begun, and sets that are refitted
PROMISE, ALIKE = 0.5, 0.8  # part of an effect's gain that a rival has to promise at first order, and to take


@dataclass(frozen=True)
class SearchData:
    """Recordings that are fitted, recordings that choose between models."""

    estimation: Likelihood
    validation: Likelihood


@dataclass(frozen=True)
class Start:
    """An effect at values by dotted name, from which a fit may start."""

    effect: TriedEffect
    values: Mapping[str, float]

    def on(self, model: FreeModel) -> FreeModel:
        """A model with it."""
        return model.with_effect(self.effect, self.values)


@dataclass(frozen=True, eq=False)
class Scored:
    """A fitted model, its prediction of the validation data at their own levels of noise, and log likelihoods, (b,)."""

    fitted: PredictorFit
    seen: Likelihood
    validation: np.ndarray

    @property
    def model(self) -> FreeModel:
        """The model."""
        return self.fitted.model

    @property
    def by_block(self) -> np.ndarray:
        """Log likelihood by block of the estimation data, then of the validation data, shape (b,)."""
        return np.concatenate([self.fitted.likelihood, self.validation])

    @property
    def levels(self) -> Levels:
        """Levels of noise of its estimation data."""
        return self.fitted.prediction.levels

    @property
    def count(self) -> int:
        """Number of residuals of estimation and validation data."""
        return self.fitted.prediction.count + self.seen.count

    @property
    def data(self) -> SearchData:
        """The recordings with the null shifts that it tells."""
        return SearchData(self.fitted.prediction, self.seen)


def evidence(more: Scored, less: Scored) -> float:
    """Log odds of one model against another, from estimation and validation data [nats].

    No more counts than the fit gained on its own data: what only the validation data gain is chance.
    """
    gains = gains_by_block(more, less)
    fitted = float(np.sum(gains[: len(more.fitted.likelihood)]))
    return min(_scattered(gains), fitted) - price_over(more, less)


def gains_by_block(more: Scored, less: Scored) -> np.ndarray:
    """Gain by block beyond that by which an effect counts, shape (b,) [nats]."""
    effects, gained = len(more.model.effects) - len(less.model.effects), more.by_block - less.by_block
    return np.asarray(gained - effects * more.seen.floor * more.count / len(gained))


def _scattered(gains: np.ndarray) -> float:
    """A gain given by block, shape (b,), as its scatter from block to block lets it count [nats].

    A block that gains more than the others counts as much as leaves most in all: more of a gain is never less.

    >>> _scattered(np.array([100.0, 0.0])), _scattered(np.array([9.0, 11.0, 9.0, 11.0, 1000.0]))
    (4.0, 51.0)
    """
    capped = np.minimum(gains, np.append(np.inf, gains[gains > 0.0])[:, None])
    return max(tempered(total, len(gains) * spread) for total, spread in zip(capped.sum(1), capped.var(1), strict=True))


def price_over(more: Scored, less: Scored) -> float:
    """What a model has to gain on another for what it has in addition [nats]."""
    effects, parameters = len(more.model.effects) - len(less.model.effects), len(more.model.x) - len(less.model.x)
    return price(effects, parameters, len(more.fitted.likelihood))


@dataclass(frozen=True)
class Contender:
    """A set of effects in a model whose fit has begun.

    left : half the sum of squares. gain : in log likelihood, with all that is left counted as noise, beyond what the
    set has to gain [nats].
    """

    of: EffectSet
    model: FreeModel
    left: float
    gain: float


class SetSearch:
    """The search over one set of data.

    listed : effects that the model may lack. budget : how long it may take. progress : called with a line of progress.
    shown : start of an effect that the recordings show without a model. certain : effects that stay in the model
    whatever its evidence, as what shows without it is stronger; the free runs of the end decide on them.
    """

    def __init__(
        self,
        data: SearchData,
        listed: Sequence[TriedEffect],
        budget: Budget,
        progress: Progress,
        shown: Start | None = None,
        certain: Sequence[str] = (),
    ) -> None:
        self.data, self.listed, self.budget, self.progress = data, listed, budget, progress
        self.shown, self.certain = shown, certain
        self._known = dict[Scored, Linearised]()
        self._fits = dict[frozenset[str], Scored]()
        self._without = dict[tuple[frozenset[str], str], Scored]()
        self._begun = Levels()

    def scored(self, model: FreeModel, steps: int, data: SearchData, *levels: Levels) -> Scored:
        """A model fitted by so many steps, and scored; the best fit of the same effects so far if that is better.

        data : with the null shifts from which it starts. levels : of noise; it goes on from those under which its
        first steps lead to the likeliest model.
        """
        fitted = fit([data.estimation.with_levels(each) for each in levels], model, self.budget, steps=steps)
        known = self._fits.get(frozenset(model.effect_names))
        if known is not None and known.fitted.total >= fitted.total:
            return known
        vector = fitted.model.vectors(fitted.model.x)[0]
        validation = data.validation.with_levels(fitted.prediction.levels)
        seen = validation.tuned(vector, validation.own_levels)
        self._fits[frozenset(model.effect_names)] = found = Scored(fitted, seen, seen.log_likelihood())
        return found

    def without(self, found: Scored, effect: TriedEffect) -> Scored:
        """The model without an effect, fitted from where it stands, at its own levels of noise or at those of the model
        before any effect was added, which lacks more.

        Asked once of a set of effects: one that is needed in it stays needed as the set is fitted further.
        """
        key = frozenset(found.model.effect_names), effect.name
        if key not in self._without:
            self.progress(f"is {effect.called} needed?")
            self._without[key] = self.scored(
                found.model.without(effect.name), LONG, found.data, found.levels, self._begun
            )
        return self._without[key]

    def reduced(self, found: Scored) -> dict[str, Scored]:
        """The models without one of its effects that have been fitted, by effect."""
        names = frozenset(found.model.effect_names)
        return {e.name: self._without[k] for e in found.model.effects if (k := (names, e.name)) in self._without}

    def _optional(self, found: Scored) -> list[TriedEffect]:
        """Effects that a model may do without."""
        return [e for e in found.model.effects if e.name not in self.certain]

    def settled(self, found: Scored) -> Scored:
        """A model fitted until that gains no more."""
        while not (found.fitted.settled or self.budget.over()):
            longer = self.scored(found.model, LONG, found.data, found.levels)
            if not longer.fitted.total > found.fitted.total + SETTLED:
                break
            found = longer
        return found

    def run(self, model: FreeModel, loose: Levels) -> Iterator[Scored]:
        """The declared model, then each better one that is found.

        loose : levels of noise that leave room for the errors of a model before its fit.
        """
        self.progress("declared model: fit")
        best = self.scored(model, LONG, self.data, loose, replace(loose, force=TIGHT))
        self._begun = best.levels
        yield best
        if self.shown:
            self.progress(f"refit with {self.shown.effect.called}, which the recordings show")
            best = self.scored(self.shown.on(best.model), LONG, best.data, best.levels)
            yield best
        while not self.budget.over():
            found = self._step(best)
            if found is None:
                break
            best = found
            self.progress(f"best so far: {names_of(best.model.effects)}")
            yield best
        yield self._needed(best)

    def rivals(self, best: Scored) -> dict[str, list[Scored]]:
        """Models with another effect in the place of each one found that explain nearly as much."""
        found: dict[str, list[Scored]] = {}
        for effect in self._optional(best):
            if self.budget.over():
                break
            less = self.without(best, effect)
            self.progress(f"what could stand in the place of {effect.called}?")
            taken = gain(best, less)
            promised = {s.trials[0].candidate.name: s for s in proposals(self._screened(less), 1)[1]}
            own = promised.get(effect.name)
            others = [s for n, s in promised.items() if n not in best.model.effect_names]
            near = [s for s in others if own and s.gain > PROMISE * own.gain][:CLOSEST]
            field = self._raced(less, [own, *near]) if own and near else []
            tried = self._refitted(less, [c for c in field if c.of is not own])
            found[effect.name] = [t for t in tried if gain(t, less) > ALIKE * taken]
        return found

    def _step(self, best: Scored, against: Scored | None = None) -> Scored | None:
        """A better model with a set of effects more, or none.

        A set whose gain is all on the data of the fit may be a part of what is missing: one step goes on from there.

        against : the model that it has to be better than, where that is another one.
        """
        better = against or best
        promised = proposals(self._screened(best))
        promising = [s for sets in promised.values() for s in sets[:FIELD] if s.gain > asked(s, best)]
        tried = self._refitted(best, self._raced(best, promising))
        if not tried:
            return None
        sure = [t for t in tried if evidence(t, better) > 0.0]
        winner = self.settled(max(sure or tried, key=lambda t: gain(t, best) - price_over(t, best)))
        fitted = _scattered(gains_by_block(winner, best)[: len(best.fitted.likelihood)]) > price_over(winner, best)
        if not (fitted or evidence(winner, better) > 0.0):
            return None
        kept = self.settled(self._reduced(winner))
        same = set(kept.model.effect_names) == set(better.model.effect_names)
        if evidence(kept, better) > (SETTLED if same else 0.0):
            return kept
        return self._step(winner, best) if fitted and against is None else None

    def _raced(self, found: Scored, sets: Sequence[EffectSet]) -> list[Contender]:
        """A model with each of the few that explain most of some sets more: what sets promise parts with the first
        steps of their fits, and the better half goes on (successive halving: Jamieson and Talwalkar 2016).

        These stand beside the small random force of the screening, as a likelier one would follow what a set explains.
        """
        fitted = self._screened(found).fitted
        prediction, began = fitted.prediction, _half_squares(fitted.prediction, fitted.model)

        def further(c: Contender, steps: int) -> Contender:
            model = descend(prediction, c.model, steps, SETTLED, self.budget)[0]
            left = _half_squares(prediction, model)
            return Contender(c.of, model, left, 0.5 * prediction.count * math.log(began / left) - asked(c.of, found))

        field = [Contender(s, start(fitted, s), began, 0.0) for s in sets if not self.budget.over()]
        if len(field) > 1:
            self.progress(f"first steps with each of {len(field)} sets of effects")
        for steps in ROUNDS:
            field = best_half([further(c, steps) for c in field if not self.budget.over()])
        return field

    def _refitted(self, found: Scored, field: Sequence[Contender]) -> list[Scored]:
        """The contenders for what is added to a model, at their own levels of noise."""
        levels, fitted = self._screened(found).fitted.prediction.levels, list[Scored]()
        for c in field:
            if self.budget.over():
                break
            self.progress(f"refit with {' + '.join(c.of.names)}")
            fitted.append(self.scored(c.model, STEPS, found.data, levels))
        return fitted

    def _screened(self, found: Scored) -> Linearised:
        """A model with every effect that it lacks, to first order; remembered, since rivals ask as well."""
        if found not in self._known:
            absent = [c for c in self.listed if c.name not in found.model.effect_names]
            self.progress(f"screening {len(absent)} effects")
            vector = found.model.vectors(found.model.x)[0]
            fitted = replace(found.fitted, prediction=found.fitted.prediction.closer(vector))
            self._known[found] = linearised(fitted, absent, beside=(found.seen.closer(vector),)).dispersed()
        return self._known[found]

    def _reduced(self, found: Scored) -> Scored:
        """The model without what it can do without."""
        while (others := self._optional(found)) and not self.budget.over():
            less = self.without(found, weakest(found.fitted, others))
            if evidence(found, less) > 0.0:
                break
            found = less
        return found

    def _needed(self, found: Scored) -> Scored:
        """The model once each of its effects has been asked whether it is needed."""
        for effect in self._optional(found):
            if self.budget.over():
                break
            less = self.without(found, effect)
            if not evidence(found, less) > 0.0:
                return self._needed(self.settled(less))
        return found


def _half_squares(prediction: Likelihood, model: FreeModel) -> float:
    return 0.5 * float(np.sum(prediction.residuals(model.vectors(model.x)) ** 2))


def gain(more: Scored, less: Scored) -> float:
    """Gain in log likelihood on estimation and validation data [nats]."""
    return more.fitted.total - less.fitted.total + float(np.sum(more.validation - less.validation))


def asked(s: EffectSet, found: Scored) -> float:
    """What a set of effects has to gain on a model [nats]."""
    parameters = sum(len(t.candidate.free) for t in s.trials)
    least = Likelihood.floor * found.count  # of any kind: free runs promise far less than they gain
    return price(len(s.trials), parameters, len(found.fitted.likelihood)) + len(s.trials) * least


def best_half(field: Sequence[Contender]) -> list[Contender]:
    """The better half, and a few at least: each with an effect that no better one has; none that leaves far more than
    another, or gains hardly more than a part of it.
    """
    kept, known, most = list[Contender](), set[str](), WORSE * min((c.left for c in field), default=0.0)
    for c in sorted((c for c in field if c.left < most), key=lambda c: -c.gain):
        names = set(c.of.names)
        if not (names <= known or any(set(o.of.names) < names and c.gain < MORE * o.gain for o in field)):
            kept.append(c)
            known |= names
    return kept[: max(len(field) // 2, CLOSEST)]


def names_of(effects: Sequence[TriedEffect]) -> str:
    """Effects for a reader."""
    return " + ".join(e.called for e in effects) or "nothing is missing"
