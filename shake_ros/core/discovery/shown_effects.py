"""Effects that show without a search, and several in one step where no single one helps.

A specimen's mode shows in the linear response, a slow accelerometer in the sensors. They are fitted together from
where the stages of the first fit have led them, since the declared model alone may bend far away from the truth where
it lacks them. Each has then to prove its worth like any other.

A soft zone hides the mode of a specimen from every model that has only one of the two, and a dead time both. So where
the search comes to its end far above the noise without an effect, many are freed at once (joint_start.py), in runs that
are corrected towards the measurement; those that the fit holds on to are fitted together as well.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from shake_ros.core.discovery.candidates import CandidateEffect
from shake_ros.core.discovery.decision import ForwardStep, improves
from shake_ros.core.discovery.elimination import without
from shake_ros.core.discovery.problem import ModelStructure, ScoredFit, SearchProblem, Stopped, unstopped
from shake_ros.core.discovery.refit import Refit
from shake_ros.core.identification.free_parameters import FreeParameters, is_of_recording
from shake_ros.core.identification.joint_start import joint_start, loss

DOUBTFUL = 4.0  # of the least loss to first order, up to which an effect may be the one that is needed least
HIGH_RATIO = 5.0  # ratio of the residual to the noise from which effects are looked for together
ALSO = ("specimen_resonance", "command_delay")  # from their middle trial: near nothing they have no meaning


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


def joint_steps(problem: SearchProblem, model: ModelStructure, current: ScoredFit) -> tuple[ForwardStep, ...]:
    """A step for each of the effects that only together make the model better; none where it is near the noise."""
    if current.estimation_cost < HIGH_RATIO**2 * problem.estimation.noise_cost():
        return ()
    problem.progress("fitting several effects at once", 0.0)
    part = {c.effect: c for c in model.candidates if c.together}
    part |= {c.effect: replace(c, together=c.trials[len(c.trials) // 2]) for c in model.candidates if c.effect in ALSO}
    guess = current.fit.table
    table, stay = joint_start(problem.estimation_pieces, model.free, part, guess)
    return shown_steps(problem, replace(model, shown=stay, fitted=table), current) if stay else ()
