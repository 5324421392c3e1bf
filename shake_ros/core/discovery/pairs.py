"""Two effects at once, where no single one lowers the error: a resonance and a friction can hide each other.

Each of the best single refits, none of which was good enough, stands as if it were there; the others are screened and
refitted on top of it. The pair is held against the model without both, over as many pairs as there are.
"""

from __future__ import annotations

from shake_ros.core.discovery.candidates import CandidateEffect
from shake_ros.core.discovery.decision import ForwardStep, improves
from shake_ros.core.discovery.problem import ScoredFit, SearchProblem
from shake_ros.core.discovery.refit import Refit, continued, ranked, refit
from shake_ros.core.discovery.screening import screen


def second_beside(problem: SearchProblem, first: Refit, candidates: tuple[CandidateEffect, ...]) -> tuple[Refit, ...]:
    """Refits of a second effect on top of a first one, the best score first; empty where none promises anything."""
    settings = problem.settings
    screening = screen(problem, first.result, tuple(c for c in candidates if c.effect != first.candidate.effect))
    effects = [t.candidate.effect for t in screening.best if t.gain > settings.least_screened]
    return refit(problem, screening, effects[: settings.paired_refits], ()) if effects else ()


def best_pair(
    problem: SearchProblem, current: ScoredFit, candidates: tuple[CandidateEffect, ...], singles: tuple[Refit, ...]
) -> tuple[ForwardStep, ForwardStep] | None:
    """The best two effects that improve the model together, of those whose first is among the best singles."""
    settings = problem.settings
    if current.validation_cost < settings.much_left * problem.validation.noise_cost():
        return None
    found: tuple[Refit, tuple[Refit, ...]] | None = None
    for first in singles[: settings.paired]:
        problem.progress(f"pairs with {first.candidate.effect}", 0.9)
        seconds = second_beside(problem, first, candidates)
        if seconds and (found is None or seconds[0].score < found[1][0].score):
            found = first, seconds
    if found is None:
        return None
    first, seconds = found
    second = continued(problem, seconds[0], settings.converging_evaluations, settings.converged)
    tried = len(candidates) * (len(candidates) - 1) // 2
    if not improves(second.result, current, settings, tried):
        return None
    others = tuple(r for r in singles if r is not first)
    return ForwardStep(first, (first, *others)), ForwardStep(second, ranked([second], seconds[1:]))
