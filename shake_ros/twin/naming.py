"""What changed? Every candidate effect and every followed parameter, tried on the windows behind and before a change.

A hypothesis is one effect that came, or one followed parameter that moved, while all others stay where they were known,
within what they wander. They are screened by a score test: a linearisation where no change is likeliest
(search/proposal.py), with all parameters as far off as their priors let them. The best are refitted until they have
converged, and compared by their marginal likelihood on the windows since, against
that of no change: with likelihood ℓ, prior p of the one number that changed, prior precision P of all others together
(their ratios are known far better than their common scale), normal matrix A at the refit,

    E = ℓ + log p(δ) + ½ log |P| − ½ log |A| + ½ log 2π

p is a Cauchy density whose half-width is the scale of a change that matters. An effect that would have to appear has
PRIOR nats against it; a followed parameter changes in service. What an effect would also have gained before the change
is no evidence for a change and is taken off.

The answer is every hypothesis with positive evidence that lies within RIVAL nats of the best, or whose prediction
differs from the best one's by less than that in expected log likelihood, ½ |r − r_best|²: these windows cannot
distinguish the two, whatever the prior.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from shake_ros.declared import effect_candidates, sized
from shake_ros.fit.declared_model import FULL
from shake_ros.fit.free_parameters import FreeParameter
from shake_ros.fit.likelihood import Levels
from shake_ros.fit.model import SENSOR, SENSOR_FILTER, TABLE, FreeModel, TriedEffect
from shake_ros.fit.nuisances.sensor_filter import SensorFilter
from shake_ros.fit.records import Record
from shake_ros.fit.solver import Budget, PredictorFit, descend, jacobian, prior_residuals
from shake_ros.search.candidates import functions, listed
from shake_ros.search.decision import PRIOR
from shake_ros.search.proposal import MULTIPLES, NONE_MOVED, SHIFT, EffectSet, Linearised, evaluate, linearised
from shake_ros.twin.evidence import KnownState, ScaledPredictor, segment_of

SCREENED = 3.0  # length of the windows on which every hypothesis is tried [s]
BEST = 12  # hypotheses that are tried before the change as well
REFITTED, WORTH = 6, 0.5  # hypotheses that are refitted at most, and the part of the best one's gain that they need
STEPS, CONVERGED = 30, 0.1  # Jacobians of a refit at most; fall of the cost at which it has converged [nats]
RIVAL = math.log(20.0)  # nats behind the best, within which a hypothesis stays possible
FREE = 1e3  # units within which the parameter of a hypothesis may move
ESTABLISHED, ONE_OF_THESE, NOT_EXPLAINED = "established", "one of these", "not explained"
PLACES = {
    **{"valve": "valve", "supply": "supply", "bulk_modulus": "compressibility", "leakage": "flow"},
    **{"friction": "friction", "body": "structure", "sensor": "sensor"},
}


@dataclass(frozen=True)
class Hypothesis:
    """What may have changed, with its value after a refit."""

    name: str  # of the effect or the parameter
    parameter: str  # its dotted name
    place: str  # where it acts
    unit: str
    # before, after, deviation: value before, since, and its standard deviation [unit]
    before: float
    after: float
    deviation: float
    evidence: float  # log marginal likelihood against no change, with the prior odds [nats]
    followed: bool  # whether it is a followed parameter
    model: FreeModel  # with it
    covariance: np.ndarray
    residuals: np.ndarray

    @property
    def square(self) -> float:
        """Mean square of the residuals [-]."""
        return _mean_square(self.residuals)


@dataclass(frozen=True)
class Named:
    """The answer."""

    best: Hypothesis
    rivals: tuple[Hypothesis, ...]  # those that are possible beside it
    place: str  # where it acts
    explained: bool  # whether the best one reduces the innovations to what is normal
    changed: bool  # whether any is likelier than no change, or no change leaves more than what is normal
    # of the acceleration in a free run before the change, since, and since with the best one [-]
    error: tuple[float, float, float]

    @property
    def share(self) -> float:
        """Share of the acceleration that changed: of the error since, what the best one explains, or where none does,
        what was not there before [-]."""
        before, since, left = self.error
        return math.sqrt(max(since**2 - (left if self.explained else before) ** 2, 0.0)) if self.changed else 0.0

    @property
    def verdict(self) -> str:
        """established, one of these, or not explained."""
        return NOT_EXPLAINED if not self.explained else ONE_OF_THESE if self.rivals else ESTABLISHED

    @property
    def kept(self) -> Hypothesis:
        """The hypothesis that the model goes on with: of an open answer the best that is a followed parameter."""
        own = [h for h in self.rivals if h.followed and self.explained]
        return self.best if self.best.followed or not own else own[0]

    def covariance(self, count: int) -> np.ndarray:
        """Covariance of the first parameters about those that are kept, over all answers as likely as they are."""
        answers, kept = (self.best, *self.rivals), self.kept.model.x[:count]
        odds = np.exp([h.evidence - self.best.evidence for h in answers])
        apart = [h.model.x[:count] - kept for h in answers]
        parts = [h.covariance[:count, :count] + np.outer(d, d) for h, d in zip(answers, apart, strict=True)]
        found: np.ndarray = np.tensordot(odds / np.sum(odds), parts, 1)
        return found


@dataclass(frozen=True, kw_only=True)
class KnownModel(FreeModel):
    """A model whose first parameters are known together; one with a prior of its own is not one of them."""

    known: KnownState  # their mean and covariance, in units

    @cached_property
    def prior(self) -> tuple[np.ndarray, np.ndarray]:
        """As of `FreeModel`, with rows that whiten what is known."""
        own, targets = super().prior
        some = [i for i in range(len(self.known.mean)) if self.names[i] not in self.priors]
        whiten = np.linalg.inv(np.linalg.cholesky(self.known.covariance[np.ix_(some, some)]))
        rows = np.zeros((len(some), len(self.x)))
        rows[:, some] = whiten
        return np.vstack([own, rows]), np.concatenate([targets, whiten @ self.known.mean[some]])


class _Refit(NamedTuple):
    """A refit: model, cost of windows and priors [nats], residuals, inverse normal matrix, log determinants."""

    model: FreeModel
    cost: float
    residuals: np.ndarray
    covariance: np.ndarray
    occam: float


class Naming:
    """Names what changed between two sets of windows.

    Parameters
    ----------
    model : as known before the change. covariance : of its parameters with what they wander, shape (p, p) [units].
    sizes : of a change of each that matters, shape (p,) [units]. levels : of noise.
    inflation : of the variance of the innovations. before, since : the windows.
    """

    def __init__(
        self,
        model: FreeModel,
        covariance: np.ndarray,
        sizes: np.ndarray,
        levels: Levels,
        inflation: float,
        before: Sequence[Record],
        since: Sequence[Record],
    ) -> None:
        known = KnownState(model.x, covariance / inflation)
        self.model = KnownModel(**{f.name: getattr(model, f.name) for f in fields(model)}, known=known)
        self.levels, self.inflation = levels, inflation
        self.sizes = sizes
        self.candidates = sized(effect_candidates(), model.table)
        self.before, self.since = tuple(before), tuple(since)
        self.fitted = self._fitted(self.since)
        self.past = self._fitted(self.before) if self.before else None
        self._share = len(self.since) / max(len(self.before), 1)

    def _fitted(self, records: Sequence[Record]) -> PredictorFit:
        start = ScaledPredictor([segment_of(r) for r in records], self.levels)
        prediction = start.filtered(self.model.vectors(self.model.x)[0])
        return PredictorFit(self.model, prediction, prediction.log_likelihood())

    def named(self, normal_square: float) -> Named:
        """The answer.

        Parameters
        ----------
        normal_square : mean square of the innovations up to which they count as explained [-].
        """
        found = self._against_past(self._refits())
        best = found[0]
        explained = bool(best.evidence > 0.0 and best.square < normal_square)
        left = self.fitted.prediction.residuals(self.model.vectors(self.model.x))[0]
        changed = bool(best.evidence > 0.0 or _mean_square(left) > normal_square)
        rivals = tuple(h for h in found[1:] if self._rivals(h, best))
        place = best.place if explained else self._place_of_unlisted(best)
        vectors = [m.vectors(m.x) for m in (self.model, best.model)]
        errors = free_run_errors(np.vstack(vectors), self.since)
        known = free_run_errors(vectors[0], self.before)[0] if self.before else math.nan
        return Named(best, rivals, place, explained, changed, (float(known), float(errors[0]), float(errors[1])))

    def _refits(self) -> list[Hypothesis]:
        """The best hypotheses by their linear gain since the change less that before it, refitted in this order while
        the gain is worth it beside what a refit has found."""
        moved = {i: self._moved(i) for i in range(len(self.model.x))}
        taken = {*self.model.table.effects, *(n.split(".")[1] for n in self.model.names if n.startswith("effects."))}
        tried = [listed(c) for c in self.candidates if c.effect not in taken]
        best = self._gains(self.fitted, self._unchanged.model.x, tried, moved)[:BEST]
        had, names = dict[str, float](), self.model.names
        again = [replace(e, trials=(s.trials[0].directions,)) for e, s in best if e.strength.name not in names]
        if self.past and again:
            gained = self._gains(self.past, self.model.x, again)
            had = {effect.strength.name: self._share * s.gain for effect, s in gained}
        net = {effect.strength.name: s.gain - had.get(effect.strength.name, 0.0) for effect, s in best}
        found, most = list[Hypothesis](), 0.0
        for effect, proposal in sorted(best, key=lambda h: -net[h[0].strength.name])[:REFITTED]:
            if net[effect.strength.name] < WORTH * most - PRIOR - RIVAL:
                break
            found.append(self._refitted(effect, proposal))
            most = max(most, found[-1].evidence)
        return found

    def _gains(
        self,
        fitted: PredictorFit,
        x: np.ndarray,
        tried: Sequence[TriedEffect],
        moved: Mapping[int, TriedEffect] = NONE_MOVED,
    ) -> list[tuple[TriedEffect, EffectSet]]:
        """Each hypothesis that gains anything at its best trial, to first order at x and on some windows, beside which
        what is known weighs as much as beside all; the best first."""
        some = fitted.prediction.part(SCREENED)
        whole = fitted.prediction.count / some.count
        known = replace(self.model.known, covariance=whole * self.model.known.covariance)
        # friction is declared as it stands: what is known holds it, so that nothing has bent it
        model = replace(self.model, table=self.model.at(x).found_table(), x=x, known=known)
        part = replace(fitted, model=model, prediction=some)
        lin, found = linearised(part, tried, moved), dict[str, tuple[TriedEffect, EffectSet]]()
        for m, trial in enumerate(lin.trials):
            gain, parts = evaluate(lin, [m])
            effect = trial.candidate
            before = found.get(effect.strength.name)
            gain *= whole / self.inflation
            if gain > 0.0 and (before is None or gain > before[1].gain):
                found[effect.strength.name] = effect, _single(lin, m, gain, parts)
        return sorted(found.values(), key=lambda h: -h[1].gain)

    def _moved(self, i: int) -> TriedEffect:
        """A followed parameter as a hypothesis: it alone moves further than what is known lets it."""
        p = self.model.free[i]
        section, _, rest = p.name.partition(".")
        name = rest.partition(".")[0] if section == "effects" else p.name
        place = {c.effect: c.place for c in self.candidates}.get(name) or PLACES[section]
        return TriedEffect(name, (FreeParameter(p.name, p.scale, -math.inf, math.inf, p.unit),), (), place)

    def _begun(self, effect: TriedEffect, proposal: EffectSet) -> FreeModel:
        """Where a refit begins: the hypothesis at the likeliest part of its linear prediction, others moved or not."""
        (trial,), (parts,) = proposal.trials, proposal.parts
        found, name, unchanged = list[FreeModel](), effect.strength.name, self._unchanged.model.x
        for part in MULTIPLES:
            for x in (self.model.x, unchanged, unchanged + np.clip(part * proposal.change, -SHIFT, SHIFT)):
                if name not in self.model.names:
                    model = self.model.at(x).with_effect(effect, trial.values([part * s for s in parts]))
                    found.append(replace(model, priors={**model.priors, **self._shapes(effect)}))
                    continue
                i = self.model.names.index(name)
                moved = x.copy()
                moved[i] += part * parts[0]
                free = (self.model.value(name), FREE * effect.strength.scale)
                found.append(replace(self.model, priors={**self.model.priors, name: free}).at(moved))
        rows = np.vstack([m.vectors(m.x) for m in found])
        costs = np.sum(self.fitted.prediction.residuals(rows) ** 2, axis=1)
        costs += [np.sum(prior_residuals(m, m.x) ** 2) for m in found]
        return found[int(np.argmin(costs))]

    def _refitted(self, effect: TriedEffect, proposal: EffectSet) -> Hypothesis:
        """A hypothesis at its most likely value."""
        name, scale = effect.strength.name, effect.strength.scale
        followed = name in self.model.names
        half_width = float(self.sizes[self.model.names.index(name)]) * scale if followed else scale
        was = self.model.value(name) if followed else self.model.table.value(name)
        found = self._converged(self.fitted, self._begun(effect, proposal), name)
        i = found.model.names.index(name)
        value, deviation = found.model.value(name), math.sqrt(found.covariance[i, i]) * scale
        prior = math.log(scale / (math.pi * half_width * (1.0 + ((value - was) / half_width) ** 2)))
        evidence = self._unchanged.cost - found.cost + found.occam - self._unchanged.occam
        evidence += prior + 0.5 * math.log(2.0 * math.pi) - (0.0 if followed else PRIOR)
        return Hypothesis(
            *(effect.name, name, effect.place, effect.strength.unit, was, value, deviation, evidence, followed),
            *(found.model, found.covariance, found.residuals),
        )

    def _shapes(self, effect: TriedEffect) -> dict[str, tuple[float, float]]:
        """Priors of an effect's parameters beside its strength: about its trials, as wide as they spread."""
        found = dict[str, tuple[float, float]]()
        values = [direction for directions in effect.trials for direction in directions]
        for p in effect.free[1:]:
            tried = [v[p.name] for v in values if p.name in v] or [self.model.table.value(p.name)]
            deviation = max(max(tried) - min(tried), p.scale)
            found[p.name] = float(np.mean(tried)), deviation / math.sqrt(self.inflation)
        return found

    def _converged(self, fitted: PredictorFit, model: FreeModel, free: str = "") -> _Refit:
        """A model refitted under held gains. free : the parameter whose prior is not one of `model`."""
        model, _ = descend(fitted.prediction, model, STEPS, CONVERGED * self.inflation, Budget())
        r, j = jacobian(fitted.prediction, model, model.x)
        rows = model.prior[0]
        normal = (j.T @ j + rows.T @ rows) / self.inflation
        others = [i for i, n in enumerate(model.names) if n != free]
        precision = (rows.T @ rows)[np.ix_(others, others)] / self.inflation
        scale = np.sqrt(np.maximum(np.diag(normal), 1e-12))
        inner = normal / np.outer(scale, scale) + 1e-9 * np.eye(len(scale))
        log_normal = float(np.linalg.slogdet(inner)[1]) + 2.0 * float(np.sum(np.log(scale)))
        cost = 0.5 * float(r @ r) + 0.5 * float(np.sum(prior_residuals(model, model.x) ** 2))
        covariance = np.linalg.inv(inner) / np.outer(scale, scale)
        occam = 0.5 * float(np.linalg.slogdet(precision)[1]) - 0.5 * log_normal
        return _Refit(model, cost / self.inflation, r, covariance, occam)

    def _against_past(self, found: list[Hypothesis]) -> list[Hypothesis]:
        """Those that may be the best or near it, less what they would have gained before the change, the best first.

        A followed parameter has been fitted to the past already.
        """
        sound, best = list[Hypothesis](), -math.inf
        for h in sorted(found, key=lambda h: -h.evidence):
            if h.evidence < best - RIVAL and not any(self._rivals(h, other) for other in sound):
                continue
            if self.past and not h.followed:
                always = self._converged(self.past, h.model, h.parameter)
                had = max(self._unchanged_past.cost - always.cost, 0.0)
                h = replace(h, evidence=h.evidence - self._share * had)
            sound.append(h)
            best = max(best, h.evidence)
        return sorted(sound, key=lambda h: -h.evidence)

    def _rivals(self, one: Hypothesis, best: Hypothesis) -> bool:
        """Whether a hypothesis is possible beside the best: nearly as likely, or not distinguished by these windows."""
        alike = 0.5 * float(np.sum((one.residuals - best.residuals) ** 2)) / self.inflation < RIVAL
        return one.evidence > 0.0 and (alike or one.evidence > best.evidence - RIVAL)

    @cached_property
    def _unchanged(self) -> _Refit:
        """The windows since, where nothing has changed but what wanders."""
        return self._converged(self.fitted, self.model)

    @cached_property
    def _unchanged_past(self) -> _Refit:
        """The same of the windows before."""
        assert self.past
        return self._converged(self.past, self.model)

    def _place_of_unlisted(self, best: Hypothesis) -> str:
        """Where a function of one quantity would explain most."""
        lin = linearised(self.fitted, functions(self.fitted))
        gains = [evaluate(lin, [m])[0] for m in range(len(lin.trials))]
        return lin.trials[int(np.argmax(gains))].candidate.place if gains and max(gains) > 0.0 else best.place


