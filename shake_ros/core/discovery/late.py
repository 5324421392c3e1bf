"""Declared parameters that are freed late: only once they explain much of what a model leaves above the noise.

How dry friction passes through rest (the transition velocity) shows at every reversal, but weakly. Free from the start,
it would bend to whatever else the model lacks; kept for ever, it would leave a residual that other effects explain in
its place. So it is freed when its own share of the residual stands out.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from shake_ros.core.discovery.judging import Policy
from shake_ros.core.discovery.refits import CONVERGED, held_out, mean_square
from shake_ros.core.discovery.screening import explained
from shake_ros.core.identification.fit import Fit, fit
from shake_ros.core.identification.free_parameters import FreeParameter
from shake_ros.core.identification.recordings import RecordingProblem

TRIED = (0.5, 2.0)  # multiples of its value at which a parameter is first tried


def promise(problem: RecordingProblem, current: Fit, parameter: FreeParameter) -> float:
    """Fall of the mean square that freeing a parameter promises, everything else adjusting to first order."""
    vectors = np.repeat(current.free.vectors(current.x), len(TRIED), axis=0)
    column = list(current.free.base.fields).index(parameter.name)
    vectors[:, column] = np.clip(vectors[:, column] * TRIED, parameter.low, parameter.high)
    moved = np.nan_to_num(problem.residuals(vectors), nan=1e3, posinf=1e3, neginf=-1e3)
    gains = [explained(current.residuals, current.jacobian, m - current.residuals, signed=True)[0] for m in moved]
    return max(gains) * mean_square(current.residuals)


def freed_late(
    problem: RecordingProblem,
    hold: RecordingProblem | None,
    current: Fit,
    late: Sequence[FreeParameter],
    policy: Policy,
) -> Fit:
    """The fit with late parameters freed as well, each where it takes much of what stands above the noise; else as is.

    Parameters
    ----------
    problem, hold : recordings to learn from and held out; the cost on the latter must fall too, where there are any.
    """
    for parameter in late:
        above = mean_square(current.residuals) - problem.noise_cost()
        if above <= 0.0 or parameter.name in current.free.names:
            continue
        if promise(problem, current, parameter) < policy.promising * above:
            continue
        free = current.free.extended([parameter])
        start = np.append(current.x, free.start()[-1])
        tried = fit(problem, free, start, evaluations=policy.converging, tolerance=CONVERGED)
        helps = mean_square(current.residuals) - mean_square(tried.residuals) > policy.freeing * above
        if helps and (hold is None or held_out(hold, tried) < held_out(hold, current)):
            current = tried
    return current
