"""Which parameter of a thing changed, and when, in readings one after the other."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import norm, t

FALSE_ALARM = 0.01  # over all parameters and places of one thing
LEAST = 2  # readings without which nothing can be told
SCATTER = 0.02  # of a parameter from reading to reading that no standard error counts, relative to its size


@dataclass(frozen=True)
class Reading:
    """Parameters at a time. values : parameter → value and standard error; None where it has none."""

    when: str
    values: Mapping[str, tuple[float, float | None]]


@dataclass(frozen=True)
class StepChange:
    """A parameter that stepped. when : first reading behind the step. before, after : weighted means.

    score : the step over its standard deviation [-]. chance : of such a score where nothing changed [-].
    """

    parameter: str
    when: str
    before: float
    after: float
    score: float
    chance: float


def step_changes(readings: Sequence[Reading]) -> list[StepChange]:
    """The steps that stand out, the surest first; each thing's readings are taken to have one at most per parameter.

    The mean of the readings before a place is compared with that behind it, each reading weighted by its variance: the
    square of its standard error, or of the scatter of the readings within both sides where that is larger (then the
    score is Student's, of as many degrees of freedom). Bonferroni's bound over all parameters and places keeps false
    alarms of a thing below FALSE_ALARM. Parameters that a fit trades for one another may step together; the surest is
    the first.

    >>> flat, step = [(1.0, 0.01)] * 4, [(5.0, 0.1), (5.1, 0.1), (9.0, 0.1), (9.1, 0.1)]
    >>> readings = [Reading(f"day {k}", {"a": flat[k], "b": step[k]}) for k in range(4)]
    >>> [(s.parameter, s.when, round(s.before, 2), round(s.after, 2)) for s in step_changes(readings)]
    [('b', 'day 2', 5.05, 9.05)]
    """
    names = sorted({name for reading in readings for name in reading.values})
    places = max(len(readings) - 1, 1) * max(len(names), 1)
    steps = [step for name in names if (step := _largest(name, readings)) is not None]
    return sorted((s for s in steps if s.chance < FALSE_ALARM / places), key=lambda step: step.chance)


def _largest(name: str, readings: Sequence[Reading]) -> StepChange | None:
    """The surest step of a parameter."""
    told = [(r.when, *r.values[name]) for r in readings if name in r.values]
    known = [(when, value, error) for when, value, error in told if error is not None and math.isfinite(value)]
    if len(known) < LEAST:
        return None
    values, errors = np.array([v for _, v, _ in known]), np.array([e for _, _, e in known])
    steps = []
    for at in range(1, len(known)):
        left = len(known) - 2
        sides = values[:at], values[at:]
        within = sum(float(np.sum((side - side.mean()) ** 2)) for side in sides)
        seen, assumed = within / left if left else 0.0, (SCATTER * float(np.mean(np.abs(values)))) ** 2
        weight = 1.0 / np.maximum(errors**2, max(seen, assumed))
        before, after = (np.average(values[part], weights=weight[part]) for part in (slice(at), slice(at, None)))
        deviation = math.sqrt(1.0 / weight[:at].sum() + 1.0 / weight[at:].sum())
        score = abs(after - before) / deviation if deviation else 0.0
        scattered = seen > max(assumed, float(np.median(errors**2)))
        chance = 2.0 * float(t.sf(score, left) if scattered else norm.sf(score))
        steps.append(StepChange(name, known[at][0], float(before), float(after), float(score), chance))
    return min(steps, key=lambda step: step.chance)
