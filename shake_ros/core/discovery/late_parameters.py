"""Parameters that are freed late, only once they explain much of what a model leaves above the noise.

How dry friction passes through rest (the transition velocity) shows at every reversal, but weakly. Free from the start,
it would bend to whatever else the model lacks; kept for ever, it would leave a residual that other effects explain in
its place. So it is freed when its own share of the residual stands out.
"""

from __future__ import annotations

import numpy as np

from shake_ros.core.discovery.problem import ScoredFit, SearchProblem
from shake_ros.core.discovery.screening import ScoreTest
from shake_ros.core.identification.free_parameters import FreeParameter


def promise(problem: SearchProblem, current: ScoredFit, parameter: FreeParameter) -> float:
    """Fall of the estimation cost that freeing a parameter promises, everything else adjusting to first order."""
    settings, result = problem.settings, current.fit
    vectors = np.repeat(result.free.vectors(result.x), len(settings.late_multiples), axis=0)
    column = list(result.free.base.fields).index(parameter.name)
    vectors[:, column] = np.clip(vectors[:, column] * settings.late_multiples, parameter.low, parameter.high)
    moved = np.nan_to_num(problem.estimation.residuals(vectors), nan=1e3, posinf=1e3, neginf=-1e3)
    r, test = result.residuals, ScoreTest(result.residuals, result.jacobian)
    return max(test.gain(m - r, True, settings.largest_multiple)[0] for m in moved) * current.estimation_cost


def with_late_parameters(problem: SearchProblem, current: ScoredFit) -> ScoredFit:
    """The fit with late parameters freed as well, each where it takes much of what stands above the noise; else as is.

    The cost on the validation data must fall too.
    """
    settings = problem.settings
    for parameter in problem.late:
        above = current.estimation_cost - problem.estimation.noise_cost()
        if above <= 0.0 or parameter.name in current.fit.free.names:
            continue
        if promise(problem, current, parameter) < settings.late_promise * above:
            continue
        free = current.fit.free.extended([parameter])
        start = np.append(current.fit.x, free.start()[-1])
        tried = problem.fitted(free, start, settings.converging_evaluations, settings.converged, near=True)
        helps = current.estimation_cost - tried.estimation_cost > settings.late_gain * above
        if helps and tried.validation_cost < current.validation_cost:
            current = tried
    return current
