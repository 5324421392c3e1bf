"""A search that goes on where it stopped, on more recordings: it begins with the effects found, at their values."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from shake_ros.failures import RAISING, Failures
from shake_ros.fit.records import Record
from shake_ros.fit.time_budget import never
from shake_ros.repair.close_loop import LoopClosure, close_loop
from shake_ros.search.problem import ModelStructure, Progress
from shake_ros.search.search_settings import SearchSettings


def continued(
    model: ModelStructure,
    before: LoopClosure,
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
    estimation, validation : all recordings, the new ones too.
    settings, progress, deadline_passed, failures : as of `close_loop`.
    """
    found = [step.chosen.candidate.effect for step in before.search.steps]
    table = before.search.final.fit.table
    begin = replace(model, table=table.without(found), fitted=table, shown=tuple(found))
    return close_loop(begin, estimation, validation, settings, progress, deadline_passed, failures)
