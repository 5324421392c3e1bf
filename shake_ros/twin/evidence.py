"""What one window of motion says of the followed parameters: a quadratic log likelihood, in information form.

The found model runs corrected towards the sensors (fit/prediction.py). Under the gains of the parameters as they were
last estimated, its whitened innovations r and their Jacobian J give the log likelihood

    ℓ(x) = −½ |r + J (x − x̂)|² = −½ xᵀ H x + hᵀ x + const,   H = Jᵀ J,  h = H x̂ − Jᵀ r

and windows add up: of any stretch of time H and h are the sums. A window is linearised again where its estimate lies
far from where it was linearised.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shake_ros.core.identification.recordings import Record
from shake_ros.core.plant.states import VELOCITY
from shake_ros.fit.model import FreeModel
from shake_ros.fit.prediction import Levels, Predictor
from shake_ros.fit.segment import Segment
from shake_ros.fit.solver import jacobian

FAR, ROUNDS = 0.1, 3  # of a unit, from which a window is linearised again; so many times at most


@dataclass(frozen=True)
class WindowEvidence:
    """The evidence of one window.

    Attributes
    ----------
    record : its samples, with those before it in which the state is found.
    information : H, shape (p, p). vector : h, shape (p,).
    square : mean square of the whitened innovations at the window's own estimate [-]; 1 for a right model.
    count : number of these innovations.
    motion : of each sample that counts, shape (n, 5): predicted position [m], velocity [m/s], acceleration [m/s²];
        measured position [m], acceleration [m/s²].
    """

    record: Record
    information: np.ndarray
    vector: np.ndarray
    square: float
    count: int
    motion: np.ndarray


def evidence(
    model: FreeModel, record: Record, levels: Levels, precision: np.ndarray, loudness: float = 0.0
) -> WindowEvidence:
    """The evidence of a window.

    Parameters
    ----------
    model : followed parameters at their last estimate. levels : of noise.
    precision : inverse covariance of that estimate, which holds what the window leaves open, shape (p, p).
    loudness : of the motion at which the model's errors were measured; a calmer one shows them larger beside its own
        force, and counts less [m/s²].
    """
    segment = Segment.of(record)
    start = Predictor([segment], levels)
    x, motion = model.x, np.zeros((0, 5))
    for k in range(ROUNDS):
        prediction = start.filtered(model.vectors(x)[0])
        motion = _motion(prediction) if k == 0 else motion
        r, j = jacobian(prediction, model, x)
        information = j.T @ j
        step = -np.linalg.solve(information + precision, j.T @ r + precision @ (x - model.x))
        left = r + j @ step
        here, x = x, np.clip(x + step, *model.bounds)
        if np.max(np.abs(x - here)) < FAR:
            break
    square = float(left @ left) / max(prediction.count, 1)
    weight = min(1.0, (segment.loudness / loudness) ** 2) if loudness else 1.0
    vector = information @ here - j.T @ r
    return WindowEvidence(record, weight * information, weight * vector, square, prediction.count, motion)


def _motion(prediction: Predictor) -> np.ndarray:
    """Position and acceleration predicted from all before each sample, the corrected velocity, what was measured."""
    (run,) = prediction.runs
    s = run.segment
    velocity = run.path[:, int(np.flatnonzero(run.codes == VELOCITY)[0])]
    seen = s.measured()
    predicted = np.column_stack([seen[:, 0] - run.innovations[:, 0], velocity, seen[:, 1] - run.innovations[:, 1]])
    return np.hstack([predicted, seen])[s.start :]
