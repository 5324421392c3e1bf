"""The verdict on each effect in the final model: the odds of that model against the same without the effect.

An effect is

    established      at sure odds, which no other effect shares, and with the residual near the noise
    one of these     another effect in its place is not excluded at sure odds
    likely           at better odds than even, but not sure, or much is unexplained; or there was no time to assess it
    not established  at no better odds than even; its strength at a bound, or any number of it while much is unexplained
    not needed       where the model is as good without it: it leaves the model, and is nobody's question

The odds count only beyond what remains unexplained: a combination with something else may replace the effect; one at a
bound does the work of something that is missing. Such effects are candidates, not findings. Not so what the recordings
show without a model, which is established whatever is unexplained: an effect by which the sensors differ, as whatever
else is missing moves the table and the table moves both sensors; or a backlash whose dwells the acceleration shows.

A fit without an effect that had to end early leaves at least what it would have left at its end. So when the time
budget is over an effect may still turn out to be needless, but none is established.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from shake_ros.fit.least_squares import time_is_over
from shake_ros.fit.uncertainty import at_bound
from shake_ros.search.candidate_effects import CandidateEffect
from shake_ros.search.decision import ForwardStep, from_lesser, log_odds, odds_of, unexplained, without
from shake_ros.search.problem import ScoredFit, SearchProblem
from shake_ros.search.selection import Selection

ESTABLISHED, LIKELY, ONE_OF_THESE, NOT_ESTABLISHED = "established", "likely", "one of these", "not established"
NOT_NEEDED = "not needed"


@dataclass(frozen=True)
class EffectVerdict:
    """What is concluded about one effect in the final model.

    odds : of the final model against the same without it, beyond what remains unexplained, 10⁶ at most. worth : rms
    residual of the validation data without it, over that with it [-]. reason : of the verdict, one phrase.
    alternatives : effects that could stand for it in the final model. bounds : its parameters that rest on a bound.
    candidate, model : the effect with its parameters, and the model that had it when it was assessed.
    """

    effect: str
    place: str
    state: str
    odds: float
    worth: float
    reason: str
    alternatives: tuple[str, ...] = ()
    bounds: tuple[str, ...] = ()
    candidate: CandidateEffect | None = field(default=None, repr=False)
    model: ScoredFit | None = field(default=None, repr=False)


def resting_parameters(final: ScoredFit, step: ForwardStep) -> tuple[str, ...]:
    """Parameters of an effect that rest on a bound in the final fit, but for a strength that is absent."""
    names = {f.name for f in step.chosen.candidate.free}
    resting = zip(final.fit.free.names, at_bound(final.fit), strict=True)
    return tuple(name for name, rests in resting if rests and name in names)


def verdict_of(
    problem: SearchProblem, found: Selection, step: ForwardStep, shown: Sequence[str] = ()
) -> tuple[EffectVerdict, ScoredFit]:
    """The verdict on one effect, and the final model without it.

    shown : effects that the recordings show without a model.
    """
    settings, final = problem.settings, found.final
    candidate, noise = step.chosen.candidate, problem.validation.noise_cost()
    shows = candidate.effect in shown
    left = 0.0 if shows else unexplained(problem, final)
    reduced = without(problem, final, candidate, found.near_without(candidate.effect))
    worth = float(np.sqrt(reduced.validation_cost / final.validation_cost))
    bounds = resting_parameters(final, step)
    odds = log_odds(final, reduced, 1, left)
    near_noise = final.validation_cost <= settings.near_noise**2 * noise
    others = step.alternatives
    early = time_is_over()
    if log_odds(final, reduced, 1) <= 0.0:
        state, reason = NOT_NEEDED, "the model is as good without it"
    elif candidate.strength.name in bounds:
        state, reason = NOT_ESTABLISHED, "its strength is at a bound; it stands in for an effect that is missing"
    elif odds <= 0.0:
        state, reason = NOT_ESTABLISHED, "more remains unexplained than it explains"
    elif bounds and not (near_noise or shows):
        state, reason = NOT_ESTABLISHED, "at a bound, and the unexplained residual may have the same cause"
    elif others:
        state, reason = ONE_OF_THESE, "another effect explains the data equally well"
    elif early:
        state, reason = LIKELY, "not fully assessed: the time budget ended"
    elif odds < math.log(settings.sure):
        state, reason = LIKELY, "the recordings hardly show it"
    elif near_noise:
        state, reason = ESTABLISHED, "needed, no other effect replaces it, and the residual is near the noise"
    elif shows:
        state, reason = (
            ESTABLISHED,
            "the recordings show it without a model, though much of the residual is unexplained",
        )
    else:
        state, reason = LIKELY, "needed, but much of the residual is unexplained"
    about = candidate.effect, candidate.place, state, odds_of(odds), worth, reason
    return EffectVerdict(*about, others, bounds, candidate, final), reduced


def with_verdicts(
    problem: SearchProblem, found: Selection, shown: Sequence[str] = ()
) -> tuple[Selection, tuple[EffectVerdict, ...], tuple[EffectVerdict, ...]]:
    """The selection with what is established, likely or one of several; the verdicts on it; and those not established.

    Effects that are not established or not needed leave the model one by one, the one worth least first, and the others
    are assessed again without it; so are all where the model without one of them shows that the fit with it was a poor
    minimum. shown : effects that the recordings show without a model.
    """
    problem.progress("assessing each effect", 0.5)
    dropped: list[EffectVerdict] = []
    while found.steps:
        each = [verdict_of(problem, found, step, shown) for step in found.steps]
        lesser, nearly = min((m for _, m in each), key=lambda m: m.estimation_cost), 1.0 - problem.settings.converged
        if lesser.estimation_cost < nearly * found.final.estimation_cost and not time_is_over():
            again = found.on(lambda m: m, partial(from_lesser, problem, lesser=lesser))
            if again.final.estimation_cost < nearly * found.final.estimation_cost:
                found = again
                continue
        refused = [i for i, (s, _) in enumerate(each) if s.state in (NOT_ESTABLISHED, NOT_NEEDED)]
        if not refused:
            return found, tuple(s for s, _ in each), tuple(dropped)
        i = min(refused, key=lambda i: each[i][0].worth)
        verdict, lesser = each[i]
        dropped += [verdict] * (verdict.state == NOT_ESTABLISHED)
        steps = tuple(s for k, s in enumerate(found.steps) if k != i)
        found = replace(found, steps=steps, final=lesser, removed=(*found.removed, verdict.effect))
    return found, (), tuple(dropped)
