"""Functions without a name of two quantities, where one does not suffice.

Where a function has been estimated and the validation cost still stands clearly above the noise, the changes a(s), b(s)
of effects/unlisted.py are screened for each second quantity that its kind can have (a block score test of their nodes,
with everything else free to adjust). Where no function of one quantity is the answer, function and changes are screened
together for all pairs: a drag that depends on the place shows in no single quantity. What promises most is refitted
with all nodes free; the best is taken only where it leaves far less than the model without it, beyond chance.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from shake_ros.fit.free_parameters import FreeParameter, FreeParameters
from shake_ros.fit.least_squares import Fit
from shake_ros.fit.recording_problem import RecordingProblem
from shake_ros.physics.effects import unlisted as law
from shake_ros.search.candidate_effects import CandidateEffect
from shake_ros.search.decision import ForwardStep, Refit
from shake_ros.search.problem import ScoredFit, SearchProblem, linearised
from shake_ros.search.refined_nodes import refined_function
from shake_ros.search.unlisted_functions import (
    ABOVE_NAMES,
    BELOW_NAMES,
    KINDS,
    NODE_NAMES,
    OF_HYDRAULICS,
    OF_MOTION,
    PREFIX,
    SUPPLY,
    UNLISTED,
    WITHOUT_SECOND,
    FunctionKind,
    FunctionSearch,
    ScreenedFunction,
    extended,
    fit_function,
    fit_to_pieces,
    leaves_far_less,
    may_have_functions,
    near_noise,
    ranges,
    screen_nodes,
)

SECOND = PREFIX + "second"
CHANGES = (*ABOVE_NAMES, *BELOW_NAMES)
NODES = (*NODE_NAMES, *CHANGES)
SMALLEST = 1e-3  # of a node value that matters: function beside which a change is of no size of its own
Ranges = Mapping[str, tuple[float, float]]


@dataclass(frozen=True)
class ScreenedPair:
    """A function of two quantities: the second one, and what its nodes promise."""

    quantity: str
    function: ScreenedFunction

    @property
    def depends_on(self) -> tuple[str, ...]:
        """All that it depends on."""
        return tuple(dict.fromkeys((*self.function.kind.depends_on, self.quantity)))


def with_second_quantity(problem: SearchProblem, step: ForwardStep) -> ForwardStep:
    """A step that adds a function, or the same with a second quantity where that leaves far less."""
    one = step.chosen.result
    if near_noise(problem, one) or one.fit.free.base.value(SECOND):
        return step
    found = screen_seconds(problem, one.fit)
    best = best_pair(problem, one, found, problem.settings.promising, step.chosen.candidate.free)
    if best is None or not leaves_far_less(problem, one, best.result):
        return step
    return ForwardStep(best, (best, *step.ranking[1:]), step.alternatives)


def function_of_two(problem: SearchProblem, current: ScoredFit, tried: FunctionSearch) -> ForwardStep | None:
    """A step that adds a function of two quantities, where those of one leave too much.

    tried : functions of one quantity of this model.
    """
    if not may_have_functions(current):
        return None
    settings, found = problem.settings, screen_pairs(problem, current.fit)
    least = max(settings.most_of, settings.pair_rival * max(tried.gains.values(), default=0.0))
    if tried.best is not None and not (found and found[0].function.gain > least):
        return grown(problem, current, ForwardStep(tried.best, (tried.best,)))
    best = best_pair(problem, current, found, least)
    return ForwardStep(best, (best,)) if best and leaves_far_less(problem, current, best.result) else None


def grown(problem: SearchProblem, current: ScoredFit, one: ForwardStep) -> ForwardStep | None:
    """A function of one quantity that leaves too much, with a second one; None where that leaves too much as well."""
    if one.chosen.predicted_gain < problem.settings.most_of:
        return None
    one = refined_function(problem, one)
    both = with_second_quantity(problem, one)
    return both if both is not one and leaves_far_less(problem, current, both.chosen.result) else None


def screen_seconds(problem: SearchProblem, function: Fit) -> list[ScreenedPair]:
    """Score tests of the second quantities that a function's kind can have, the most promising first."""
    kind = KINDS[int(function.free.base.value(PREFIX + "kind"))]
    problem.progress("a second quantity", 0.0)
    values = (function.x * function.free.scale)[[function.free.names.index(name) for name in NODE_NAMES]]
    scale = max(float(np.sqrt(np.mean(values**2))), SMALLEST * kind.scale)
    current = linearised(problem.estimation_pieces, function)
    span = ranges(problem.estimation, function)
    return screened(problem, current, kind, function.free, span, scale)


