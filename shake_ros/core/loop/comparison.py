"""Runs of a comparison: which controller followed what on which table, and what came of it."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from shake_ros.core.loop.metrics import Metrics


@dataclass(frozen=True)
class Outcome:
    """One run of a comparison.

    `load` [kg]; `table` is the number of the perturbed table, −1 for the declared one.
    """

    entry: str
    reference: str
    load: float
    table: int
    metrics: Metrics


@dataclass(frozen=True)
class Summary:
    """An entry of a comparison over its runs: mean and worst on the declared tables, and what the others did to it.

    Figures are over the runs that were not lost; `unstable` and `end_stops` count runs of both kinds of table.
    """

    entry: str
    mean: Metrics
    worst: Metrics
    perturbed_worst: Metrics
    unstable: int
    end_stops: int


def over(outcomes: Sequence[Outcome], collect: Callable[[list[float]], float]) -> Metrics:
    """Each figure collected over runs; NaN where no run has it."""
    values = {}
    for field in dataclasses.fields(Metrics):
        found = [float(getattr(o.metrics, field.name)) for o in outcomes]
        finite = [value for value in found if math.isfinite(value)]
        values[field.name] = collect(finite) if finite else math.nan
    return Metrics(**values)  # type: ignore[arg-type]


def mean(values: list[float]) -> float:
    """Arithmetic mean.

    >>> mean([1.0, 2.0])
    1.5
    """
    return math.fsum(values) / len(values)


def summarise(outcomes: Sequence[Outcome]) -> list[Summary]:
    """One summary for each entry, in the order of their first runs."""
    result = []
    for entry in dict.fromkeys(o.entry for o in outcomes):
        own = [o for o in outcomes if o.entry == entry]
        declared = [o for o in own if o.table < 0]
        others = [o for o in own if o.table >= 0]
        unstable = sum(o.metrics.unstable for o in own)
        stops = sum(o.metrics.end_stop for o in own)
        result.append(Summary(entry, over(declared, mean), over(declared, max), over(others, max), unstable, stops))
    return result


def by_load(outcomes: Sequence[Outcome], entry: str, figure: str) -> dict[float, float]:
    """Mean of one figure over the references on the declared tables, by load [kg]."""
    own = [o for o in outcomes if o.entry == entry and o.table < 0]
    loads = sorted({o.load for o in own})
    return {load: float(getattr(over([o for o in own if o.load == load], mean), figure)) for load in loads}
