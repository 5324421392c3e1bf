"""Which model explains harmonic amplitudes that a real table left behind (tables 6.1 and 6.2)?

The declared model is fitted to all amplitudes, then extended by one variant after the other; the variant with the
lowest Bayesian information criterion n ln(mean square) + p ln n wins, so that parameters have to be earned.

Each run is also predicted by a model that was fitted to the other runs only. A model with many parameters follows a few
amplitudes closely and still knows nothing; what it predicts for a run left out of the fit distinguishes the
two, without counting parameters.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from shake_ros.fit.free_parameters import FreeParameter, FreeParameters
from shake_ros.fit.least_squares import Fit, best_start, fit
from shake_ros.measured.harmonics import HarmonicAccount, HarmonicAmplitudes, HarmonicProblem, account
from shake_ros.physics.plant.parameters import TableParameters

SHORT, LONG = 12, 30  # most trial points of a first fit and of a final one
STARTS = 16  # random starts looked at around each centre
AGAIN = 9  # seed of the leader's last fit
Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class Variant:
    """One way to extend the declared model: its effect, the parameters it frees, values to try first.

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
        return np.asarray(self.problem.measured + fitted.fit.residuals)


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
        start = best_start(problem, free, starts)
        short.append(fit(problem, free, start, evaluations=SHORT, tolerance=1e-3))
    best = min(short, key=lambda f: f.cost)
    return fit(problem, free, best.x, evaluations=LONG, tolerance=1e-4)


def extended_fit(problem: HarmonicProblem, base: Fit, others: Sequence[np.ndarray], variant: Variant) -> Fit:
    """A fitted model extended by a variant: from each of its trials at each of `others`.

    Parameters
    ----------
    base : the fitted model.
    others : values of its parameters to start from, in units of its scales.
    """
    extended = FreeParameters(base.table.with_values(variant.fixed), [*base.free.free, *variant.free])
    centres = []
    for values in variant.trials:
        for other in others:
            x = extended.x_of(values)
            x[: len(other)] = other
            centres.append(x)
    return best_of(problem, extended, centres, STARTS, variant.seed)


def study(
    table: TableParameters,
    free: Sequence[FreeParameter],
    variants: Sequence[Variant],
    problem: HarmonicProblem,
    progress: Progress,
    first: Sequence[Mapping[str, float]] = (),
) -> MeasuredRuns:
    """Fit the declared model and every variant; the best variant once more from starts around its solution.

    Parameters
    ----------
    table : declared table.
    free : its parameters that may move.
    variants : extensions to try.
    first : values by dotted name from which the declared model is fitted too.
    """
    declared_free = FreeParameters(table, free)
    progress("declared model", 0.0)
    given = [declared_free.x_of(values) for values in first]
    declared = best_of(problem, declared_free, [declared_free.start(), *given], 2 * STARTS, 0)
    result = []
    for i, variant in enumerate(variants):
        progress(variant.name, (i + 1) / (len(variants) + 2))
        best = extended_fit(problem, declared, [declared.x, *given], variant)
        result.append(FittedVariant(variant.name, variant.effect, best))
    if not result:
        return MeasuredRuns(problem, FittedVariant("", "", declared), ())
    progress("the best one again", (len(variants) + 1) / (len(variants) + 2))
    best_index = min(range(len(result)), key=lambda i: result[i].criterion)
    leader = result[best_index]
    again = best_of(problem, leader.fit.free, [leader.fit.x] * 5, STARTS, AGAIN)
    if again.cost < leader.fit.cost:
        result[best_index] = FittedVariant(leader.name, leader.effect, again)
    return MeasuredRuns(problem, FittedVariant("", "", declared), tuple(sorted(result, key=lambda v: v.criterion)))


NEIGHBOURS = 3  # random starts around the solution of all runs, beside that solution itself
SPREAD = 0.3  # their logarithmic standard deviation


def predicted(problem: HarmonicProblem, fitted: Fit, index: int) -> np.ndarray:
    """Amplitudes of run `index` by the model fitted to all other runs, shape (orders of the run,) [m/s²].

    The fit starts at the solution of all runs and at random places around it, and the best fit to the other runs
    counts. That solution has seen the run; where the other runs leave a direction open, the start shows through.
    """
    others = problem.part([i for i in range(len(problem.runs)) if i != index])
    rng = np.random.default_rng(index)
    factors = np.exp(SPREAD * rng.standard_normal((NEIGHBOURS, len(fitted.x))))
    starts = [fitted.x, *np.clip(fitted.x * factors, fitted.free.low, fitted.free.high)]
    short = [fit(others, fitted.free, x, evaluations=SHORT, tolerance=1e-3) for x in starts]
    best = min(short, key=lambda f: f.cost)
    best = fit(others, fitted.free, best.x, evaluations=LONG, tolerance=1e-4)
    return np.asarray(problem.part([index]).simulated(fitted.free.vectors(best.x))[0])


