"""What a fit leaves and what its recordings show: accounts of the residuals, identifiability, what would help."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from shake_ros.explain.account import Account, accounts, residuals_left
from shake_ros.explain.experiments import (
    Candidate,
    Identifiability,
    RecordingBenefit,
    advice,
    benefits,
    identifiability,
)
from shake_ros.explain.prediction import Innovations, innovations
from shake_ros.fit.declared_model import FULL, DeclaredModel
from shake_ros.fit.least_squares import Fit, jacobian
from shake_ros.fit.recording_problem import RecordingProblem
from shake_ros.fit.records import Record
from shake_ros.fit.start.backlash import BACKLASH, SHARE, share_of_dwells
from shake_ros.fit.uncertainty import of_table


@dataclass(frozen=True)
class Diagnosis:
    """Accounts of the residuals of all recordings, identifiability, and what each candidate recording would add.

    innovations : errors of predictor runs on validation data.
    asked : whether any recording was asked what it would add.
    dwells : part of the acceleration's changes of sign that dwells at zero; 0 where the model has backlash.
    """

    accounts: tuple[Account, ...]
    identifiability: Identifiability
    benefits: tuple[RecordingBenefit, ...]
    innovations: Innovations | None = None
    asked: bool = True
    dwells: float = 0.0

    @property
    def backlash(self) -> str:
        """A sentence on backlash that the acceleration shows and the model does not have; else empty."""
        if self.dwells <= SHARE:
            return ""
        return (
            f"the acceleration dwells at zero at {self.dwells:.0%} of its changes of sign in motion, as it does while "
            "the rod crosses a gap: look for backlash between piston rod and table, which this model does not have"
        )

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
    dwells = 0.0 if BACKLASH in result.table.effects else share_of_dwells(estimation)
    return Diagnosis(left, known, helpful, ahead, bool(candidates), dwells)
