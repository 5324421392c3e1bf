"""Every effect that the model found lacks, as a rival of it: the strongest trial that the recordings leave possible.

The trials of an effect are those by which the search looks for it, the weakest about as strong as it takes to matter.
With all parameters of the model refitted to first order, a trial is possible where the recordings are no more than
HARDLY against it. What they have not visited they do not exclude; an effect without a possible trial is excluded.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
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


def possible_effects(
    problem: RecordingProblem, found: Fit, wide: float, candidates: Sequence[CandidateEffect]
) -> dict[str, Fit]:
    """By effect, the model found with the strongest trial that the recordings leave possible.

    Parameters
    ----------
    problem : of the recordings at hand.
    found : the model, with its residuals and its Jacobian there.
    wide : widening of its variances.
    candidates : effects that it lacks.
    """
    q, triangle = np.linalg.qr(found.jacobian)

    def unexplained(residuals: Array) -> Array:
        return np.asarray(np.sum(residuals**2, axis=-1) - np.sum((residuals @ q) ** 2, axis=-1))

    def strongest(candidate: CandidateEffect) -> Fit | None:
        bases = [found.free.base.with_values(trial) for trial in candidate.trials]
        models = [replace(found, free=FreeParameters(base, found.free.free)) for base in bases]
        moved = np.nan_to_num(problem.residuals(np.array([m.vector for m in models])), nan=LOST)
        against = 0.5 * (unexplained(moved) - unexplained(found.residuals)) / wide
        if not np.any(against < HARDLY):
            return None
        last = int(np.flatnonzero(against < HARDLY)[-1])
        change = np.linalg.lstsq(triangle, -q.T @ moved[last], rcond=1e-10)[0]
        free = models[last].free
        return replace(models[last], x=np.clip(found.x + np.clip(change, -1.0, 1.0), free.low, free.high))

    made = zip(candidates, side_by_side(strongest, candidates), strict=True)
    return {candidate.effect: fit for candidate, fit in made if fit is not None}
