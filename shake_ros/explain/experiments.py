"""Which recording would help: what each of a small catalogue would add to what the recordings at hand tell.

A candidate is simulated with the fitted table, given the noise of the recordings at hand, and its Jacobian taken; the
information JᵀJ of both together gives the deviations that a fit to both would have. Source: G. Goodwin, R. Payne,
Dynamic System Identification: Experiment Design and Data Analysis (1977), chapter 6.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from shake_ros.explain.identifiability import Identifiability, deviations_of
from shake_ros.fit.free_parameters import FreeParameters
from shake_ros.fit.least_squares import Fit, jacobian
from shake_ros.fit.recording_problem import RecordingProblem
from shake_ros.fit.records import FULL, DeclaredModel, Record
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.quantities import ShakeError, strict_keys, unknown_name

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
