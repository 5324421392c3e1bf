"""Exchange: another effect in the place of one that was added, beside all others of the final model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from shake_ros.core.discovery.decision import ForwardStep
from shake_ros.core.discovery.problem import ScoredFit, SearchProblem
from shake_ros.core.discovery.refit import Refit
from shake_ros.core.identification.free_parameters import FreeParameters


def in_its_place(problem: SearchProblem, final: ScoredFit, step: ForwardStep, other: Refit) -> Refit:
    """The final model with another effect in the place of a step's, all parameters refitted."""
    start, own = final.fit, {f.name for f in step.chosen.candidate.free}
    keep = [i for i, name in enumerate(start.free.names) if name not in own]
    there = other.result.fit.table
    more = [f for f in other.candidate.free if f.name not in start.free.names]
    base = start.free.base.with_values({f.name: there.value(f.name) for f in more})
    free = FreeParameters(base, [*(start.free.free[i] for i in keep), *more])
    x = np.append(start.x[keep], FreeParameters(base, more).start())
    settings = problem.settings
    tried = problem.fitted(free, x, settings.converging_evaluations, settings.continued_tolerance)
    return replace(other, result=tried)


def rivals(steps: Sequence[ForwardStep], step: ForwardStep, nearest: float, most: int) -> list[Refit]:
    """Effects that came near a step's when it was chosen, the nearest first, and all that were named beside it."""
    present = {s.chosen.candidate.effect for s in steps}
    others = [r for r in step.ranking if r.candidate.effect not in present]
    near = [r for r in others if r.score < nearest * step.chosen.score][:most]
    return near + [r for r in others if r.candidate.effect in step.alternatives and r not in near]
