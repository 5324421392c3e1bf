"""Effects that show without a search: a specimen's mode in the linear response, a slow accelerometer in the sensors.

They are fitted together from where the stages of the first fit have led them, since the declared model alone may bend
far away from the truth where it lacks them. Each has then to prove its worth like any other.
"""

from __future__ import annotations

from collections.abc import Sequence

from shake_ros.core.discovery.candidates import CandidateEffect
from shake_ros.core.discovery.decision import ForwardStep, improves
from shake_ros.core.discovery.elimination import without
from shake_ros.core.discovery.problem import ModelStructure, ScoredFit, SearchProblem, Stopped, unstopped
from shake_ros.core.discovery.refit import Refit
from shake_ros.core.identification.free_parameters import FreeParameters, is_of_recording
from shake_ros.core.identification.joint_start import loss

DOUBTFUL = 4.0  # of the least loss to first order, up to which an effect may be the one that is needed least


def shown_steps(problem: SearchProblem, model: ModelStructure, declared: ScoredFit) -> tuple[ForwardStep, ...]:
    """A step for each effect that shows and that the model is better with, what it needs most first."""
    assert model.fitted is not None
    settings, tried = problem.settings, len(model.candidates)
    left = [c for c in model.candidates if c.effect in model.shown]
    steps, shown = list[ForwardStep](), len(left)
    own = [p for c in left for p in c.free]
    free = FreeParameters(model.table, [*model.free, *own])  # a table that lacks them, so that each can be taken out
    start = free.x_of({p.name: model.fitted.value(p.name) for p in (*model.free, *own) if not is_of_recording(p.name)})
    unstopped(problem.progress)(f"with {' and '.join(c.effect for c in left)}", 0.0)
    final = problem.fitted(free, start, settings.converging_evaluations, settings.converged)
    while left:
        try:
            problem.progress("which of them are needed?", 1.0 - len(left) / shown)
        except Stopped:  # each has its verdict all the same
            return (*(ForwardStep(each, (each,)) for each in (Refit(c, final, 0.0) for c in left)), *reversed(steps))
        dropped, reduced = needed_least(problem, final, left) if len(left) > 1 else (left[0], declared)
        left.remove(dropped)
        if improves(final, reduced, settings, tried):
            refit = Refit(dropped, final, 0.0)
            steps.append(ForwardStep(refit, (refit,)))
        final = reduced
    return tuple(reversed(steps))


def needed_least(
    problem: SearchProblem, final: ScoredFit, left: Sequence[CandidateEffect]
) -> tuple[CandidateEffect, ScoredFit]:
    """The effect that a model can do without most easily, and the model refitted without it.

    Only those are refitted whose loss to first order is not far above the least.
    """
    losses = [loss(final.fit, [c.strength.name], [c.neutral / c.strength.scale]) for c in left]
    near = [c for c, lost in zip(left, losses, strict=True) if lost <= DOUBTFUL * min(losses)]
    tried = [(c, without(problem, final, c)) for c in near]
    return min(tried, key=lambda t: t[1].score)
