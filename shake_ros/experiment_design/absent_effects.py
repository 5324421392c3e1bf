"""Every effect that the model found lacks, as a rival of it: as strong as the recordings at hand leave possible.

What the recordings have not visited they do not exclude. A trial of an effect is weakened until, with all parameters
of the model refitted to first order, the recordings are no more than HARDLY against it; of the trials of an effect the
one that is weakened least stands for it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from shake_ros.core.discovery.candidates import CandidateEffect
from shake_ros.core.discovery.problem import side_by_side
from shake_ros.core.identification.fit import LOST, Fit
from shake_ros.core.identification.free_parameters import FreeParameters
from shake_ros.core.identification.recording_problem import RecordingProblem

Array = NDArray[np.float64]
HARDLY = math.log(10.0)  # gain in log likelihood below which two models are not distinguished [nats]
ROUNDS = 2  # of weakening a trial: the evidence against an effect grows about as the square of its strength


def strongest_possible(
    problem: RecordingProblem, found: Fit, wide: float, candidates: Sequence[CandidateEffect]
) -> dict[str, Fit]:
    """By effect, the model found with it as strong as the recordings leave possible.

    Parameters
    ----------
    problem : of the recordings at hand.
    found : the model, with its residuals and its Jacobian there.
    wide : widening of its variances.
    candidates : effects that it lacks.
    """
    q, triangle = np.linalg.qr(found.jacobian)

    def moved(models: Sequence[Fit]) -> Array:
        return np.nan_to_num(problem.residuals(np.array([m.vector for m in models])), nan=LOST)

    def unexplained(residuals: Array) -> Array:
        return np.asarray(np.sum(residuals**2, axis=-1) - np.sum((residuals @ q) ** 2, axis=-1))

    def possible(candidate: CandidateEffect) -> Fit:
        parts = np.ones(len(candidate.trials))
        for _ in range(ROUNDS):
            models = [with_effect(found, candidate, t, p) for t, p in zip(candidate.trials, parts, strict=True)]
            against = 0.5 * (unexplained(moved(models)) - unexplained(found.residuals)) / wide
            parts = parts * np.sqrt(HARDLY / np.maximum(against, HARDLY))
        best = len(parts) - 1 - int(np.argmax(parts[::-1]))  # of equals the last, which is the largest
        model = with_effect(found, candidate, candidate.trials[best], float(parts[best]))
        change = np.linalg.lstsq(triangle, -q.T @ moved([model])[0], rcond=1e-10)[0]
        return replace(model, x=np.clip(model.x + np.clip(change, -1.0, 1.0), model.free.low, model.free.high))

    return {c.effect: fit for c, fit in zip(candidates, side_by_side(possible, candidates), strict=True)}


def with_effect(found: Fit, candidate: CandidateEffect, trial: Mapping[str, float], part: float) -> Fit:
    """A model with a part of a trial of an effect more; without a strength of its own all of the trial is weakened."""
    strength, neutral = candidate.strength.name, candidate.neutral
    weakened = {strength} if trial.get(strength, neutral) != neutral else set(trial)
    before = {name: neutral if name == strength else 0.0 for name in weakened}
    values = {n: before[n] + part * (v - before[n]) if n in weakened else v for n, v in trial.items()}
    return replace(found, free=FreeParameters(found.free.base.with_values(values), found.free.free))
