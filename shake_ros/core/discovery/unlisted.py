"""Something without a name: estimate the missing term as a function where no listed effect explains the residual.

For each kind of function of effects/unlisted.py the residual is projected on the directions in which its nodes can move
(a block score test, with everything else free to adjust); the kinds that promise most are refitted with all nodes free,
and the best on the recordings held out is offered to the search like any other candidate. The period of a pulsating
supply comes from the spectrum of the residual multiplied by its sensitivity to the supply pressure.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from shake_ros.core.discovery.candidates import Candidate
from shake_ros.core.effects import unlisted as law
from shake_ros.core.identification.fit import Fit, Problem, fit, jacobian
from shake_ros.core.identification.free_parameters import FreeParameter, FreeParameters
from shake_ros.core.identification.recordings import RecordingProblem

Progress = Callable[[str, float], None]
PREFIX = "effects.unlisted."
SUPPLY = "supply.supply_pressure"
NODE_NAMES = tuple(f"{PREFIX}node_{i:02d}" for i in range(law.NODES))
RIDGE = 0.02  # of the mean power of a node's direction: keeps nodes quiet that the recordings hardly visit
PARTS = (0.15, 0.4, 0.8, 1.2)  # of the linear estimate from which a refit may start
REFITTED = 3  # kinds that are refitted, at most
WORTH = 0.3  # part of the best predicted gain from which a kind is refitted
LEAST = 0.1  # predicted gain from which a kind is refitted
EVALUATIONS = 30
LOOSE, ROUGH = 20.0, 10.0  # prior deviation of a node and of its second difference, in units of the kind's scale
LOWEST, HIGHEST = 0.5, 25.0  # [Hz] of a pulsation
PERIODS = 3  # periods that are looked at


@dataclass(frozen=True)
class Kind:
    """One kind of function: of which quantity, where it acts, on what it depends, and a node value that matters."""

    code: int
    quantity: str
    place: str
    depends_on: tuple[str, ...]
    scale: float
    low: float
    high: float


OF_MOTION = (
    Kind(law.FORCE_OF_POSITION, "position", "force", ("position",), 100.0, -1e5, 1e5),
    Kind(law.FRICTION_OF_POSITION, "position", "friction", ("position", "direction"), 100.0, -1e4, 1e4),
    Kind(law.FORCE_OF_VELOCITY, "velocity", "friction", ("velocity",), 100.0, -1e5, 1e5),
)
OF_HYDRAULICS = (
    Kind(law.FLOW_GAIN_OF_OPENING, "valve_opening", "valve", ("valve_opening",), 0.05, -0.95, 2.0),
    Kind(law.LEAKAGE_OF_LOAD_PRESSURE, "load_pressure", "flow", ("load_pressure",), 2e-6, -1e-3, 1e-3),
    Kind(law.STIFFNESS_OF_LOAD_PRESSURE, "load_pressure", "compressibility", ("load_pressure",), 0.1, -0.95, 10.0),
    Kind(law.FLOW_GAIN_OF_TIME, "time", "valve", ("time",), 0.05, -0.95, 2.0),
)
PULSATION = Kind(law.SUPPLY_OF_PHASE, "phase", "supply", ("time",), 0.05, -0.9, 2.0)


@dataclass(frozen=True)
class Estimate:
    """A kind at a place to start from: its free parameters, predicted relative fall of the cost, starts for a refit."""

    kind: Kind
    free: FreeParameters
    gain: float
    starts: tuple[np.ndarray, ...]


class WithPrior:
    """A problem with a weak prior on the nodes, which decides only what the recordings leave open.

    Each node and each second difference of neighbours counts as one more residual.
    """

    def __init__(self, problem: Problem, free: FreeParameters, kind: Kind) -> None:
        self._problem, self._scale = problem, kind.scale
        names = list(free.base.fields)
        self._columns = [names.index(name) for name in NODE_NAMES]

    def residuals(self, vectors: np.ndarray) -> np.ndarray:
        """Weighted residuals with those of the prior behind them, shape (m, n)."""
        nodes = vectors[:, self._columns] / self._scale
        rough = np.diff(nodes, n=2, axis=1)
        return np.hstack([self._problem.residuals(vectors), nodes / LOOSE, rough / ROUGH])


def ranges(problem: RecordingProblem, current: Fit) -> Mapping[str, tuple[float, float]]:
    """Range of each quantity that the recordings visit."""
    table = current.free.table(current.x)
    seen: dict[str, list[np.ndarray]] = {}
    for record in problem.records:
        out = problem.model.run(table, record)
        for name, values in problem.model.quantities(record, out).items():
            seen.setdefault(name, []).append(values[record.start :])
    both = {name: np.concatenate(parts) for name, parts in seen.items()}
    return {name: (float(v.min()), float(v.max())) for name, v in both.items()}


def extended(current: Fit, kind: Kind, low: float, high: float, more: tuple[FreeParameter, ...] = ()) -> FreeParameters:
    """The free parameters with others of a kind and its nodes over a range behind them."""
    base = current.free.base.with_values({PREFIX + "kind": kind.code, PREFIX + "low": low, PREFIX + "high": high})
    nodes = [FreeParameter(name, kind.scale, kind.low, kind.high, "kind") for name in NODE_NAMES]
    return FreeParameters(base, [*current.free.free, *more, *nodes])


def block_score(current: Fit, directions: np.ndarray, ridge: float = RIDGE) -> tuple[float, np.ndarray, np.ndarray]:
    """Least squares of the residual on directions with all other parameters free to adjust.

    Parameters
    ----------
    directions : change of the residual per unit of each direction, shape (n, m).

    Returns
    -------
    (relative fall of the cost, parts of the directions (m,), the other parameters (p,))
    """
    q, triangle = np.linalg.qr(current.jacobian)
    r = current.residuals
    r_free, d_free = r - q @ (q.T @ r), directions - q @ (q.T @ directions)
    normal = d_free.T @ d_free
    normal += ridge * np.trace(normal) / len(normal) * np.eye(len(normal))
    parts = -np.linalg.solve(normal, d_free.T @ r_free)
    left = r_free + d_free @ parts
    shift = np.linalg.lstsq(triangle, -q.T @ (r + directions @ parts), rcond=1e-10)[0]
    return 1.0 - float(left @ left) / float(r @ r), parts, current.x + np.clip(shift, -5.0, 5.0)


def estimate(problem: RecordingProblem, current: Fit, kind: Kind, low: float, high: float) -> Estimate:
    """Block score test of one kind: one simulation a node."""
    free = extended(current, kind, low, high)
    p = len(current.x)
    rows = np.zeros((law.NODES, p + law.NODES))
    rows[:, :p] = current.x
    rows[:, p:] = np.eye(law.NODES)
    moved = np.nan_to_num(problem.residuals(free.vectors(rows)), nan=1e3)
    gain, nodes, others = block_score(current, (moved - current.residuals).T)
    starts = []
    for part in PARTS:
        for x in (current.x, current.x + part * (others - current.x)):
            starts.append(np.concatenate([x, part * nodes]))
    return Estimate(kind, free, gain, tuple(starts))


def pulsation_periods(problem: RecordingProblem, current: Fit) -> list[float]:
    """Most likely periods of a pulsating supply [s], the strongest first.

    A slow change m(t) of the supply pressure makes the residual S(t) m(t) with S its sensitivity to the pressure; the
    spectrum of S(t) r(t) over the time since the recordings' start peaks at the frequency of m.
    """
    table = current.free.table(current.x)
    row = current.free.vectors(current.x)[0].copy()
    column = list(current.free.base.fields).index(SUPPLY)
    row[column] = 1.01 * table.value(SUPPLY)
    sensitivity = problem.residuals(row[None, :])[0] - current.residuals
    q, _ = np.linalg.qr(current.jacobian)
    rest = current.residuals - q @ (q.T @ current.residuals)
    step = min(r.sample_time for r in problem.records)
    place = np.round(problem.times() / step).astype(int)
    product = np.bincount(place, sensitivity * rest)
    count = 1 << (4 * len(product) - 1).bit_length()
    power = np.abs(np.fft.rfft(product, count)) ** 2
    frequency = np.fft.rfftfreq(count, step)
    width = max(round(1.5 * count / len(product)), 1)  # bins that one line covers
    power[(frequency < LOWEST) | (frequency > HIGHEST)] = 0.0
    found = []
    for _ in range(PERIODS):
        i = int(np.argmax(power))
        if power[i] == 0.0:
            break
        found.append(float(1.0 / frequency[i]))
        power[max(i - width, 0) : i + width + 1] = 0.0
    return found


def pulsations(problem: RecordingProblem, current: Fit) -> Iterator[Estimate]:
    """The periodic supply at its most likely periods, whose fine value is free as well."""
    for period in pulsation_periods(problem, current):
        tried = estimate(problem, current, PULSATION, 0.0, period)
        fine = FreeParameter(PREFIX + "high", 0.01 * period, 0.9 * period, 1.1 * period, "argument")
        p = len(current.x)
        free = extended(current, PULSATION, 0.0, period, (fine,))
        starts = tuple(np.insert(x, p, period / fine.scale) for x in tried.starts)
        yield Estimate(PULSATION, free, tried.gain, starts)


def refit(problem: RecordingProblem, explore: RecordingProblem, found: Estimate) -> Fit:
    """Refit all parameters with the nodes of a kind, first on pieces of the recordings."""
    rows = np.clip(np.array(found.starts), found.free.low, found.free.high)
    costs = np.sum(np.nan_to_num(explore.residuals(found.free.vectors(rows)), nan=1e3) ** 2, axis=1)
    start, first = rows[int(np.argmin(costs))], WithPrior(explore, found.free, found.kind)
    result = fit(first, found.free, start, evaluations=EVALUATIONS, tolerance=1e-3)
    whole = WithPrior(problem, found.free, found.kind)
    result = fit(whole, found.free, result.x, evaluations=EVALUATIONS, tolerance=1e-4)
    r = problem.residuals(found.free.vectors(result.x))[0]
    j = jacobian(problem, found.free, result.x, r)
    return Fit(found.free, result.x, r, j, 0.5 * float(r @ r), result.evaluations)


def candidate(kind: Kind, free: FreeParameters, current: Fit) -> Candidate:
    """The kind as a candidate of the search, under the name `unlisted`."""
    known = set(current.free.names)
    own = tuple(f for f in free.free if f.name not in known)
    return Candidate("unlisted", own, (), kind.place, kind.depends_on)


def all_estimates(problem: RecordingProblem, first_look: Fit, progress: Progress) -> list[Estimate]:
    """Estimates of all kinds on a first look, the most promising first, one of each kind."""
    progress("something without a name", 0.0)
    span = ranges(problem, first_look)
    hydraulic = SUPPLY in first_look.free.base.fields
    kinds = [k for k in (*OF_MOTION, *(OF_HYDRAULICS if hydraulic else ())) if k.quantity in span]
    kinds = [k for k in kinds if span[k.quantity][1] > span[k.quantity][0]]
    found = [estimate(problem, first_look, k, *span[k.quantity]) for k in kinds]
    progress("something without a name: pulsation", 0.2)
    found += pulsations(problem, first_look) if hydraulic else ()
    best: dict[int, Estimate] = {}
    for e in sorted(found, key=lambda e: -e.gain):
        best.setdefault(e.kind.code, e)
    return list(best.values())


@dataclass(frozen=True)
class Unnamed:
    """What was looked at without a name: predicted gain by (place, quantity), and the best function, refitted."""

    gains: Mapping[tuple[str, str], float]
    best: tuple[Candidate, Fit, float] | None


def best_unlisted(
    problem: RecordingProblem,
    explore: RecordingProblem,
    current: Fit,
    first_look: Fit,
    cost: Callable[[Fit], float],
    progress: Progress,
) -> Unnamed:
    """The kind of function that explains most of the residual, refitted, with its predicted gain.

    Parameters
    ----------
    current : fit on the whole recordings. first_look : the same on `explore`. cost : held-out cost of a fit.
    """
    if PREFIX + "kind" not in current.free.base.fields:
        return Unnamed({}, None)
    found = all_estimates(explore, first_look, progress)
    worth = [e for e in found[:REFITTED] if e.gain > max(WORTH * found[0].gain, LEAST)]
    results = []
    for i, e in enumerate(worth):
        progress(f"unlisted: {e.kind.place} of {e.kind.quantity}", 0.4 + 0.6 * i / len(worth))
        result = refit(problem, explore, e)
        results.append((candidate(e.kind, e.free, current), result, e.gain))
    best = min(results, key=lambda r: cost(r[1])) if results else None
    return Unnamed({(e.kind.place, e.kind.quantity): e.gain for e in found}, best)