def screen_pairs(problem: SearchProblem, current: Fit) -> list[ScreenedPair]:
    """Score tests of all functions of two quantities, the most promising first, one of each pair."""
    problem.progress("something of two quantities", 0.0)
    pieces: RecordingProblem = problem.estimation_pieces
    whole, visited = ranges(pieces, current), ranges(problem.estimation, current)
    model, found = linearised(pieces, current), list[ScreenedPair]()
    for kind in (*OF_MOTION, *(OF_HYDRAULICS if SUPPLY in current.free.base.fields else ())):
        low, high = whole.get(kind.quantity, (0.0, 0.0))
        if high > low:
            free = extended(model, kind, low, high)
            found += [rescaled(pair) for pair in screened(problem, model, kind, free, visited, kind.scale)]
    return sorted(found, key=lambda pair: -pair.function.gain)


def rescaled(pair: ScreenedPair) -> ScreenedPair:
    """The same with changes that matter of the size that all nodes have to first order, if that is larger."""
    f = pair.function
    own = [i for i, name in enumerate(f.free.names) if name in NODES]
    size = float(np.sqrt(np.mean((f.starts[-1] * f.free.scale)[own] ** 2)))
    free = [replace(p, scale=max(p.scale, size)) if p.name in CHANGES else p for p in f.free.free]
    scaled = FreeParameters(f.free.base, free)
    starts = tuple(start * f.free.scale / scaled.scale for start in f.starts)
    return replace(pair, function=replace(f, free=scaled, starts=starts))


def screened(
    problem: SearchProblem, current: Fit, kind: FunctionKind, function: FreeParameters, span: Ranges, scale: float
) -> list[ScreenedPair]:
    """Score tests of the nodes that a fit has not, for each second quantity of a kind, the most promising first.

    Parameters
    ----------
    function : the free parameters with a function of one quantity. span : visited range of each quantity.
    scale : a change that matters, in the unit of the kind.
    """
    found = []
    for code in law.PAIRS.get(kind.code, ()):
        quantity = law.SECONDS[code]
        low, high = span.get(quantity, (0.0, 0.0))
        if kind.code in law.OF_SPEED and code == law.VELOCITY:
            low, high = 0.0, max(abs(low), abs(high))
        if high > low:
            free = with_changes(function, kind, code, (low, high), scale)
            pieces, settings = problem.estimation_pieces, problem.settings
            found.append(ScreenedPair(quantity, screen_nodes(pieces, current, kind, free, settings)))
    return sorted(found, key=lambda pair: -pair.function.gain)


def with_changes(
    function: FreeParameters, kind: FunctionKind, code: int, ends: tuple[float, float], scale: float
) -> FreeParameters:
    """The free parameters of a function with the nodes of its changes by a second quantity between its ends behind."""
    own = {SECOND: code, f"{SECOND}_low": ends[0], f"{SECOND}_high": ends[1]}
    nodes = [FreeParameter(n, scale, kind.low, kind.high, kind.unit) for n in CHANGES]
    return FreeParameters(function.base.with_values(WITHOUT_SECOND | own), [*function.free, *nodes])


def best_pair(
    problem: SearchProblem,
    without: ScoredFit,
    found: Sequence[ScreenedPair],
    least: float,
    function: Sequence[FreeParameter] = (),
) -> Refit | None:
    """The function of two quantities that leaves the smallest validation cost, of those that promise most.

    Parameters
    ----------
    least : predicted fall from which one is refitted. function : free parameters of one quantity that it goes on from.
    """
    settings, before = problem.settings, without.fit
    records, model = problem.estimation.records, problem.estimation.model
    least = max(settings.promising * found[0].function.gain, least) if found else 0.0
    promising = [pair for pair in found[: settings.most_refitted] if pair.function.gain > least]
    refits = []
    for i, pair in enumerate(promising):
        f = pair.function
        if i == 0:
            problem.progress(without_name(f.kind.place, pair.depends_on, f.gain), 0.0)
        text = f"unlisted: {f.kind.place} of {f.kind.quantity} and {pair.quantity}"
        problem.progress(text, (i + 0.2) / len(promising))
        short = fit_to_pieces(problem, f)
        problem.progress(text, (i + 0.5) / len(promising))
        whole = fit_function(problem, f, short)
        if not model.contradicted(before.table, whole.table, records):
            own = tuple(p for p in f.free.free if p.name not in before.free.names)
            candidate = CandidateEffect(UNLISTED, (*function, *own), (), f.kind.place, pair.depends_on)
            refits.append(Refit(candidate, problem.scored(whole), f.gain))
    return min(refits, key=lambda r: r.result.validation_cost, default=None)


def without_name(place: str, depends_on: Sequence[str], gain: float) -> str:
    """Where something acts that no effect of the list would explain, and on what it depends.

    gain : relative fall of the cost that is foreseen [-].
    """
    depends = " and ".join(name.replace("_", " ") for name in depends_on)
    promise = f"predicted to remove {100.0 * gain:.0f} % of the residual"
    return f"best so far: unlisted effect, place {place}, depends on {depends}, {promise}"
