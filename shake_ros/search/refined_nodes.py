"""Nodes of a function moved to where its closed form says that they are needed.

Between nodes a function without a name is a straight line. A stop that begins between two of them is rounded off, a
bump as narrow as their spacing is blunted, and that stays in the residual however well the nodes are fitted. So where
the best closed form has kinks, the range is shifted and stretched by less than a spacing until they lie on nodes; where
it is a narrow bump, the range is that of the bump; and the nodes are fitted again.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shake_ros.fit.free_parameters import FreeParameter, FreeParameters
from shake_ros.physics.effects.unlisted import FORCE_OF_POSITION, NODES, SUPPLY_OF_PHASE
from shake_ros.search.closed_form import FORMS, FunctionForm, fitted_forms
from shake_ros.search.decision import ForwardStep
from shake_ros.search.declared_fit import with_late_parameters
from shake_ros.search.problem import SearchProblem
from shake_ros.search.unlisted_functions import NODE_NAMES, PREFIX

KINKS = {"stops": (-1.0, 1.0), "one stop": (1.0,)}  # of a form, in multiples of its g
FINE = 0.01  # of a spacing: scale of the ends of the range
FLANK = 3.5  # widths of a bump from its middle to where nothing is left of it
Range = tuple[float, float]


def aligned_range(low: float, high: float, kinks: np.ndarray) -> Range:
    """The range of NODES equally spaced nodes next to (low, high) with one or two kinks on nodes.

    >>> low, high = aligned_range(-0.7, 0.8, np.array([-0.33, 0.33]))
    >>> nodes = np.linspace(low, high, NODES)
    >>> bool(np.min(np.abs(nodes - 0.33)) < 1e-12 and np.min(np.abs(nodes + 0.33)) < 1e-12)
    True
    """
    spacing = (high - low) / (NODES - 1)
    if len(kinks) == 2 and kinks[1] - kinks[0] > 0.5 * spacing:
        spacing = (kinks[1] - kinks[0]) / max(round((kinks[1] - kinks[0]) / spacing), 1)
    first = float(kinks[0]) - spacing * round((float(kinks[0]) - low) / spacing)
    return first, first + (NODES - 1) * spacing


def better_range(kind: int, low: float, high: float, form: FunctionForm) -> Range | None:
    """The range that a form asks for; None where the present one will do."""
    if kind == FORCE_OF_POSITION:  # goes on straight beyond its range; others need that of the recordings
        kinks = np.array([k * abs(form.parameters["g"]) for k in KINKS.get(form.name, ())])
        kinks = kinks[(kinks > low) & (kinks < high)]
        if len(kinks):
            return aligned_range(low, high, kinks)
    if form.name == "bump" and kind != SUPPLY_OF_PHASE:
        middle, flank = form.parameters["m"], FLANK * abs(form.parameters["w"])
        if flank < 0.4 * (high - low) and low < middle < high:
            return middle - flank, middle + flank
    return None


def refined_function(problem: SearchProblem, step: ForwardStep) -> ForwardStep:
    """A step that adds a function, with knots added where they are needed and late parameters freed, if that helps.

    In steps that add a listed effect late parameters are freed before the decision (convergence.py).
    """
    step = with_refined_nodes(problem, step)
    better = replace(step.chosen, result=with_late_parameters(problem, step.chosen.result))
    return replace(step, chosen=better, ranking=(better, *step.ranking[1:]))


def with_refined_nodes(problem: SearchProblem, step: ForwardStep) -> ForwardStep:
    """The step, or the same with knots added to its function where they are needed, if the fit is better."""
    chosen = step.chosen
    free, x = chosen.result.fit.free, chosen.result.fit.x
    if NODE_NAMES[0] not in free.names:
        return step
    table = free.table(x)
    low, high = table.value(PREFIX + "low"), table.value(PREFIX + "high")
    values = np.array([table.value(name) for name in NODE_NAMES])
    form = fitted_forms(np.linspace(low, high, NODES), values, np.zeros(NODES))[0]
    ends = better_range(int(table.value(PREFIX + "kind")), low, high, form)
    if ends is None:
        return step
    problem.progress("adding knots where they are needed", 0.9)
    spacing = (ends[1] - ends[0]) / (NODES - 1)
    moved = [
        FreeParameter(PREFIX + name, FINE * spacing, end - spacing, end + spacing, "m")
        for name, end in zip(("low", "high"), ends, strict=True)
    ]
    with_ends = FreeParameters(free.base, [*free.free, *moved])
    values = FORMS[form.name].y(np.linspace(*ends, NODES), *form.parameters.values())
    start = np.append(x, ends / with_ends.scale[-2:])
    own = [free.names.index(name) for name in NODE_NAMES]
    start[own] = values / free.scale[own]
    start = np.clip(start, with_ends.low, with_ends.high)
    settings = problem.settings
    tried = problem.fitted(with_ends, start, settings.continued_evaluations, settings.function_tolerance, near=True)
    if tried.score >= chosen.result.score:
        return step
    candidate = replace(chosen.candidate, free=(*chosen.candidate.free, *moved))
    better = replace(chosen, candidate=candidate, result=tried)
    return replace(step, chosen=better, ranking=(better, *step.ranking[1:]))
