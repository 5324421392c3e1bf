"""Which sets of effects would explain what a fit leaves? A linear best-subset selection over finite trials.

With the whitened residuals r of a fitted model, its Jacobian J, their change f by the friction that its table declares,
and the change d_t of the residuals by each trial t of each absent effect, a set T of trials leaves

    min over δ, m, s of |r + J δ + m f + Σ_t s_t d_t|²

to first order. All sets share one Gram matrix, so a beam over sets with exchange costs next to nothing.

Friction bends first where a model lacks something, and where a fit has made it nothing, no effect of friction shows. So
these are tried with the declared friction, and what that changes by itself is no gain of theirs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from shake_ros.fit.likelihood import LOST, Likelihood
from shake_ros.fit.model import FreeModel, TriedEffect
from shake_ros.fit.solver import PART, PredictorFit, differences, jacobian, prior_residuals, step_within
from shake_ros.fit.uncertainty import resting

LARGEST, SLIGHT = 4.0, 0.01  # multiple of a trial up to which its linear prediction is followed, and a slight one
SCREENED = 9.0  # length of the segments that are linearised [s]
BEAM = 16  # sets of each size that are kept
MOST = 3  # effects of a set
SHIFT = 3.0  # of a parameter, in scales (or parts of its value), that is followed at most
MULTIPLES = (1.0, 0.5, 0.25, 0.1, 0.03, 0.01)  # of the linear prediction from which a refit may start
FRICTION, OWN = "friction", "friction."  # place of an effect, and how the names of the table's own parameters begin
RIDGE = 1e-3  # of directions that are alike
NONE_MOVED: Mapping[int, TriedEffect] = MappingProxyType({})


@dataclass(frozen=True)
class EffectTrial:
    """One trial: an effect at some values, or at the combinations of several. most : multiple that is followed."""

    candidate: TriedEffect
    directions: tuple[Mapping[str, float], ...]
    most: float = LARGEST

    def slight(self, reach: float) -> EffectTrial:
        """The same so small that it shows the derivative, followed as far as one `reach` times as large.

        Where other parameters compensate most of an effect, what is left of a finite one is mostly its curvature.
        """
        scaled = self.candidate.scaled
        small = tuple({n: SLIGHT * v if n in scaled else v for n, v in d.items()} for d in self.directions)
        return EffectTrial(self.candidate, small, self.most * reach / SLIGHT)

    @property
    def least(self) -> float:
        """Least multiple: at which a strength of one sign is at its bound; of several directions any."""
        strength, (first, *more) = self.candidate.strength, self.directions
        return -self.most if self.candidate.signed or more else strength.low / first[strength.name]

    @property
    def with_declared_friction(self) -> bool:
        """Whether it is tried with the declared friction: a finite one of friction."""
        return self.candidate.place == FRICTION and self.most <= LARGEST

    @property
    def shape(self) -> tuple[tuple[str, float], ...]:
        """Values that do not grow with the multiple."""
        scaled = self.candidate.scaled
        return tuple(sorted((n, v) for d in self.directions for n, v in d.items() if n not in scaled))

    def values(self, parts: Sequence[float]) -> dict[str, float]:
        """Values by dotted name at multiples of the directions."""
        found = dict(self.directions[0])
        for name in self.candidate.scaled:
            found[name] = sum(part * d.get(name, 0.0) for part, d in zip(parts, self.directions, strict=True))
        return found


@dataclass(frozen=True)
class EffectSet:
    """A set of trials with the multiples that the linear prediction gives their directions, and its gain in nats.

    change : of the parameters beside them, in units of the scales, shape (p,).
    """

    trials: tuple[EffectTrial, ...]
    parts: tuple[tuple[float, ...], ...]
    gain: float
    change: np.ndarray

    @property
    def names(self) -> tuple[str, ...]:
        """Effects of the set, for a reader."""
        return tuple(t.candidate.called for t in self.trials)


@dataclass(frozen=True)
class Linearised:
    """A fitted model to first order: what each direction of each trial does once the parameters have adjusted.

    power : Gram matrix of the directions, score : their products with the residuals, response : of the parameters to
    a unit of each, shape (p, d); own : change of the parameters alone, shape (p,). places : columns of each trial.
    """

    trials: tuple[EffectTrial, ...]
    places: tuple[tuple[int, ...], ...]
    power: np.ndarray
    score: np.ndarray
    response: np.ndarray
    own: np.ndarray
    fitted: PredictorFit
    left: float

    def dispersed(self) -> Linearised:
        """The same where all that is left counts as noise (quasi-likelihood: McCullagh and Nelder 1989, ch. 9)."""
        spread = max(self.left, 1.0)
        return replace(self, power=self.power / spread, score=self.score / spread)


def linearised(
    fitted: PredictorFit,
    candidates: Sequence[TriedEffect],
    moved: Mapping[int, TriedEffect] = NONE_MOVED,
    beside: Sequence[Likelihood] = (),
) -> Linearised:
    """Residuals of every trial beside a fitted model.

    Parameters
    ----------
    candidates : effects that it does not have. moved : its own parameters by their place that are tried as well, each
        a unit further than its prior lets it go. beside : predictions of further data that count as well.
    """
    model, p = fitted.model, len(fitted.model.x)
    declared, trials = with_declared_friction(model), trials_of(candidates)
    rows, places = list[np.ndarray](), list[tuple[int, ...]]()
    for t in trials:
        places.append(tuple(range(len(rows), len(rows) + len(t.directions))))
        for values in t.directions:
            bigger = (declared if t.with_declared_friction else model).with_effect(t.candidate, values)
            rows.append(bigger.vectors(bigger.x)[0])
    at, step = differences(fitted.prediction, model, model.x)
    data, vectors = (fitted.prediction, *beside), np.vstack([at, declared.vectors(declared.x), *rows])
    few = [prediction.part(SCREENED) for prediction in data]
    sizes = [size for prediction in few for size in prediction.run_sizes()]
    found = np.hstack([prediction.residuals(vectors) for prediction in few])
    r, friction = found[0], found[p + 1]
    j = (found[1 : p + 1] - r).T / step
    bases = [friction if t.with_declared_friction else r for t in trials for _ in t.directions]
    d = without_lost_runs((found[p + 2 :] - np.reshape(bases, (-1, len(r)))).T, sizes)
    d = np.hstack([d, j[:, list(moved)]])
    trials += tuple(EffectTrial(c, ({c.strength.name: c.strength.scale},)) for c in moved.values())
    places += [(len(rows) + i,) for i in range(len(moved))]
    j = np.hstack([j, without_lost_runs((friction - r)[:, None], sizes)])
    prior = np.hstack([model.prior[0], np.zeros((len(model.prior[0]), 1))])
    normal = normal_matrix(j.T @ j, prior)
    gradient = j.T @ r + prior.T @ prior_residuals(model, model.x)
    x, low, high = np.append(model.x, 0.0), np.append(model.bounds[0], -np.inf), np.append(model.bounds[1], np.inf)
    own = step_within(normal, gradient, x, (low, high))
    across, free = j.T @ d, ~resting(x + own, low, high)
    response = np.zeros_like(across)  # of a parameter at a bound none: what only it could take is left to the trials
    response[free] = -np.linalg.solve(normal[np.ix_(free, free)], across[free])
    whole = sum(prediction.count for prediction in data) / sum(prediction.count for prediction in few)
    power, score = d.T @ d + across.T @ response, -(d.T @ r + across.T @ own)
    left = float(np.mean(r**2))
    return Linearised(trials, tuple(places), whole * power, whole * score, response[:p], own[:p], fitted, left)


def normal_matrix(power: np.ndarray, prior: np.ndarray) -> np.ndarray:
    """Normal matrix of a fit, of a Jacobian's Gram matrix and the rows of its priors, shape (p, p)."""
    normal = power + prior.T @ prior
    return np.asarray(normal + 1e-9 * np.diag(np.maximum(np.diag(normal), 1e-12)))