def _mean_square(residuals: np.ndarray) -> float:
    return float(residuals @ residuals) / max(int(np.count_nonzero(residuals)), 1)


def _single(lin: Linearised, m: int, gain: float, parts: np.ndarray) -> EffectSet:
    index = list(lin.places[m])
    change = lin.own + lin.response[:, index] @ parts
    return EffectSet((lin.trials[m],), (tuple(parts.tolist()),), gain, change)


def free_run_errors(vectors: np.ndarray, records: Sequence[Record]) -> np.ndarray:
    """Relative error of the acceleration of free runs over records, for rows of parameters, shape (m,) [-].

    Parameters
    ----------
    vectors : shape (m, WIDTH); without what the sensors add, (m, TABLE).
    """
    left, size = np.zeros(len(vectors)), 0.0
    for r in records:
        if r.acceleration is None:
            continue
        left += [np.sum(_left(v, r) ** 2) for v in vectors]
        size += _size(r)
    return np.sqrt(left / size) if size else np.full(len(vectors), math.nan)


def free_run_shares(vectors: np.ndarray, records: Sequence[Record]) -> np.ndarray:
    """Share of the acceleration by which free runs of the rows differ from that of the first, shape (m − 1,) [-]."""
    apart, size = np.zeros(len(vectors) - 1), 0.0
    for r in records:
        first = _left(vectors[0], r)
        apart += [np.sum((_left(v, r) - first) ** 2) for v in vectors[1:]]
        size += _size(r)
    return np.sqrt(apart / size)


def _left(vector: np.ndarray, r: Record) -> np.ndarray:
    """What a free run leaves of the acceleration."""
    lag = float(vector[TABLE + list(SENSOR).index(SENSOR_FILTER.name)]) if len(vector) > TABLE else 0.0
    late = SensorFilter(lag, lag).applied(r)
    return late.acceleration_left(FULL.simulate(vector[None, :TABLE], late)[1])


def _size(r: Record) -> float:
    assert r.acceleration is not None
    return float(np.sum(np.where(r.whole, r.acceleration, 0.0)[r.start :] ** 2))
