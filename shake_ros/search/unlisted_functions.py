"""A function for what no listed effect explains: the missing term estimated on nodes over one quantity.

For each kind of function of effects/unlisted.py the residual is projected on the directions in which its nodes can move
(a block score test, with everything else free to adjust); the kinds that promise most are refitted with all nodes free,
and the best on the validation data is offered to the search like any other candidate. The period of a pulsating supply
comes from the spectrum of the residual multiplied by its sensitivity to the supply pressure.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from shake_ros.fit.free_parameters import FreeParameter, FreeParameters
from shake_ros.fit.least_squares import Adjustment, Fit, Problem, fit
from shake_ros.fit.recording_problem import RecordingProblem
from shake_ros.fit.start.narrow_valleys import approached
from shake_ros.physics.effects import unlisted as law
from shake_ros.search.candidate_effects import CandidateEffect
from shake_ros.search.decision import Refit
from shake_ros.search.problem import ScoredFit, SearchProblem, linearised
from shake_ros.search.search_settings import SearchSettings

UNLISTED = "unlisted"
PREFIX = "effects.unlisted."
SUPPLY = "supply.supply_pressure"
NODE_NAMES = tuple(f"{PREFIX}node_{i:02d}" for i in range(law.NODES))
ABOVE_NAMES, BELOW_NAMES = (tuple(f"{PREFIX}{end}_{i}" for i in range(law.CHANGES)) for end in ("above", "below"))
ROWS = (NODE_NAMES, ABOVE_NAMES, BELOW_NAMES)  # of nodes that are neighbours
WITHOUT_SECOND = dict.fromkeys((f"{PREFIX}second", *ABOVE_NAMES, *BELOW_NAMES), 0)


@dataclass(frozen=True)
class FunctionKind:
    """One kind of function: of which quantity, where it acts, on what it depends; unit and bounds of its nodes.

    scale : a node value that matters.
    """

    code: int
    quantity: str
    place: str
    depends_on: tuple[str, ...]
    unit: str
    scale: float
    low: float
    high: float


OF_MOTION = (
    FunctionKind(law.FORCE_OF_POSITION, "position", "force", ("position",), "N", 100.0, -1e5, 1e5),
    FunctionKind(law.FRICTION_OF_POSITION, "position", "friction", ("position", "direction"), "N", 100.0, -1e4, 1e4),
    FunctionKind(law.FORCE_OF_VELOCITY, "velocity", "friction", ("velocity",), "N", 100.0, -1e5, 1e5),
)
OF_HYDRAULICS = (
    FunctionKind(
        law.FRICTION_FACTOR_OF_POSITION, "position", "friction", ("position", "direction"), "-", 0.2, -0.95, 20.0
    ),
    FunctionKind(law.FLOW_GAIN_OF_OPENING, "valve_opening", "valve", ("valve_opening",), "-", 0.05, -0.95, 2.0),
    FunctionKind(law.LEAKAGE_OF_LOAD_PRESSURE, "load_pressure", "flow", ("load_pressure",), "m^3/s", 2e-6, -1e-3, 1e-3),
    FunctionKind(
        law.STIFFNESS_OF_LOAD_PRESSURE, "load_pressure", "compressibility", ("load_pressure",), "-", 0.1, -0.95, 10.0
    ),
    FunctionKind(law.FLOW_GAIN_OF_TIME, "time", "valve", ("time",), "-", 0.05, -0.95, 2.0),
)
PULSATION = FunctionKind(law.SUPPLY_OF_PHASE, "phase", "supply", ("time",), "-", 0.05, -0.9, 2.0)
KINDS = {kind.code: kind for kind in (*OF_MOTION, *OF_HYDRAULICS, PULSATION)}


@dataclass(frozen=True)
class ScreenedFunction:
    """A kind of function with its free parameters, predicted relative fall of the cost, starts for a refit."""

    kind: FunctionKind
    free: FreeParameters
    gain: float
    starts: tuple[np.ndarray, ...]


@dataclass(frozen=True)
class FunctionSearch:
    """Functions that were tried: predicted gain by (place, quantity), and the best one, refitted."""

    gains: Mapping[tuple[str, str], float]
    best: Refit | None


def leaves_far_less(problem: SearchProblem, current: ScoredFit, function: ScoredFit) -> bool:
    """Whether a function leaves far less than the model without it."""
    most = problem.settings.most_of
    fitted, chosen = function.estimation_cost / current.estimation_cost, function.validation_cost
    return fitted <= most and chosen <= most * current.validation_cost


def near_noise(problem: SearchProblem, current: ScoredFit) -> bool:
    """Whether a function of many nodes would fit chance."""
    return current.validation_cost < problem.settings.near_noise**2 * problem.validation.noise_cost()


def may_have_functions(current: ScoredFit) -> bool:
    """Whether the model has a place for a function; the reduced one has none."""
    return PREFIX + "kind" in current.fit.free.base.fields


def best_function(problem: SearchProblem, current: ScoredFit) -> FunctionSearch:
    """The kind of function that leaves the smallest validation cost, of those that promise most."""
    settings, fitted = problem.settings, current.fit
    if not may_have_functions(current):
        return FunctionSearch({}, None)
    found = screen_functions(problem, linearised(problem.estimation_pieces, fitted))
    least = max(settings.promising * found[0].gain, settings.least_function) if found else 0.0
    promising = [f for f in found[: settings.most_refitted] if f.gain > least]
    records, model = problem.estimation.records, problem.estimation.model
    short = []
    for i, f in enumerate(promising):
        problem.progress(
            f"fitting an unlisted effect: {f.kind.place} of {f.kind.quantity}", 0.4 + 0.3 * i / len(promising)
        )
        tried = fit_to_pieces(problem, f)
        if not model.contradicted(fitted.table, tried.table, records):
            short.append((f, tried))
    most = min((tried.cost for _, tried in short), default=0.0) / settings.most_of  # nearly where they end
    left = [(f, tried) for f, tried in short if tried.cost <= most]
    refits = []
    for i, (f, tried) in enumerate(left):
        problem.progress(f"fitting an unlisted effect: {f.kind.place} of {f.kind.quantity}", 0.7 + 0.3 * i / len(left))
        own = tuple(p for p in f.free.free if p.name not in fitted.free.names)
        candidate = CandidateEffect(UNLISTED, own, (), f.kind.place, f.kind.depends_on)
        refits.append(Refit(candidate, problem.scored(fit_function(problem, f, tried)), f.gain))
    refits = [r for r in refits if not model.contradicted(fitted.table, r.result.fit.table, records)]
    best = min(refits, key=lambda r: r.result.validation_cost, default=None)
    return FunctionSearch({(f.kind.place, f.kind.quantity): f.gain for f in reversed(found)}, best)


def screen_functions(problem: SearchProblem, current: Fit) -> list[ScreenedFunction]:
    """Score tests of all kinds on pieces of the estimation data, the most promising first, one of each kind."""
    pieces, settings = problem.estimation_pieces, problem.settings
    problem.progress("trying unlisted effects", 0.0)
    span = ranges(pieces, current)
    hydraulic = SUPPLY in current.free.base.fields
    kinds = [k for k in (*OF_MOTION, *(OF_HYDRAULICS if hydraulic else ())) if k.quantity in span]
    kinds = [k for k in kinds if span[k.quantity][1] > span[k.quantity][0]]
    found = [screen_function(pieces, current, k, span[k.quantity], settings) for k in kinds]
    problem.progress("trying unlisted effects: pulsation", 0.2)
    found += pulsations(pieces, current, settings) if hydraulic else ()
    best: dict[int, ScreenedFunction] = {}
    for f in sorted(found, key=lambda f: -f.gain):
        best.setdefault(f.kind.code, f)
    return list(best.values())


def ranges(problem: RecordingProblem, current: Fit) -> Mapping[str, tuple[float, float]]:
    """Range of each quantity that the recordings visit."""
    table = current.table
    seen: dict[str, list[np.ndarray]] = {}
    for record in problem.records:
        out = problem.model.run(table, record)
        for name, values in problem.model.quantities(record, out).items():
            seen.setdefault(name, []).append(values[record.start :])
    both = {name: np.concatenate(parts) for name, parts in seen.items()}
    return {name: (float(v.min()), float(v.max())) for name, v in both.items()}


def extended(
    current: Fit, kind: FunctionKind, low: float, high: float, more: tuple[FreeParameter, ...] = ()
) -> FreeParameters:
    """The free parameters with others of a kind and its nodes over a range behind them."""
    own = {PREFIX + "kind": kind.code, PREFIX + "low": low, PREFIX + "high": high}
    base = current.free.base.with_values(WITHOUT_SECOND | own)
    nodes = [FreeParameter(name, kind.scale, kind.low, kind.high, kind.unit) for name in NODE_NAMES]
    return FreeParameters(base, [*current.free.free, *more, *nodes])


def block_score_test(
    current: Fit, directions: np.ndarray, ridge: float, largest_shift: float
) -> tuple[float, np.ndarray, np.ndarray]:
    """Least squares of the residual on directions with all other parameters free to adjust.

    Parameters
    ----------
    directions : change of the residual per unit of each direction, shape (n, m). ridge : of the directions' mean power.

    Returns
    -------
    (relative fall of the cost, parts of the directions (m,), the other parameters (p,))
    """
    adjustment, r = Adjustment(current.jacobian), current.residuals
    r_free, d_free = adjustment.left(r), adjustment.left(directions)
    normal = d_free.T @ d_free
    normal += ridge * np.trace(normal) / len(normal) * np.eye(len(normal))
    parts = -np.linalg.solve(normal, d_free.T @ r_free)
    left = r_free + d_free @ parts
    shift = adjustment.change(r + directions @ parts)
    return 1.0 - float(left @ left) / float(r @ r), parts, current.x + np.clip(shift, -largest_shift, largest_shift)


def screen_function(
    problem: Problem, current: Fit, kind: FunctionKind, span: tuple[float, float], settings: SearchSettings
) -> ScreenedFunction:
    """Block score test of one kind: one simulation a node."""
    return screen_nodes(problem, current, kind, extended(current, kind, *span), settings)


def screen_nodes(
    problem: Problem, current: Fit, kind: FunctionKind, free: FreeParameters, settings: SearchSettings
) -> ScreenedFunction:
    """Block score test of the nodes that stand behind the parameters of a fit."""
    p = len(current.x)
    nodes = len(free.free) - p
    rows = np.zeros((nodes, p + nodes))
    rows[:, :p] = current.x
    rows[:, p:] = np.eye(nodes)
    moved = np.nan_to_num(problem.residuals(free.vectors(rows)), nan=1e3)
    directions = (moved - current.residuals).T
    ridge, shift = settings.function_ridge, settings.largest_shift
    gain, values, others = block_score_test(current, directions, ridge, shift)
    starts = []
    for part in settings.function_multiples:
        for x in (current.x, current.x + part * (others - current.x)):
            starts.append(np.concatenate([x, part * values]))
    return ScreenedFunction(kind, free, gain, tuple(starts))


def pulsation_periods(problem: RecordingProblem, current: Fit, settings: SearchSettings) -> list[float]:
    """Most likely periods of a pulsating supply [s], the strongest first.

    A slow change m(t) of the supply pressure makes the residual S(t) m(t) with S its sensitivity to the pressure; the
    spectrum of S(t) r(t) over the time since the recordings' start peaks at the frequency of m.
    """
    table = current.table
    row = current.vector.copy()
    column = list(current.free.base.fields).index(SUPPLY)
    row[column] = 1.01 * table.value(SUPPLY)
    sensitivity = problem.residuals(row[None, :])[0] - current.residuals
    rest = Adjustment(current.jacobian).left(current.residuals)
    step = min(r.sample_time for r in problem.records)
    place = np.round(problem.times() / step).astype(int)
    product = np.bincount(place, sensitivity * rest)
    count = 1 << (4 * len(product) - 1).bit_length()
    power = np.abs(np.fft.rfft(product, count)) ** 2
    frequency = np.fft.rfftfreq(count, step)
    width = max(round(1.5 * count / len(product)), 1)  # bins that one line covers
    power[(frequency < settings.slowest) | (frequency > settings.fastest_pulsation)] = 0.0
    found = []
    for _ in range(settings.most_refitted):
        i = int(np.argmax(power))
        if power[i] == 0.0:
            break
        found.append(float(1.0 / frequency[i]))
        power[max(i - width, 0) : i + width + 1] = 0.0
    return found


def pulsations(problem: RecordingProblem, current: Fit, settings: SearchSettings) -> Iterator[ScreenedFunction]:
    """The periodic supply at its most likely periods, whose fine value is free as well."""
    for period in pulsation_periods(problem, current, settings):
        tried = screen_function(problem, current, PULSATION, (0.0, period), settings)
        low, high = (1.0 - settings.period_freedom) * period, (1.0 + settings.period_freedom) * period
        fine = FreeParameter(PREFIX + "high", 0.01 * period, low, high, "s")
        p = len(current.x)
        free = extended(current, PULSATION, 0.0, period, (fine,))
        starts = tuple(np.insert(x, p, period / fine.scale) for x in tried.starts)
        yield ScreenedFunction(PULSATION, free, tried.gain, starts)


class WithNodePrior:
    """A problem with a weak prior on the nodes, which decides only what the recordings leave open.

    Each node and each second difference of neighbours counts as one more residual, in multiples of the node's scale.
    """

    def __init__(self, problem: RecordingProblem, free: FreeParameters, settings: SearchSettings) -> None:
        self._problem = problem
        index, scale = (
            {name: i for i, name in enumerate(free.base.fields)},
            dict(zip(free.names, free.scale, strict=True)),
        )
        self._rows = [
            (
                [index[name] for name in row],
                scale[row[0]],
                settings.node_deviation if row is NODE_NAMES else settings.change_deviation,
            )
            for row in ROWS
            if row[0] in scale
        ]

    @property
    def smooth(self) -> bool:
        """As the problem is."""
        return self._problem.smooth

    def predictor(self, injection: float) -> WithNodePrior:
        """The same with predictor runs."""
        problem = copy.copy(self)
        problem._problem = self._problem.predictor(injection)
        return problem

    def residuals(self, vectors: np.ndarray) -> np.ndarray:
        """Weighted residuals with those of the prior behind them, shape (m, n)."""
        parts = [self._problem.residuals(vectors)]
        for columns, scale, deviation in self._rows:
            nodes = vectors[:, columns] / scale
            parts += [nodes / deviation, np.diff(nodes, n=2, axis=1) / (0.5 * deviation)]
        return np.hstack(parts)


def fit_to_pieces(problem: SearchProblem, found: ScreenedFunction) -> Fit:
    """All parameters fitted with the nodes of a kind to pieces of the estimation data."""
    settings, free, pieces = problem.settings, found.free, problem.estimation_pieces
    rows = np.clip(np.array(found.starts), free.low, free.high)
    costs = np.sum(np.nan_to_num(pieces.residuals(free.vectors(rows)), nan=1e3) ** 2, axis=1)
    start, most = rows[int(np.argmin(costs))], settings.continued_evaluations
    first = WithNodePrior(pieces, free, settings)
    return approached(first, free, start, evaluations=most, tolerance=settings.function_tolerance)


def fit_function(problem: SearchProblem, found: ScreenedFunction, short: Fit) -> Fit:
    """The same fitted to all estimation data, from where the fit to pieces has led."""
    settings, free = problem.settings, found.free
    whole = WithNodePrior(problem.estimation, free, settings)
    most, tolerance = settings.continued_evaluations, settings.function_tolerance
    result = fit(whole, free, short.x, evaluations=most, tolerance=tolerance)
    return replace(linearised(problem.estimation, result), evaluations=result.evaluations)
