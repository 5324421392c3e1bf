"""What recordings identify, and which recording would help.

What they identify: singular values of the scaled Jacobian, pairs that go together, directions left open. Each column of
the weighted Jacobian is scaled to the parameter's size (its value, or the change that matters where that is larger); a
singular value s then says that the combination of its right singular vector is known to 1/s, as a part of the
parameters' sizes, from white residuals of variance one. The widening of that by residuals that are correlated or above
the noise is taken over from the standard errors. Source: L. Ljung, System Identification (1999), 4.6, 9.2.

What would help: what each of a small catalogue would add to what the recordings at hand tell. A candidate is simulated
with the fitted table, given the noise of the recordings at hand, and its Jacobian taken; the information JᵀJ of both
together gives the deviations that a fit to both would have. Source: G. Goodwin, R. Payne, Dynamic System
Identification: Experiment Design and Data Analysis (1977), chapter 6.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from shake_ros.fit.declared_model import FULL, DeclaredModel
from shake_ros.fit.free_parameters import FreeParameters
from shake_ros.fit.least_squares import Fit, jacobian
from shake_ros.fit.recording_problem import RecordingProblem
from shake_ros.fit.records import Record
from shake_ros.fit.uncertainty import at_bound, correlation, covariance
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.quantities import ShakeError, strict_keys, unknown_name

OPEN = 0.5  # deviation of a combination, as a part of the parameters' sizes, from which on it is not identified
TOGETHER = 0.95  # correlation from which on two parameters are told as a pair
SHARE = 0.3  # weight in a combination, of its largest one, from which on a parameter is named
NAMED = 4  # parameters of a combination that a report names at most


@dataclass(frozen=True)
class OpenCombination:
    """A combination of parameters. weights : by name, of parameters in parts of their sizes. deviation : of it [-]."""

    weights: dict[str, float]
    deviation: float

    @property
    def text(self) -> str:
        """The parameters that only act together.

        >>> OpenCombination({f"node {i}": 0.2 for i in range(17)}, 1.0).text
        'node 0 with node 1 with node 2 with node 3 with 13 more'
        """
        names = list(self.weights)
        more = [f"{len(names) - NAMED} more"] if len(names) > NAMED else []
        return " with ".join([*names[:NAMED], *more])


@dataclass(frozen=True)
class Identifiability:
    """How far recordings identify the parameters of a fit.

    Attributes
    ----------
    names : the parameters. sizes : what their deviations count in, in units of the fit's scales, shape (p,).
    correlation : of the estimates, shape (p, p), NaN at bounds. information : shape (p, p), per size and widened as
        the standard errors are. deviations : of each parameter by itself with the others free [sizes], shape (p,).
    left_open : combinations that are not identified, the worst first. pairs : (name, name, correlation).
    bound : parameters that rest on a bound. widening : of the variances, by which information counts less [-].
    """

    names: tuple[str, ...]
    sizes: np.ndarray
    correlation: np.ndarray
    information: np.ndarray
    deviations: np.ndarray
    left_open: tuple[OpenCombination, ...]
    pairs: tuple[tuple[str, str, float], ...]
    bound: tuple[str, ...]
    widening: float

    @property
    def weakest(self) -> int:
        """The parameter that is known least."""
        return int(np.argmax(self.deviations))

    @property
    def text(self) -> str:
        """One or two sentences for a report."""
        worst = self.names[self.weakest]
        if not self.left_open:
            said = (
                f"these recordings identify all {len(self.names)} parameters; "
                f"{worst} is the least certain, ± {100.0 * self.deviations[self.weakest]:.2g} %"
            )
        else:
            said = f"these recordings do not identify {'; '.join(c.text for c in self.left_open)}"
        if self.pairs:
            pairs = ", ".join(f"{a} with {b} ({value:+.2f})" for a, b, value in self.pairs)
            said += f"; strongly correlated: {pairs}"
        if self.bound:
            said += f"; at a bound: {', '.join(self.bound)}"
        return said


def widening(result: Fit, blocks: np.ndarray) -> float:
    """Ratio of the estimates' variances to those that white residuals of variance one would give."""
    inside = ~at_bound(result)
    if not np.any(inside):
        return 1.0
    j = result.jacobian[:, inside]
    plain = np.diag(np.linalg.pinv(j.T @ j, rcond=1e-12))
    wide = np.diag(covariance(result, blocks))[inside]
    good = (plain > 0.0) & np.isfinite(wide)
    return max(float(np.median(wide[good] / plain[good])), 1e-6) if np.any(good) else 1.0