def left_out(problem: HarmonicProblem, fitted: Fit) -> HarmonicAmplitudes:
    """Every run predicted from the others; `fitted` is the fit to all, whose parameters are fitted anew each time."""
    parts = [predicted(problem, fitted, i) for i in range(len(problem.runs))]
    return HarmonicAmplitudes(problem, np.concatenate(parts))


@dataclass(frozen=True)
class MeasuredModel:
    """One model of the runs: as printed, or fitted to them."""

    name: str  # for people
    table: TableParameters  # its parameters
    account: HarmonicAccount  # what it makes of the runs
    fitted: FittedVariant | None = None  # None where the parameters are printed
    left_out: HarmonicAmplitudes | None = None  # predictions of the runs left out, where they were made


@dataclass(frozen=True)
class HarmonicComparison:
    """Models printed, then fitted: the declared one, single extensions and second ones on top of the best of these.

    `chosen` is the one of `fitted` that explains the runs best by the information criterion, without a second effect;
    `exchanged` are the last printed model with one group of its parameters from that fit; `seconds` are ordered by the
    criterion.
    """

    problem: HarmonicProblem
    printed: tuple[MeasuredModel, ...]
    fitted: tuple[MeasuredModel, ...]
    chosen: MeasuredModel
    exchanged: tuple[MeasuredModel, ...]
    seconds: tuple[MeasuredModel, ...]

    @property
    def models(self) -> tuple[MeasuredModel, ...]:
        """All of them."""
        return (*self.printed, *self.fitted, *self.seconds)


def printed_model(problem: HarmonicProblem, name: str, table: TableParameters) -> MeasuredModel:
    """A table whose parameters are given."""
    return MeasuredModel(name, table, account(problem, table.vector()))


def fitted_model(problem: HarmonicProblem, fitted: FittedVariant) -> MeasuredModel:
    """A fitted model with each run left out once."""
    name = f"with {fitted.name}, fitted" if fitted.name else "declared model, fitted"
    prediction = left_out(problem, fitted.fit) if len(problem.runs) > 1 else None
    return MeasuredModel(name, fitted.fit.table, account(problem, fitted.fit.vector), fitted, prediction)


def exchanged_models(problem: HarmonicProblem, printed: MeasuredModel, fitted: MeasuredModel) -> list[MeasuredModel]:
    """A printed table with the parameters of one section or effect at a time from a fit: which one matters?"""
    assert fitted.fitted is not None
    groups: dict[str, dict[str, float]] = {}
    for name in fitted.fitted.fit.free.names:
        group = name.removeprefix("effects.").partition(".")[0]
        groups.setdefault(group, {})[name] = fitted.table.value(name)
    return [
        printed_model(problem, f"its {group} from the fit", printed.table.with_values(values))
        for group, values in groups.items()
    ]


def compare(
    runs: MeasuredRuns,
    printed: Mapping[str, TableParameters],
    seconds: Sequence[Variant],
    progress: Progress,
) -> HarmonicComparison:
    """Account for every model of a study, and for second effects on top of its best one.

    Parameters
    ----------
    printed : tables by name.
    seconds : extensions to try on top.
    """
    problem, best = runs.problem, runs.best
    single = [runs.declared, *runs.variants]
    steps = len(single) + 2 * len(seconds)
    fitted, added = [], []
    for i, model in enumerate(single):
        progress(f"runs left out, {model.name or 'declared model'}", i / steps)
        fitted.append(fitted_model(problem, model))
    for i, variant in enumerate(seconds):
        progress(f"second effect: {variant.name}", (len(single) + 2 * i) / steps)
        name = f"{best.name} + {variant.name}" if best.name else variant.name
        model = FittedVariant(name, variant.effect, extended_fit(problem, best.fit, [best.fit.x], variant))
        progress(f"runs left out, {model.name}", (len(single) + 2 * i + 1) / steps)
        added.append(fitted_model(problem, model))
    added.sort(key=lambda m: m.fitted.criterion if m.fitted else np.inf)
    given = tuple(printed_model(problem, name, table) for name, table in printed.items())
    chosen = fitted[single.index(best)]
    exchanged = exchanged_models(problem, given[-1], chosen) if given else []
    return HarmonicComparison(problem, given, tuple(fitted), chosen, tuple(exchanged), tuple(added))
