"""A model with one of its effects taken out, or exchanged for a rival."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict

from shake_ros.fit.free_parameters import FreeParameters
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.search.candidate_effects import CandidateEffect
from shake_ros.search.decision import ForwardStep, Refit
from shake_ros.search.problem import ScoredFit, SearchProblem

MUCH_WORSE = 10.0  # times the score: without such an effect the model is so much worse that its fit need not converge
FIRST, ROUGH = 10, 1e-2  # trial points and tolerance of the predictor and of the free fit that show whether it is


def without(problem: SearchProblem, current: ScoredFit, dropped: CandidateEffect) -> ScoredFit:
    """The fit with an effect taken out and everything else refitted; one that is far worse need not converge."""
    settings, result, names = problem.settings, current.fit, {f.name for f in dropped.free}
    keep = [i for i, f in enumerate(result.free.free) if f.name not in names]
    free = FreeParameters(result.free.base, [result.free.free[i] for i in keep])
    reduced = problem.fitted(free, result.x[keep], FIRST, ROUGH)
    if reduced.score < MUCH_WORSE * current.score:
        most = settings.continued_evaluations
        reduced = problem.fitted(free, reduced.fit.x, most, settings.converged, near=True)
    return reduced


def in_its_place(
    problem: SearchProblem, final: ScoredFit, step: ForwardStep, other: CandidateEffect, there: TableParameters
) -> ScoredFit:
    """The final model with another effect in the place of a step's, all parameters refitted.

    there : a table that has the other effect; the fit starts from its values.
    """
    start, own = final.fit, {f.name for f in step.chosen.candidate.free}
    keep = [i for i, name in enumerate(start.free.names) if name not in own]
    more = [f for f in other.free if f.name not in start.free.names]
    base = absent_on(start.free.base, [other], there)
    free = FreeParameters(base, [*(start.free.free[i] for i in keep), *more])
    x = free.x_of({f.name: there.value(f.name) for f in more})
    x[: len(keep)] = start.x[keep]
    settings = problem.settings
    return problem.fitted(free, x, settings.converging_evaluations, settings.continued_tolerance)


def rivals(steps: Sequence[ForwardStep], step: ForwardStep, most: int) -> list[Refit]:
    """Effects that came nearest to a step's, the nearest first, and all that were named beside it."""
    present = {s.chosen.candidate.effect for s in steps}
    others = [r for r in step.ranking if r.candidate.effect not in present]
    near = others[:most]
    return near + [r for r in others if r.candidate.effect in step.alternatives and r not in near]


def absent_on(base: TableParameters, among: Sequence[CandidateEffect], there: TableParameters) -> TableParameters:
    """A table on which some effects are absent until a fit moves their parameters.

    What an effect has beside these on the table `there`, such as the quantity of a function, it has here too; so a fit
    that drops the free parameters drops the effect.
    """
    moved = {p.name for c in among for p in c.free}
    kept = {
        name: value
        for c in among
        for key, value in asdict(there.effects[c.effect]).items()
        if (name := f"effects.{c.effect}.{key}") not in moved
    }
    return base.without([c.effect for c in among]).with_values(kept)