def deviations_of(information: np.ndarray) -> np.ndarray:
    """Deviation of each parameter with the others free, shape (p,); large where the information is singular."""
    weights, vectors = np.linalg.eigh(information)
    floor = max(float(weights.max()), 1e-300) * 1e-14
    return np.asarray(np.sqrt((vectors**2) @ (1.0 / np.maximum(weights, floor))))


def identifiability(result: Fit, blocks: np.ndarray) -> Identifiability:
    """What the recordings behind a fit identify.

    Parameters
    ----------
    blocks : number of the block of time that each residual belongs to, shape (n,).
    """
    names, sizes = result.free.names, np.maximum(np.abs(result.x), 1.0)
    wide = widening(result, blocks)
    scaled = result.jacobian * sizes / np.sqrt(wide)
    _, singular, rows = np.linalg.svd(scaled, full_matrices=False)
    left_open = []
    for s, row in zip(singular[::-1], rows[::-1], strict=True):
        deviation = 1.0 / max(float(s), 1e-12)
        if deviation > OPEN:
            order = np.argsort(-np.abs(row))
            row = row * np.sign(row[order[0]])
            weights = {names[i]: float(row[i]) for i in order if abs(row[i]) > SHARE * row[order[0]]}
            left_open.append(OpenCombination(weights, deviation))
    related = correlation(result, blocks)
    pairs = [
        (names[i], names[k], float(related[i, k]))
        for i in range(len(names))
        for k in range(i)
        if abs(related[i, k]) > TOGETHER
    ]
    information = scaled.T @ scaled
    bound = tuple(n for n, resting in zip(names, at_bound(result), strict=True) if resting)
    return Identifiability(
        names, sizes, related, information, deviations_of(information), tuple(left_open), tuple(pairs), bound, wide
    )


STROKE, PAYLOAD = "body.stroke", "body.specimen_mass"
WITHIN = 0.8  # part of the stroke that a candidate may use
KINDS = ("standstill", "sine", "multisine", "sweep", "pulses")
UNKNOWN = 0.995  # deviation, in parts of the value, from which on a parameter counts as not known
KEYS = ("kind", "amplitude", "low", "high", "payload")


@dataclass(frozen=True)
class Candidate:
    """A recording that could be made.

    Attributes
    ----------
    kind : of KINDS. amplitude : of the drive, as a part of the largest that is at hand [-].
    low, high : frequencies [Hz]; a sine and pulses take `low`.
    payload : added to the specimen [kg]; only where the model declares a specimen.
    """

    name: str
    kind: str
    amplitude: float
    low: float = 0.0
    high: float = 0.0
    payload: float = 0.0


@dataclass(frozen=True)
class RecordingBenefit:
    """What a candidate would do. deviations : of each parameter, with it and the recordings at hand [parts of size]."""

    candidate: Candidate
    deviations: np.ndarray


def catalogue(content: Mapping[str, Any], where: str) -> tuple[Candidate, ...]:
    """Candidates from the content of config/experiment/catalogue.yaml."""
    found = []
    for name, entry in content.items():
        strict_keys(entry, KEYS, f"{where}: {name}", kind="key")
        if entry.get("kind") not in KINDS:
            raise unknown_name("kind", str(entry.get("kind")), KINDS, f"{where}: {name}")
        try:
            numbers = {key: float(value) for key, value in entry.items() if key != "kind"}
        except (TypeError, ValueError):
            raise ShakeError(f"{where}: {name}: expected numbers") from None
        found.append(Candidate(name, entry["kind"], **{"amplitude": 0.0, **numbers}))
    return tuple(found)


