"""What a fit leaves and what its recordings show: accounts of the residuals, identifiability, what would help."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from shake_ros.core.identification.experiments import Candidate, RecordingBenefit, advice, benefits
from shake_ros.core.identification.fit import Fit, jacobian
from shake_ros.core.identification.identifiability import Identifiability, identifiability
from shake_ros.core.identification.recording_problem import RecordingProblem
from shake_ros.core.identification.recordings import FULL, DeclaredModel, Record
from shake_ros.core.identification.uncertainty import of_table
from shake_ros.explain.account import Account, accounts, residuals_left
from shake_ros.explain.prediction import Innovations, innovations


@dataclass(frozen=True)
class Diagnosis:
    """Accounts of the residuals of all recordings, identifiability, and what each candidate recording would add.

    innovations : errors of predictor runs on validation data.
    asked : whether any recording was asked what it would add.
    """

    accounts: tuple[Account, ...]
    identifiability: Identifiability
    benefits: tuple[RecordingBenefit, ...]
    innovations: Innovations | None = None
    asked: bool = True

    @property
    def advice(self) -> str:
        """A sentence on the recording that would help most."""
        return advice(self.identifiability, self.benefits, self.asked)


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
    others = RecordingProblem(list(validation), model) if validation else problem
    held = residuals_left(others, vector, True) if validation else []
    left, ahead = accounts(residuals_left(problem, vector, False), held), innovations(others, vector)
    blocks = problem.blocks() if blocks is None else blocks
    if len(blocks) != len(result.residuals):  # fitted to a part of the recordings
        residuals = problem.residuals(vector[None, :])[0]
        derivative = jacobian(problem, result.free, result.x, residuals)
        result = replace(result, residuals=residuals, jacobian=derivative)
    result = of_table(result)
    known = identifiability(result, blocks)
    helpful = tuple(benefits(result, known, estimation, candidates, model))
    return Diagnosis(left, known, helpful, ahead, bool(candidates))
