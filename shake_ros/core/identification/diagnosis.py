"""What a fit leaves and what its recordings tell: tests of the residuals, noise, identifiability, what would help."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from shake_ros.core.identification.experiments import Candidate, RecordingBenefit, advice, benefits
from shake_ros.core.identification.fit import Fit, jacobian
from shake_ros.core.identification.identifiability import Identifiability, identifiability
from shake_ros.core.identification.innovations import Innovations, innovations
from shake_ros.core.identification.predictability import Predictability, predictability, residuals_left
from shake_ros.core.identification.recording_problem import RecordingProblem
from shake_ros.core.identification.recordings import FULL, DeclaredModel, Record
from shake_ros.core.identification.residual_tests import LAGS, ErrorSplit, ResidualTest, error_split, residual_test
from shake_ros.core.identification.uncertainty import of_table
from shake_ros.core.identification.velocity_filter import CUTOFF


@dataclass(frozen=True)
class Judgement:
    """Tests of one recording's residual.

    Attributes
    ----------
    channel : acceleration, or velocity where no acceleration was recorded. test : None where the recording is too
    short. split : of the residual's mean square. sample_time : of the tested residual [s]. noise : standard deviation
    taken for the channel's noise, noise_from : "periods" or "band".
    """

    name: str
    held_out: bool
    channel: str
    test: ResidualTest | None
    split: ErrorSplit
    sample_time: float
    noise: float
    noise_from: str


@dataclass(frozen=True)
class Diagnosis:
    """Judgements of all recordings, identifiability, and what each candidate recording would add.

    predictable : what of each residual is predictable at all. innovations : errors of predictor runs on held-out data.
    asked : whether any recording was asked what it would add.
    """

    judgements: tuple[Judgement, ...]
    identifiability: Identifiability
    benefits: tuple[RecordingBenefit, ...]
    predictable: tuple[Predictability, ...] = ()
    innovations: Innovations | None = None
    asked: bool = True

    @property
    def advice(self) -> str:
        """A sentence on the recording that would help most."""
        return advice(self.identifiability, self.benefits, self.asked)


def thinning(record: Record) -> int:
    """Samples of the filtered velocity from one independent one to the next."""
    return max(round(0.5 / (CUTOFF * record.sample_time)), 1)


def residual_of(problem: RecordingProblem, record: Record, vector: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Measured minus simulated, the drive at the same samples, and their distance [s].

    The acceleration's residual as it is; where there is none, that of the velocity at its independent samples.
    """
    velocity, acceleration = problem.simulate(vector[None, :], record)
    if record.acceleration is not None:
        span = slice(record.start, None)
        return record.acceleration_left(acceleration[0]), record.commands[span], record.sample_time
    step = thinning(record)
    span = slice(record.start, None, step)
    return (record.velocity - velocity[0])[span], record.commands[span], step * record.sample_time


def judge(problem: RecordingProblem, vector: np.ndarray, held_out: bool) -> list[Judgement]:
    """Test the residual of every recording: its longest piece for whiteness and independence, all for the split."""
    found = []
    for name in dict.fromkeys(r.name for r in problem.records):
        pieces = [r for r in problem.records if r.name == name]
        longest = max(pieces, key=lambda r: len(r.commands))
        alike = [r for r in pieces if (r.acceleration is None) == (longest.acceleration is None)]
        rests = [residual_of(problem, r, vector) for r in alike]
        e, u, dt = max(rests, key=lambda rest: len(rest[0]))
        channel = "velocity" if longest.acceleration is None else "acceleration"
        noise = longest.velocity_noise() if longest.acceleration is None else longest.acceleration_noise()
        usable = [rest for rest in rests if len(rest[0]) >= 16]
        split = error_split([r[0] for r in usable], [r[1] for r in usable], dt, noise)
        test = residual_test(e, u) if len(e) >= 8 * LAGS else None
        source = "periods" if channel in longest.noise_from_periods else "band"
        found.append(Judgement(name, held_out, channel, test, split, dt, noise, source))
    return found


def diagnose(
    result: Fit,
    estimation: Sequence[Record],
    validation: Sequence[Record],
    candidates: Sequence[Candidate],
    model: DeclaredModel = FULL,
    blocks: np.ndarray | None = None,
) -> Diagnosis:
    """Diagnose a fit.

    Parameters
    ----------
    estimation, validation : recordings that it was fitted to and others. candidates : recordings that could be made.
    blocks : of the fit's residuals, where they are not those of the free run over `estimation`.
    """
    vector = result.vector
    problem = RecordingProblem(list(estimation), model)
    judged, left, held, others = judge(problem, vector, False), residuals_left(problem, vector, False), [], problem
    if validation:
        others = RecordingProblem(list(validation), model)
        judged += judge(others, vector, True)
        held = residuals_left(others, vector, True)
    ahead = innovations(others, vector, result.table)
    blocks = problem.blocks() if blocks is None else blocks
    if len(blocks) != len(result.residuals):  # fitted to a part of the recordings
        residuals = problem.residuals(vector[None, :])[0]
        derivative = jacobian(problem, result.free, result.x, residuals)
        result = replace(result, residuals=residuals, jacobian=derivative)
    result = of_table(result)
    known = identifiability(result, blocks)
    helpful = tuple(benefits(result, known, estimation, candidates, model))
    return Diagnosis(tuple(judged), known, helpful, predictability(left, held), ahead, bool(candidates))
