"""The search over sets of effects, on a declared table and its recordings."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from shake_ros.core.discovery.candidates import CandidateEffect
from shake_ros.core.discovery.given_answer import GivenAnswer
from shake_ros.core.discovery.problem import ModelStructure
from shake_ros.core.identification.recordings import Record
from shake_ros.fit.model import TriedEffect, start_of
from shake_ros.fit.prediction import Levels
from shake_ros.fit.segment import Segment, pieces
from shake_ros.fit.solver import Budget
from shake_ros.search.candidates import functions, listed
from shake_ros.search.loop import SearchData, SetSearch

SECONDS, PIECE = 14.0, 3.5  # of the estimation data that are fitted, and length of each piece [s]
VALIDATION_SECONDS = 10.0  # of the validation data
DECLARED = Levels(force=3.0, null=1e-6, null_drift=1e-6, bias=1e-6, bias_drift=1e-7)  # offsets are effects here


def answer(
    model: ModelStructure,
    estimation: Sequence[Record],
    validation: Sequence[Record],
    budget: Budget,
    progress: Callable[[str], None],
) -> GivenAnswer:
    """The effects that a declared table lacks.

    Parameters
    ----------
    model : declared model with its free parameters and the effects that it may lack.
    estimation, validation : recordings that are fitted, and recordings that choose between models.
    budget : how long it may take. progress : called with a line of progress.
    """
    data = SearchData(
        tuple(Segment.of(r) for r in pieces(estimation, SECONDS, PIECE)),
        tuple(Segment.of(r) for r in pieces(validation or estimation, VALIDATION_SECONDS, PIECE)),
    )
    search = SetSearch(data, [listed(c) for c in model.candidates], functions, budget, progress)
    declared, best = search.run(start_of(model.table, (*model.free, *model.late)), DECLARED)
    effects = tuple(_named(c, model.candidates) for c in best.model.effects)
    return GivenAnswer(declared.model.found_table(), best.model.found_table(), effects, budget.over())


def _named(candidate: TriedEffect, known: Sequence[CandidateEffect]) -> CandidateEffect:
    """The effect of a candidate."""
    found = next((c for c in known if c.effect == candidate.name), None)
    return found or CandidateEffect(candidate.name, candidate.free, (), candidate.place, candidate.depends_on)
