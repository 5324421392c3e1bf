"""Effects that show without a search: a specimen's mode in the linear response, a slow accelerometer in the sensors.

They are fitted together from where the stages of the first fit have led them, since the declared model alone may bend
far away from the truth where it lacks them. Each has then to prove its worth like any other.
"""

from __future__ import annotations

from shake_ros.core.discovery.decision import ForwardStep, improves
from shake_ros.core.discovery.elimination import without
from shake_ros.core.discovery.problem import ModelStructure, ScoredFit, SearchProblem, Stopped, patiently
from shake_ros.core.discovery.refit import Refit
from shake_ros.core.identification.free_parameters import FreeParameters


def shown_steps(problem: SearchProblem, model: ModelStructure, declared: ScoredFit) -> tuple[ForwardStep, ...]:
    """A step for each effect that shows and that the model is better with, what it needs most first."""
    assert model.fitted is not None
    settings, tried = problem.settings, len(model.candidates)
    left = [c for c in model.candidates if c.effect in model.shown]
    steps, shown = list[ForwardStep](), len(left)
    own = [p for c in left for p in c.free]
    free = FreeParameters(model.table, [*model.free, *own])  # a table that lacks them, so that each can be taken out
    start = free.x_of({p.name: model.fitted.value(p.name) for p in (*model.free, *own)})
    patiently(problem.progress)(f"with {' and '.join(c.effect for c in left)}", 0.0)
    final = problem.fitted(free, start, settings.converging_evaluations, settings.converged)
    while left:
        try:
            problem.progress("which of them are needed?", 1.0 - len(left) / shown)
        except Stopped:  # how sure each is will be judged all the same
            return (*(ForwardStep(each, (each,)) for each in (Refit(c, final, 0.0) for c in left)), *reversed(steps))
        reduced = [without(problem, final, c) if len(left) > 1 else declared for c in left]
        least = min(range(len(left)), key=lambda i: reduced[i].score)
        dropped = left.pop(least)
        if improves(final, reduced[least], settings, tried):
            refit = Refit(dropped, final, 0.0)
            steps.append(ForwardStep(refit, (refit,)))
        final = reduced[least]
    return tuple(reversed(steps))
