"""Convergence before a decision: the best refit, its rivals, and the model without any of them.

A fit that has stopped early would make any effect look useful whose refit merely goes on with the rest.

Some declared parameters are freed late, only once they explain much of what a model leaves above the noise. How dry
friction passes through rest (the transition velocity) shows at every reversal, but weakly. Free from the start, it
would bend to whatever else the model lacks; kept for ever, it would leave a residual that other effects explain in its
place. So it is freed when its own share of the residual stands out.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shake_ros.core.discovery.problem import ScoredFit, SearchProblem, side_by_side
from shake_ros.core.discovery.refit import Refit, continued
from shake_ros.core.discovery.screening import ScoreTest
from shake_ros.core.identification.free_parameters import FreeParameter, FreeParameters


def converge(problem: SearchProblem, current: ScoredFit, refits: tuple[Refit, ...]) -> tuple[list[Refit], list[Refit]]:
    """The best refit with its rivals, all converged; and the rest as it is.

    A rival is one of the nearest to the best or resembles it, or is a fit to pieces that scores better than the best at
    its end; what does not improve on the model as it stands is none.
    """
    settings = problem.settings
    problem.progress(f"converging {refits[0].candidate.effect}", 0.95)
    best = with_declared_friction(problem, settled(problem, refits[0]))
    improved = (1.0 - 0.5 * settings.least_validation_gain) * current.score

    near = [r for r in refits[1:] if r.score < settings.rival * best.score][: settings.most_continued]

    def is_rival(r: Refit) -> bool:
        ahead = r.result.preliminary and r.score < best.score
        return (r in near or ahead or r.candidate.effect in best.candidate.resembles) and r.score < improved

    def converged(r: Refit) -> Refit:
        done = settled(problem, r)
        return taken_over(problem, best, done) if r.candidate.effect in best.candidate.resembles else done

    rivals = [r for r in refits[1:] if is_rival(r)]
    return [best, *side_by_side(converged, rivals)], [r for r in refits[1:] if not is_rival(r)]


def settled(problem: SearchProblem, tried: Refit) -> Refit:
    """A refit at its minimum: as near as differences between models are large, and nearer once the noise is near."""
    most, tolerance = problem.settings.converging_evaluations, problem.converged_at(tried.result)
    tried = continued(problem, tried, most, tolerance)
    nearer = problem.converged_at(tried.result)
    return continued(problem, tried, most, nearer) if nearer < tolerance else tried


def with_declared_friction(problem: SearchProblem, tried: Refit) -> Refit:
    """A converged refit, or a better one of the same model that begins with the declared friction.

    Friction bends first where an effect is missing, and may stay in that valley once the effect is there.
    """
    settings, start = problem.settings, tried.result.fit
    if problem.at_noise(tried.result):
        return tried
    of_friction = np.array([name.startswith("friction.") for name in start.free.names])
    x = np.where(of_friction, start.free.start(), start.x)
    again = problem.fitted(start.free, x, settings.continued_evaluations, settings.continued_tolerance)
    if again.fit.cost > (1.0 - settings.least_estimation_gain) * start.cost:
        return tried
    return settled(problem, replace(tried, result=again))


def taken_over(problem: SearchProblem, best: Refit, other: Refit) -> Refit:
    """The other refit, or a better fit of its model at the end of a path from the best one's.

    The best one's effect is taken out in steps while the other takes over. Of two effects that can stand for each other
    one has its minimum in a long valley that a fit from elsewhere ends in too early.
    """
    settings, candidate, start = problem.settings, best.candidate, best.result.fit
    strength, own = candidate.strength.name, {f.name for f in candidate.free}
    keep = [i for i, name in enumerate(start.free.names) if name not in own]
    more = [f for f in other.candidate.free if f.name not in start.free.names]
    there, here = start.table, other.result.fit.table
    values = {f.name: here.value(f.name) for f in more} | {other.candidate.strength.name: other.candidate.neutral}
    base, full = start.free.base, there.value(strength)
    x = np.append(start.x[keep], FreeParameters(base.with_values(values), more).start())
    result = other.result
    for part in settings.takeover_parts:
        left = {f.name: there.value(f.name) for f in candidate.free if part > 0.0}
        left |= {strength: candidate.neutral + part * (full - candidate.neutral)} if part > 0.0 else {}
        free = FreeParameters(base.with_values(left), [*(start.free.free[i] for i in keep), *more])
        tolerance = settings.converged if part == 0.0 else settings.takeover_tolerance
        result = problem.fitted(free, x, settings.continued_evaluations, tolerance, near=True)
        x = result.fit.x
    return replace(other, result=result) if result.fit.cost < other.result.fit.cost else other


def reconverged(problem: SearchProblem, current: ScoredFit, best: Refit) -> ScoredFit:
    """The current fit, or a better one of the same model that starts where the best refit has led its parameters."""
    problem.progress("repeating the fit without it", 0.98)
    settings, free = problem.settings, current.fit.free
    start = best.result.fit.x[: len(current.fit.x)]
    again = problem.fitted(free, start, settings.converging_evaluations, problem.converged_at(current))
    return again if again.fit.cost < (1.0 - settings.least_estimation_gain) * current.fit.cost else current


def refined(problem: SearchProblem, refits: list[Refit]) -> list[Refit]:
    """Converged refits with late parameters freed as well, where these explain much of what a refit leaves."""
    return list(side_by_side(lambda r: replace(r, result=with_late_parameters(problem, r.result)), refits))


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
