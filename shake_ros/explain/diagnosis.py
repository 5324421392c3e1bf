"""What a fit leaves and what its recordings show: accounts of the residuals, identifiability, what would help.

Backlash between piston rod and table shows in the acceleration without a model: nothing pushes the table while the rod
crosses the gap, so the acceleration dwells at zero each time that the force changes sign in motion. Without backlash
it passes through zero about as fast as it has approached: the time within a band about zero is that from three times
the band to it. A table at rest may stick and is left out. A steady force moves the dwells away from zero and hides
them, as does noise of their size.
"""

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

BACKLASH = "coupling_backlash"
NOISE, SIZE = 4.0, 0.01  # half width of the band: standard deviations of the noise, or parts of the acceleration's
AT_REST = 0.1  # of the velocity's standard deviation, below which a table may stick
LONG = 3.0  # times what the way to the band has taken, from which it is a dwell
FEWEST = 10  # changes of sign that count
SHARE = 0.25  # of these that dwell, from which backlash is reported; without it at most 0.1 do


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


def share_of_dwells(records: Sequence[Record]) -> float:
    """Part of the acceleration's changes of sign in motion that dwells at zero [-]; 0 of too few of them."""
    ratios = np.concatenate([np.zeros(0), *(dwells(r) for r in records if r.acceleration is not None)])
    return float(np.mean(ratios > LONG)) if len(ratios) >= FEWEST else 0.0


def dwells(record: Record) -> np.ndarray:
    """Time within the band over that of the way to it, of each change of the acceleration's sign in motion, shape (m,).

    >>> from types import SimpleNamespace
    >>> time = np.arange(3000) * 1e-3
    >>> a, v = np.sin(9.0 * time), 1.0 + 0.5 * np.sin(time)
    >>> def of(a):
    ...     return SimpleNamespace(start=0, acceleration=a, velocity=v, acceleration_noise=lambda: 0.01)
    >>> bool(np.median(dwells(of(a))) < 1.5), bool(np.median(dwells(of(np.where(abs(a) < 0.3, 0.0, a)))) > 3.0)
    (True, True)
    """
    assert record.acceleration is not None
    a, v = record.acceleration[record.start :], record.velocity[record.start :]
    band = max(NOISE * record.acceleration_noise(), SIZE * float(np.std(a)))
    places = np.arange(len(a))
    beyond = np.maximum.accumulate(np.where(np.abs(a) > 3.0 * band, places, -1))
    resting = np.concatenate([[0], np.cumsum(np.abs(v) < AT_REST * np.std(v))])
    outside = np.flatnonzero(np.abs(a) > band)
    changes = np.flatnonzero(np.diff(np.sign(a[outside])))
    last, first = outside[changes], outside[changes + 1]
    began = np.concatenate([[0], first[:-1]])  # when it came to this side
    counts = (beyond[last] >= began[: len(last)]) & (resting[first + 1] == resting[last])
    return np.asarray(((first - last) / np.maximum(last - beyond[last], 1))[counts])
