"""Exchange: another effect in the place of one that was added earlier, beside what has been added since.

An effect chosen first was chosen in a model that lacked the others; a rival may fit better beside them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from shake_ros.core.discovery.decision import ForwardStep, improves
from shake_ros.core.discovery.problem import ScoredFit, SearchProblem, side_by_side
from shake_ros.core.discovery.refit import Refit, continued
from shake_ros.core.identification.free_parameters import FreeParameters


def in_its_place(problem: SearchProblem, final: ScoredFit, step: ForwardStep, other: Refit) -> Refit:
    """The final model with another effect in the place of a step's, all parameters refitted."""
    start, own = final.fit, {f.name for f in step.chosen.candidate.free}
    keep = [i for i, name in enumerate(start.free.names) if name not in own]
    there = other.result.fit.free.table(other.result.fit.x)
    more = [f for f in other.candidate.free if f.name not in start.free.names]
    base = start.free.base.with_values({f.name: there.value(f.name) for f in more})
    free = FreeParameters(base, [*(start.free.free[i] for i in keep), *more])
    x = np.append(start.x[keep], FreeParameters(base, more).start())
    settings = problem.settings
    tried = problem.fitted(free, x, settings.converging_evaluations, settings.continued_tolerance, start)
    return replace(other, result=tried)


def rivals(steps: Sequence[ForwardStep], step: ForwardStep, nearest: float, most: int) -> list[Refit]:
    """Effects that came near a step's when it was chosen, the nearest first, and all that were named beside it."""
    present = {s.chosen.candidate.effect for s in steps}
    others = [r for r in step.ranking if r.candidate.effect not in present]
    near = [r for r in others if r.score < nearest * step.chosen.score][:most]
    return near + [r for r in others if r.candidate.effect in step.alternatives and r not in near]


def exchanged(
    problem: SearchProblem, steps: Sequence[ForwardStep], final: ScoredFit
) -> tuple[tuple[ForwardStep, ...], ScoredFit, str] | None:
    """Steps with an earlier effect replaced by a rival that fits better beside the later ones, the fit, what left."""
    settings = problem.settings
    for i, step in enumerate(steps[:-1]):
        problem.progress(f"in the place of {step.chosen.candidate.effect}", 0.9)
        near = rivals(steps, step, settings.exchanged_within, settings.most_exchanges)
        tried = list(side_by_side(lambda r, step=step: in_its_place(problem, final, step, r), near))  # type: ignore[misc]
        best = min(tried, key=lambda r: r.score, default=None)
        if best is None or not improves(best.result, final, settings, len(near)):
            continue
        best = continued(problem, best, settings.converging_evaluations, settings.converged)
        ranking = (best, *(r for r in step.ranking if r.candidate.effect != best.candidate.effect))
        changed = [*steps]
        changed[i] = ForwardStep(best, ranking)
        return tuple(changed), best.result, step.chosen.candidate.effect
    return None
