"""A search that goes on where it stopped, on more recordings.

The models found and those that could stand in the place of one of their effects are fitted to all recordings from where
they stand, and the choice between them is made again. What else the recordings show, the search looks for as before: an
effect is added only with all that could stand for it beside it.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import replace

from shake_ros.core.discovery.candidates import CandidateEffect
from shake_ros.core.discovery.elimination import eliminate
from shake_ros.core.discovery.forward_selection import stages
from shake_ros.core.discovery.given_answer import with_rivals
from shake_ros.core.discovery.problem import ModelStructure, Progress, SearchProblem, Stopped, linearised, unstopped
from shake_ros.core.discovery.search_settings import SearchSettings
from shake_ros.core.failures import RAISING, Failures
from shake_ros.core.identification.recordings import Record
from shake_ros.core.identification.time_budget import never, within_budget
from shake_ros.core.plant.parameters import TableParameters
from shake_ros.search.close_loop import LoopClosure, concluded
from shake_ros.search.rival_models import RivalModel


def continued(
    model: ModelStructure,
    before: LoopClosure,
    rivals: Sequence[RivalModel],
    estimation: Sequence[Record],
    validation: Sequence[Record],
    settings: SearchSettings,
    progress: Progress,
    deadline_passed: Callable[[], bool] = never,
    failures: Failures = RAISING,
) -> LoopClosure:
    """The result of a search on more recordings.

    Parameters
    ----------
    model : declared model with its free parameters and the effects that it may lack.
    before : result on fewer recordings.
    rivals : of its model.
    estimation, validation : all recordings, the new ones too.
    settings, progress, deadline_passed, failures : as of `close_loop`.
    """
    problem = SearchProblem.of(model, estimation, validation, settings, unstopped(progress))
    problem.progress("fitting the models found and their rivals to all recordings", 0.2)
    free = before.search.declared.fit.free
    declared = problem.fitted(free, before.search.declared.fit.x, settings.converging_evaluations, settings.converged)
    again = before.search.on(lambda m: problem.scored(linearised(problem.estimation, m.fit)), problem.converged_again)
    found = replace(
        again, declared=declared if again.steps else again.final, rejected=(), functions=None, stopped=False
    )
    instead: dict[str, list[tuple[CandidateEffect, TableParameters]]] = {}
    for r in rivals:
        if r.replaced is not None and r.candidate:
            effect = found.steps[r.replaced].chosen.candidate.effect
            instead.setdefault(effect, []).append((r.candidate, r.result.fit.table))
    found = with_rivals(problem, found, instead)
    present = {step.chosen.candidate.effect for step in found.steps}
    left = replace(model, shown=(), candidates=tuple(c for c in model.candidates if c.effect not in present))
    searching = replace(problem, progress=progress)
    with failures.step("search"), contextlib.suppress(Stopped):
        for grown in stages(searching, found, left):
            found = grown
    steps, final, removed = eliminate(problem, found.steps, found.final)
    found = replace(found, steps=steps, final=final, removed=(*found.removed, *removed))
    with within_budget(deadline_passed):
        return concluded(problem, found, model, estimation, failures)