def drive(candidate: Candidate, samples: int, sample_time: float) -> np.ndarray:
    """The candidate's drive with a largest value of its amplitude, shape (samples,); it starts at full speed."""
    time = np.arange(samples) * sample_time
    low, high = candidate.low, candidate.high
    if candidate.kind == "standstill":
        return np.zeros(samples)
    if candidate.kind == "sine":
        wave = np.cos(2.0 * np.pi * low * time)
    elif candidate.kind == "sweep":
        phase = low * time + 0.5 * (high - low) * time**2 / max(time[-1], sample_time)
        wave = np.cos(2.0 * np.pi * phase)
    elif candidate.kind == "multisine":
        step = max(low, 1.0 / (samples * sample_time))
        lines = np.arange(low, high + 0.5 * step, step)
        number = np.arange(len(lines))
        phase = -np.pi * number * (number + 1) / len(lines)  # Schroeder's phases keep the peaks low
        wave = np.cos(2.0 * np.pi * np.outer(time, lines) + phase).sum(axis=1)
    else:
        turn = (low * time) % 1.0
        wave = np.where(turn < 0.25, 1.0, np.where((turn >= 0.5) & (turn < 0.75), -1.0, 0.0))
    return np.asarray(candidate.amplitude * wave / max(float(np.max(np.abs(wave))), 1e-12))


def largest_motion(table: TableParameters, records: Sequence[Record]) -> float:
    """How far from the middle a candidate may go [m]."""
    if STROKE in table.fields:
        return 0.5 * WITHIN * table.value(STROKE)
    return max(float(np.ptp(r.position)) for r in records) / 2.0


def simulated(
    candidate: Candidate, table: TableParameters, records: Sequence[Record], model: DeclaredModel, largest: float
) -> Record | None:
    """The recording that the candidate would give, with the noise of those at hand; None where it cannot be run."""
    like = max(records, key=lambda r: len(r.commands))
    n, dt = len(like.commands), like.sample_time
    command = largest * drive(candidate, n, dt)
    limit = largest_motion(table, records)
    rng = np.random.default_rng(0)
    for _ in range(4):
        out = model.run(table, Record(candidate.name, dt, command, np.zeros(n), moved=False))
        if not np.isfinite(out[:, :3]).all():
            return None
        moved = np.concatenate(([0.0], np.cumsum(out[:-1, 1]) * dt))
        moved = moved - moved.mean()
        reach = float(np.max(np.abs(moved)))
        if reach <= limit:
            break
        command = command * 0.9 * limit / reach
    position = moved + like.position_noise() * rng.standard_normal(n)
    acceleration = None
    if like.acceleration is not None:
        acceleration = out[:, 2] + like.acceleration_noise() * rng.standard_normal(n)
    return Record(candidate.name, dt, command, position, acceleration)


def benefits(
    result: Fit,
    known: Identifiability,
    records: Sequence[Record],
    candidates: Sequence[Candidate],
    model: DeclaredModel = FULL,
) -> list[RecordingBenefit]:
    """What each candidate would add to a fit, the most helpful first.

    The most helpful is the one with which the parameter that is known least is known best.
    """
    table = result.table
    largest = 1.0 if model is FULL else max(float(np.max(np.abs(r.commands))) for r in records)
    found = []
    for candidate in candidates:
        loaded = table
        if candidate.payload:
            if PAYLOAD not in table.fields:
                continue
            loaded = table.with_values({PAYLOAD: table.value(PAYLOAD) + candidate.payload})
        record = simulated(candidate, loaded, records, model, largest)
        if record is None or not np.ptp(record.position):
            continue
        problem = RecordingProblem([record], model)
        free = FreeParameters(loaded, result.free.free)
        x = np.clip(result.x, free.low, free.high)
        residuals = problem.residuals(free.vectors(x))[0]
        scaled = jacobian(problem, free, x, residuals) * known.sizes
        if not np.isfinite(scaled).all():
            continue
        widened = known.information + scaled.T @ scaled / known.widening
        found.append(RecordingBenefit(candidate, deviations_of(widened)))
    return sorted(found, key=lambda b: float(np.max(b.deviations)))


def stated(deviation: float) -> str:
    """A deviation, in parts of a parameter's value or usual size, for people."""
    return f"± {100.0 * deviation:.2g} %" if deviation < UNKNOWN else "not known"


def advice(known: Identifiability, found: Sequence[RecordingBenefit], asked: bool = True) -> str:
    """A sentence on the recording that would help most, with the parameter that is known least, or gains most."""
    if not asked:
        return "no time was left to find the most helpful further recording"
    if not found:
        return "no recording of the catalogue can be simulated with this table"
    best, k = found[0], known.weakest
    if best.deviations[k] >= UNKNOWN:
        k = int(np.argmin(best.deviations / known.deviations))
    before, after = (stated(d[k]) for d in (known.deviations, best.deviations))
    change = f"{known.names[k]} from {before} to {after}"
    return f"the most helpful further recording is {best.candidate.name}: {change}"