def without_lost_runs(changes: np.ndarray, sizes: Sequence[int]) -> np.ndarray:
    """Changes of residuals by trials, shape (n, d), at zero in runs that end in no number.

    sizes : number of residuals of each run.

    >>> without_lost_runs(np.array([[0.1, 0.2], [0.3, 2e3], [0.5, 0.6]]), [2, 1]).tolist()
    [[0.1, 0.0], [0.3, 0.0], [0.5, 0.6]]
    """
    lost = np.maximum.reduceat(np.abs(changes), np.cumsum([0, *sizes[:-1]]), axis=0) >= LOST
    return np.where(np.repeat(lost, sizes, axis=0), 0.0, changes)


def trials_of(candidates: Sequence[TriedEffect]) -> tuple[EffectTrial, ...]:
    """The finite trials of candidates, then a slight one of each shape."""
    finite = [EffectTrial(c, directions) for c in candidates for directions in c.trials]
    alike: dict[tuple[str, tuple[tuple[str, float], ...]], list[EffectTrial]] = {}
    for t in (t for t in finite if t.candidate.scaled):
        alike.setdefault((t.candidate.name, t.shape), []).append(t)
    slight = []
    for each in alike.values():
        least, largest = min(each, key=size), max(each, key=size)
        slight.append(least.slight(size(largest) / max(size(least), 1e-30)))
    return (*finite, *slight)


def size(trial: EffectTrial) -> float:
    """Largest of the values that grow with the multiple."""
    return max(abs(d.get(n, 0.0)) for d in trial.directions for n in trial.candidate.scaled)


