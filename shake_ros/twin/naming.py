"""What changed? Every candidate effect and every followed parameter, tried on the windows behind and before a change.

The model as it was known before the change is linearised over the windows since (search/proposal.py); each hypothesis
is one effect that came, or one followed parameter that moved, while all others stay where they were known, within what
they wander. What it would also have gained before the change is no evidence for a change and is taken off. The best are
refitted; the ratio of likelihoods names one, with those that come near it as rivals, or none where too much is left.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from shake_ros.core.identification.free_parameters import FreeParameter
from shake_ros.core.identification.recordings import FULL, Record
from shake_ros.core.plant.parameters import TableParameters
from shake_ros.declared import effect_candidates, sized
from shake_ros.fit.model import SENSOR, TABLE, FreeModel, TriedEffect
from shake_ros.fit.prediction import Levels, Predictor
from shake_ros.fit.segment import Segment
from shake_ros.fit.solver import Budget, PredictorFit, descend, jacobian, prior_residuals
from shake_ros.search.candidates import functions, listed
from shake_ros.search.loop import PRIOR
from shake_ros.search.proposal import EffectSet, Linearised, evaluate, linearised, start

REFITTED, STEPS = 6, 6  # hypotheses that are refitted, by so many Jacobians
RIVAL = math.log(20.0)  # nats behind the best, within which a hypothesis stays possible
FREE = 1e3  # units within which the parameter of a hypothesis may move
PLACES = {
    **{"valve": "valve", "supply": "supply", "bulk_modulus": "compressibility", "leakage": "flow"},
    **{"friction": "friction", "body": "structure", "sensor": "sensor"},
}


@dataclass(frozen=True)
class Hypothesis:
    """What may have changed, with its value after a refit.

    Attributes
    ----------
    name : of the effect or the parameter. parameter : its dotted name. place : where it acts.
    before, after, deviation : value before, since, and its standard deviation [unit]. gain : in log likelihood [nats].
    model : with it. square : mean square of the whitened innovations that it leaves [-].
    """

    name: str
    parameter: str
    place: str
    unit: str
    before: float
    after: float
    deviation: float
    gain: float
    model: FreeModel
    covariance: np.ndarray
    square: float


@dataclass(frozen=True)
class Named:
    """The answer.

    Attributes
    ----------
    best : the best hypothesis. rivals : those that are possible beside it. place : where it acts.
    explained : whether the best one reduces the innovations to what is normal.
    error : of the acceleration in a free run before the change, since, and since with the best one [-].
    """

    best: Hypothesis
    rivals: tuple[Hypothesis, ...]
    place: str
    explained: bool
    error: tuple[float, float, float]


class Naming:
    """Names what changed between two sets of windows.

    Parameters
    ----------
    model : as known before the change. covariance : of its parameters with what they wander, shape (p, p) [units].
    levels : of noise. inflation : of the variance of the innovations. before, since : the windows.
    """

    def __init__(
        self,
        model: FreeModel,
        covariance: np.ndarray,
        levels: Levels,
        inflation: float,
        before: Sequence[Record],
        since: Sequence[Record],
    ) -> None:
        deviations = np.sqrt(np.diag(covariance) / inflation) * model.scale
        priors = {
            n: (float(v), float(d)) for n, v, d in zip(model.names, model.x * model.scale, deviations, strict=True)
        }
        self.model, self.levels, self.inflation = replace(model, priors=priors), levels, inflation
        self.candidates = sized(effect_candidates(), model.table)
        self.before, self.since = tuple(before), tuple(since)
        self.fitted = self._fitted(self.since)
        self.past = self._fitted(self.before) if self.before else None
        self._share = len(self.since) / max(len(self.before), 1)

    def _fitted(self, records: Sequence[Record]) -> PredictorFit:
        start = Predictor([Segment.of(r) for r in records], self.levels)
        prediction = start.filtered(self.model.vectors(self.model.x)[0])
        return PredictorFit(self.model, prediction, prediction.log_likelihood())

    def named(self, normal_square: float) -> Named:
        """The answer.

        Parameters
        ----------
        normal_square : mean square of the innovations up to which they count as explained [-].
        """
        found = self._against_past([self._refitted(*h) for h in self._screened()])
        best = found[0]
        explained = best.gain > PRIOR and best.square < normal_square
        rivals = tuple(h for h in found[1:] if h.gain > max(best.gain - RIVAL, PRIOR))
        place = best.place if explained else self._place_of_unlisted(best)
        vectors = [m.vectors(m.x)[:, :TABLE] for m in (self.model, best.model)]
        errors = free_run_errors(np.vstack(vectors), self.since)
        known = free_run_errors(vectors[0], self.before)[0] if self.before else math.nan
        return Named(best, rivals, place, explained, (float(known), float(errors[0]), float(errors[1])))

    def _screened(self) -> list[tuple[TriedEffect, EffectSet]]:
        """The best hypotheses by their linear gain since the change less that before it, the best first."""
        moved = {i: self._moved(i) for i in range(len(self.model.x))}
        taken = {*self.model.table.effects, *(n.split(".")[1] for n in self.model.names if n.startswith("effects."))}
        tried = [listed(c) for c in self.candidates if c.effect not in taken]
        lin = linearised(self.fitted, tried, moved)
        had = linearised(self.past, tried, moved) if self.past else None
        found = dict[str, tuple[float, TriedEffect, EffectSet]]()
        for m, trial in enumerate(lin.trials):
            gain, parts = evaluate(lin, [m])
            net = gain - (self._share * max(evaluate(had, [m])[0], 0.0) if had else 0.0)
            effect = trial.candidate
            if gain > 0.0 and net > found.get(effect.name, (-math.inf,))[0]:
                found[effect.name] = net, effect, _single(lin, m, gain, parts)
        return [(effect, s) for _, effect, s in sorted(found.values(), key=lambda f: -f[0])[:REFITTED]]

    def _moved(self, i: int) -> TriedEffect:
        """A followed parameter as a hypothesis: it alone moves, either way."""
        p = self.model.free[i]
        section, _, rest = p.name.partition(".")
        name = rest.partition(".")[0] if section == "effects" else p.name
        place = {c.effect: c.place for c in self.candidates}.get(name) or PLACES[section]
        free = FreeParameter(p.name, p.scale, -math.inf, math.inf, p.unit)
        return TriedEffect(name, (free,), (), place)

    def _refitted(self, effect: TriedEffect, proposal: EffectSet) -> Hypothesis:
        """A hypothesis at its most likely value."""
        name = effect.strength.name
        if name in self.model.names:
            i = self.model.names.index(name)
            x = self.model.x.copy()
            x[i] += proposal.parts[0][0]
            priors = {**self.model.priors, name: (self.model.value(name), FREE * self.model.scale[i])}
            begun = replace(self.model, priors=priors).at(x)
        else:
            begun = start(self.fitted, proposal)
        model, _ = descend(self.fitted.prediction, begun, STEPS, 1.0, Budget())
        gain = self._unchanged - self._cost(self.fitted, model)
        r, j = jacobian(self.fitted.prediction, model, model.x)
        rows = model.prior[0]
        covariance = self.inflation * np.linalg.pinv(j.T @ j + rows.T @ rows)
        i = model.names.index(name)
        was = self.model.value(name) if name in self.model.names else self.model.table.value(name)
        deviation = math.sqrt(covariance[i, i]) * float(model.scale[i])
        square = float(r @ r) / self.fitted.prediction.count
        return Hypothesis(
            effect.name,
            name,
            effect.place,
            effect.strength.unit,
            was,
            model.value(name),
            deviation,
            gain / self.inflation,
            model,
            covariance,
            square,
        )

    def _against_past(self, found: list[Hypothesis]) -> list[Hypothesis]:
        """Those that may be the best or near it, less what they would have gained before the change, the best first.

        A followed parameter has been fitted to the past already.
        """
        sound, best = list[Hypothesis](), -math.inf
        for h in sorted(found, key=lambda h: -h.gain):
            if h.gain < best - RIVAL:
                break
            if self.past and h.parameter not in self.model.names:
                always, _ = descend(self.past.prediction, h.model, STEPS, 1.0, Budget())
                had = max(self._unchanged_past - self._cost(self.past, always), 0.0)
                h = replace(h, gain=h.gain - self._share * had / self.inflation)
            sound.append(h)
            best = max(best, h.gain)
        return sorted(sound, key=lambda h: -h.gain)

    @cached_property
    def _unchanged(self) -> float:
        """Cost of the windows since, where nothing has changed but what wanders."""
        return self._cost(self.fitted, descend(self.fitted.prediction, self.model, STEPS, 1.0, Budget())[0])

    @cached_property
    def _unchanged_past(self) -> float:
        """The same of the windows before."""
        assert self.past
        return self._cost(self.past, descend(self.past.prediction, self.model, STEPS, 1.0, Budget())[0])

    def _cost(self, fitted: PredictorFit, model: FreeModel) -> float:
        r = fitted.prediction.residuals(model.vectors(model.x))[0]
        return 0.5 * float(r @ r) + 0.5 * float(np.sum(prior_residuals(model, model.x) ** 2))

    def _place_of_unlisted(self, best: Hypothesis) -> str:
        """Where a function of one quantity would explain most."""
        lin = linearised(self.fitted, functions(self.fitted))
        gains = [evaluate(lin, [m])[0] for m in range(len(lin.trials))]
        return lin.trials[int(np.argmax(gains))].candidate.place if gains and max(gains) > 0.0 else best.place


def _single(lin: Linearised, m: int, gain: float, parts: np.ndarray) -> EffectSet:
    index = list(lin.places[m])
    change = lin.own + lin.response[:, index] @ parts
    return EffectSet((lin.trials[m],), (tuple(parts.tolist()),), gain, change)


def free_run_errors(vectors: np.ndarray, records: Sequence[Record]) -> np.ndarray:
    """Relative error of the acceleration of free runs over records, for rows of parameters, shape (m,) [-]."""
    left, size = np.zeros(len(vectors)), 0.0
    for r in records:
        if r.acceleration is None:
            continue
        _, simulated = FULL.simulate(vectors, r)
        left += np.sum(r.acceleration_left(simulated) ** 2, axis=1)
        size += float(np.sum(np.where(r.whole, r.acceleration, 0.0)[r.start :] ** 2))
    return np.sqrt(left / size) if size else np.full(len(vectors), math.nan)


def changed_table(best: Hypothesis) -> TableParameters:
    """The table with what changed."""
    return best.model.found_table() if best.parameter not in SENSOR else best.model.table
