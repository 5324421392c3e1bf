"""Which effect explains harmonic amplitudes that a real table left behind (tables 6.1 and 6.2)?

The declared model is fitted to all amplitudes, then extended by one variant after the other; the variant with the
lowest Bayesian information criterion n ln(mean square) + p ln n wins, so that parameters have to be earned.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from shake_ros.core.identification.fit import Fit, fit
from shake_ros.core.identification.free_parameters import FreeParameter, FreeParameters
from shake_ros.core.measured_harmonics.harmonics import HarmonicProblem
from shake_ros.core.plant.parameters import TableParameters

SHORT, LONG = 12, 30  # most trial points of a first fit and of a final one
STARTS = 16  # random starts looked at around each centre
AGAIN = 9  # seed of the leader's last fit
Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class Variant:
    """One way to extend the declared model: the effect it stands for, parameters it frees, values to try first.

    `seed` draws its random starts, so that a variant gives the same whichever others are tried beside it. `fixed` are
    values that it sets and does not free.
    """

    name: str
    effect: str
    free: tuple[FreeParameter, ...]
    trials: tuple[Mapping[str, float], ...]
    seed: int
    fixed: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class FittedVariant:
    """A fitted variant; `name` is empty for the declared model."""

    name: str
    effect: str
    fit: Fit

    @property
    def rms(self) -> float:
        """Root mean square error of the amplitudes [m/s²]."""
        return float(np.sqrt(np.mean(self.fit.residuals**2)))

    @property
    def criterion(self) -> float:
        """Bayesian information criterion [-]."""
        n, p = len(self.fit.residuals), len(self.fit.x)
        return n * math.log(self.rms**2) + p * math.log(n)


@dataclass(frozen=True)
class MeasuredRuns:
    """The declared model and all variants, the best variant first."""

    problem: HarmonicProblem
    declared: FittedVariant
    variants: tuple[FittedVariant, ...]

    @property
    def best(self) -> FittedVariant:
        """What explains the measurement best: the declared model itself where no variant earns its parameters."""
        return min((self.declared, *self.variants), key=lambda v: v.criterion)

    def amplitudes(self, fitted: FittedVariant) -> np.ndarray:
        """Simulated amplitudes of a fitted variant, in the order of the measured ones [m/s²]."""
        return np.asarray(self.problem.simulated(fitted.fit.free.vectors(fitted.fit.x))[0])


def spread(free: FreeParameters, centre: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
    """`count` starts: the centre itself, then random multiples of it within 1/4 … 4, shape (count, p)."""
    factors = 4.0 ** rng.uniform(-1.0, 1.0, (count, len(centre)))
    rows = np.maximum(np.abs(centre), 0.3) * factors
    rows[0] = centre
    return np.asarray(np.clip(rows, free.low, free.high))


def best_of(
    problem: HarmonicProblem, free: FreeParameters, centres: Sequence[np.ndarray], count: int, seed: int
) -> Fit:
    """Around each centre look at `count` starts and fit the best of them shortly; then fit the best of all."""
    rng = np.random.default_rng(seed)
    short = []
    for centre in centres:
        starts = spread(free, centre, count, rng)
        costs = np.sum(np.nan_to_num(problem.residuals(free.vectors(starts)), nan=1e3) ** 2, axis=1)
        start = starts[int(np.argmin(costs))]
        short.append(fit(problem, free, start, evaluations=SHORT, tolerance=1e-3))
    best = min(short, key=lambda f: f.cost)
    return fit(problem, free, best.x, evaluations=LONG, tolerance=1e-4)


def extended_fit(
    problem: HarmonicProblem, base: Fit, others: Sequence[np.ndarray], variant: Variant, starts: int = STARTS
) -> Fit:
    """A fitted model extended by a variant: from each of its trials at each of `others`.

    Parameters
    ----------
    base : the fitted model. others : values of its parameters to start from, in units of its scales.
    """
    extended = FreeParameters(base.table.with_values(variant.fixed), [*base.free.free, *variant.free])
    centres = []
    for values in variant.trials:
        for other in others:
            x = extended.x_of(values)
            x[: len(other)] = other
            centres.append(x)
    return best_of(problem, extended, centres, starts, variant.seed)


def second_effect(runs: MeasuredRuns, variant: Variant, starts: int = STARTS) -> FittedVariant:
    """The best model of a study with one more extension, fitted from that model's solution."""
    best = runs.best
    name = f"{best.name} + {variant.name}" if best.name else variant.name
    return FittedVariant(name, variant.effect, extended_fit(runs.problem, best.fit, [best.fit.x], variant, starts))


def study(
    table: TableParameters,
    free: Sequence[FreeParameter],
    variants: Sequence[Variant],
    problem: HarmonicProblem,
    progress: Progress,
    first: Sequence[Mapping[str, float]] = (),
    starts: int = STARTS,
) -> MeasuredRuns:
    """Fit the declared model and every variant; the best variant once more from starts around its solution.

    Parameters
    ----------
    table : declared table. free : its parameters that may move. variants : extensions to try.
    first : values by dotted name from which the declared model is fitted too.
    starts : random starts looked at around each centre.
    """
    declared_free = FreeParameters(table, free)
    progress("declared model", 0.0)
    centres = [declared_free.start(), *(declared_free.x_of(values) for values in first)]
    declared = best_of(problem, declared_free, centres, 2 * starts, 0)
    result = []
    for i, variant in enumerate(variants):
        progress(variant.name, (i + 1) / (len(variants) + 2))
        others = [declared.x, *(declared_free.x_of(values) for values in first)]
        best = extended_fit(problem, declared, others, variant, starts)
        result.append(FittedVariant(variant.name, variant.effect, best))
    if not result:
        return MeasuredRuns(problem, FittedVariant("", "", declared), ())
    progress("once more", (len(variants) + 1) / (len(variants) + 2))
    best_index = min(range(len(result)), key=lambda i: result[i].criterion)
    leader = result[best_index]
    again = best_of(problem, leader.fit.free, [leader.fit.x] * 5, starts, AGAIN)
    if again.cost < leader.fit.cost:
        result[best_index] = FittedVariant(leader.name, leader.effect, again)
    return MeasuredRuns(problem, FittedVariant("", "", declared), tuple(sorted(result, key=lambda v: v.criterion)))