def with_declared_friction(model: FreeModel) -> FreeModel:
    """A model with the friction that its table declares."""
    declared = [model.table.value(n) / s for n, s in zip(model.names, model.scale, strict=True) if n.startswith(OWN)]
    x = model.x.copy()
    x[[n.startswith(OWN) for n in model.names]] = declared
    return model.at(x)


def weakest(fitted: PredictorFit, effects: Sequence[TriedEffect]) -> TriedEffect:
    """The effect whose absence would cost least to first order, once all other parameters have adjusted (Wald)."""
    model = fitted.model
    j = jacobian(fitted.prediction.part(SCREENED), model, model.x)[1]
    covariance = np.linalg.inv(normal_matrix(j.T @ j, model.prior[0]))

    def cost(effect: TriedEffect) -> float:
        own = [model.names.index(n) for n in effect.scaled]
        return float(model.x[own] @ np.linalg.solve(covariance[np.ix_(own, own)], model.x[own]))

    return min(effects, key=cost)


def evaluate(lin: Linearised, members: Sequence[int]) -> tuple[float, np.ndarray]:
    """Gain in nats of a set of trials, and the multiples of their directions; −1 where one has the wrong sign."""
    index = [i for m in members for i in lin.places[m]]
    power, score = lin.power[np.ix_(index, index)], lin.score[index]
    scale = np.sqrt(np.maximum(np.diag(power), 1e-30))
    s = np.linalg.solve(power / np.outer(scale, scale) + RIDGE * np.eye(len(index)), score / scale) / scale
    limits = np.array([[lin.trials[m].least, lin.trials[m].most] for m in members for _ in lin.places[m]])
    if np.any((s <= 0.0) & (limits[:, 0] >= 0.0)):
        return -1.0, s
    s = np.clip(s, *limits.T)
    return float(s @ score - 0.5 * s @ power @ s), s


def proposals(lin: Linearised, largest: int = MOST) -> dict[int, list[EffectSet]]:
    """The best sets of each size, the best first, no two of the same effects."""
    live = [m for m, place in enumerate(lin.places) if any(lin.power[i, i] > 1e-9 for i in place)]
    beam: list[tuple[int, ...]] = [()]
    found: dict[int, list[EffectSet]] = {}
    for size in range(1, largest + 1):
        seen: dict[frozenset[str], tuple[float, tuple[int, ...]]] = {}
        for base in beam:
            have = {lin.trials[m].candidate.name for m in base}
            for m in live:
                if lin.trials[m].candidate.name not in have:
                    gain = evaluate(lin, (*base, m))[0]
                    key = frozenset(lin.trials[i].candidate.called for i in (*base, m))
                    if gain > seen.get(key, (0.0,))[0]:
                        seen[key] = gain, (*base, m)
        best = sorted(seen.values(), key=lambda f: -f[0])[:BEAM]
        beam = [_exchanged(lin, live, members) for _, members in best]
        found[size] = sorted((_proposal(lin, members) for members in beam), key=lambda f: -f.gain)
        if not beam:
            break
    return found


def _exchanged(lin: Linearised, live: Sequence[int], members: tuple[int, ...]) -> tuple[int, ...]:
    """The set with the best trial of each of its effects."""
    gain = evaluate(lin, members)[0]
    for place in range(len(members)):
        called = lin.trials[members[place]].candidate.called
        for m in live:
            if lin.trials[m].candidate.called == called:
                other = (*members[:place], m, *members[place + 1 :])
                if (value := evaluate(lin, other)[0]) > gain:
                    gain, members = value, other
    return members


def _proposal(lin: Linearised, members: tuple[int, ...]) -> EffectSet:
    gain, s = evaluate(lin, members)
    index = [i for m in members for i in lin.places[m]]
    parts, rest = list[tuple[float, ...]](), list(s)
    for m in members:
        width = len(lin.places[m])
        parts.append(tuple(float(v) for v in rest[:width]))
        rest = rest[width:]
    change = lin.own + lin.response[:, index] @ s
    return EffectSet(tuple(lin.trials[m] for m in members), tuple(parts), gain, change)


def start(fitted: PredictorFit, proposal: EffectSet) -> FreeModel:
    """The fitted model with a set of effects, at that part of the linear prediction that leaves least."""
    model, found = fitted.model, list[FreeModel]()
    most = SHIFT * np.maximum(1.0, PART * np.abs(model.x))
    if any(trial.with_declared_friction for trial in proposal.trials):
        model = with_declared_friction(model)
    for part in MULTIPLES:
        for beside in (np.clip(part * proposal.change, -most, most), 0.0):
            bigger = model.at(model.x + beside)
            for trial, parts in zip(proposal.trials, proposal.parts, strict=True):
                bigger = bigger.with_effect(trial.candidate, trial.values([part * s for s in parts]))
            found.append(bigger)
    rows = np.array([m.vectors(m.x)[0] for m in found])
    left = np.sum(fitted.prediction.residuals(rows) ** 2, axis=1)
    return found[int(np.argmin(left))]
