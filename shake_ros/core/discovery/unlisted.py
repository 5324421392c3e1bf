"""Something without a name: estimate the missing term as a function where no listed effect explains the residual.

For each kind of function of effects/unlisted.py the residual is projected on the sixteen directions in which a node can
move (a block score test, with everything else free to adjust); the kinds that promise most are refitted with all nodes
free, and the best on the recordings held out is offered to the search like any other candidate.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from shake_ros.core.discovery.candidates import Candidate
from shake_ros.core.effects import unlisted as law
from shake_ros.core.identification.fit import Fit, fit
from shake_ros.core.identification.free_parameters import FreeParameter, FreeParameters
from shake_ros.core.identification.recordings import RecordingProblem

Progress = Callable[[str, float], None]
PREFIX = "effects.unlisted."
NODE_NAMES = tuple(f"{PREFIX}node_{i:02d}" for i in range(law.NODES))
RIDGE = 0.02  # of the mean power of a node's direction: keeps nodes quiet that the recordings hardly visit
PARTS = (0.15, 0.4, 0.8, 1.2)  # of the linear estimate from which a refit may start
REFITTED = 2  # kinds that are refitted
EVALUATIONS = 30


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


KINDS = (
    Kind(law.FORCE_OF_POSITION, "position", "force", ("position",), 100.0, -1e5, 1e5),
    Kind(law.FRICTION_OF_POSITION, "position", "friction", ("position", "direction"), 100.0, -1e4, 1e4),
    Kind(law.FORCE_OF_VELOCITY, "velocity", "friction", ("velocity",), 100.0, -1e5, 1e5),
    Kind(law.FLOW_GAIN_OF_OPENING, "valve_opening", "valve", ("valve_opening",), 0.05, -0.95, 2.0),
    Kind(law.LEAKAGE_OF_LOAD_PRESSURE, "load_pressure", "flow", ("load_pressure",), 2e-6, -1e-3, 1e-3),
    Kind(law.STIFFNESS_OF_LOAD_PRESSURE, "load_pressure", "compressibility", ("load_pressure",), 0.1, -0.95, 10.0),
)


@dataclass(frozen=True)
class Estimate:
    """A kind with its block score test: predicted relative fall of the cost, nodes and other parameters."""

    kind: Kind
    free: FreeParameters
    gain: float
    nodes: np.ndarray
    others: np.ndarray


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


def extended(current: Fit, kind: Kind, low: float, high: float) -> FreeParameters:
    """The free parameters with the nodes of a kind over a range."""
    base = current.free.base.with_values({PREFIX + "kind": kind.code, PREFIX + "low": low, PREFIX + "high": high})
    nodes = [FreeParameter(name, kind.scale, kind.low, kind.high, "kind") for name in NODE_NAMES]
    return FreeParameters(base, [*current.free.free, *nodes])


def estimate(problem: RecordingProblem, current: Fit, kind: Kind, low: float, high: float) -> Estimate:
    """Block score test of one kind: one simulation a node."""
    free = extended(current, kind, low, high)
    p = len(current.x)
    rows = np.zeros((law.NODES, p + law.NODES))
    rows[:, :p] = current.x
    rows[:, p:] = np.eye(law.NODES)
    moved = np.nan_to_num(problem.residuals(free.vectors(rows)), nan=1e3)
    q, triangle = np.linalg.qr(current.jacobian)
    r = current.residuals
    d = (moved - r).T
    r_free, d_free = r - q @ (q.T @ r), d - q @ (q.T @ d)
    normal = d_free.T @ d_free
    normal += RIDGE * np.trace(normal) / law.NODES * np.eye(law.NODES)
    nodes = -np.linalg.solve(normal, d_free.T @ r_free)
    left = r_free + d_free @ nodes
    shift = np.linalg.lstsq(triangle, -q.T @ (r + d @ nodes), rcond=1e-10)[0]
    gain = 1.0 - float(left @ left) / float(r @ r)
    return Estimate(kind, free, gain, nodes, current.x + np.clip(shift, -5.0, 5.0))


def refit(problem: RecordingProblem, explore: RecordingProblem, current: Fit, found: Estimate) -> Fit:
    """Refit all parameters with the nodes of a kind, first on pieces of the recordings."""
    starts = []
    for part in PARTS:
        for others in (current.x, current.x + part * (found.others - current.x)):
            starts.append(np.concatenate([others, part * found.nodes]))
    rows = np.clip(np.array(starts), found.free.low, found.free.high)
    costs = np.sum(np.nan_to_num(explore.residuals(found.free.vectors(rows)), nan=1e3) ** 2, axis=1)
    first = fit(explore, found.free, rows[int(np.argmin(costs))], evaluations=EVALUATIONS, tolerance=1e-3)
    return fit(problem, found.free, first.x, evaluations=EVALUATIONS, tolerance=1e-4)


def candidate(kind: Kind, free: FreeParameters) -> Candidate:
    """The kind as a candidate of the search, under the name `unlisted`."""
    return Candidate("unlisted", free.free[-law.NODES :], (), kind.place, kind.depends_on)


def best_unlisted(
    problem: RecordingProblem,
    explore: RecordingProblem,
    current: Fit,
    first_look: Fit,
    cost: Callable[[Fit], float],
    progress: Progress,
) -> tuple[Candidate, Fit, float] | None:
    """The kind of function that explains most of the residual, refitted, with its predicted gain.

    Parameters
    ----------
    current : fit on the whole recordings. first_look : the same on `explore`. cost : held-out cost of a fit.
    """
    if PREFIX + "kind" not in current.free.base.fields:
        return None
    progress("something without a name", 0.0)
    span = ranges(problem, current)
    kinds = [k for k in KINDS if k.quantity in span and span[k.quantity][1] > span[k.quantity][0]]
    found = sorted((estimate(explore, first_look, k, *span[k.quantity]) for k in kinds), key=lambda e: -e.gain)
    results = []
    for i, e in enumerate(found[:REFITTED]):
        progress(f"unlisted: {e.kind.place} of {e.kind.quantity}", (i + 1) / (REFITTED + 1))
        result = refit(problem, explore, current, e)
        results.append((candidate(e.kind, e.free), result, e.gain))
    return min(results, key=lambda r: cost(r[1])) if results else None
