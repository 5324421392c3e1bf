"""What one window of motion says of the followed parameters: a quadratic log likelihood, in information form.

The found model runs corrected towards the sensors (fit/prediction.py). Under the gains of the parameters as they were
last estimated, its whitened innovations r and their Jacobian J give the log likelihood

    ℓ(x) = −½ |r + J (x − x̂)|² = −½ xᵀ H x + hᵀ x + const,   H = Jᵀ J,  h = H x̂ − Jᵀ r

and windows add up: of any stretch of time H and h are the sums. Each is linearised once, at what is known before it.

Held gains would break a symmetry: where mass, pressures, stiffness and friction grow together, every motion stays the
same, but corrections of the pressure and of the random force would act less, and the fit would take its scale of forces
from the noise. So these two gains grow with the moved mass.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from shake_ros.fit.likelihood import Levels
from shake_ros.fit.model import FreeModel
from shake_ros.fit.prediction import FilteredSegment, Predictor
from shake_ros.fit.records import Record
from shake_ros.fit.segment import Segment
from shake_ros.fit.solver import jacobian
from shake_ros.physics.plant.parameters import FULL_LAYOUT
from shake_ros.physics.plant.prediction import FORCE
from shake_ros.physics.plant.states import PRESSURE_A, VELOCITY

QUIET = 0.25  # part of what an accelerometer shows above the motion that is its own noise at least [-]
MASS = "effects.payload_error.mass"
FORCES = {  # power of the scale of all forces with which each number grows, where every motion stays the same
    "supply.supply_pressure": 1.0,
    "bulk_modulus.modulus": 1.0,
    "friction.coulomb_level": 1.0,
    "friction.stribeck_rise": 1.0,
    "friction.viscous": 1.0,
    "effects.specimen_resonance.mass": 1.0,
    "valve.flow_coefficient": -0.5,
    "leakage.internal": -1.0,
    "leakage.external": -1.0,
}
MOVED_MASS = [FULL_LAYOUT.index[n] for n in ("body.table_mass", "body.specimen_mass", MASS)]


class ScaledPredictor(Predictor):
    """A predictor whose held gains of pressure and force grow with the moved mass."""

    mass = 1.0

    def filtered(self, vector: np.ndarray) -> ScaledPredictor:
        """The same with the gains of a parameter vector, shape (WIDTH,)."""
        return self._of(super().filtered(vector), float(np.sum(vector[MOVED_MASS])))

    def part(self, seconds: float) -> ScaledPredictor:
        """Some of its segments, as of `Predictor`."""
        return self._of(super().part(seconds), self.mass)

    def _of(self, other: Predictor, mass: float) -> ScaledPredictor:
        made = ScaledPredictor(other.segments, other.levels)
        made.runs, made.mass = other.runs, mass
        return made

    def _run(self, vectors: np.ndarray, run: FilteredSegment, i: int) -> np.ndarray:
        force = np.isin(run.codes, (PRESSURE_A, FORCE))[:, None]
        grown = float(np.sum(vectors[i, MOVED_MASS])) / self.mass
        return super()._run(vectors, replace(run, gains=np.where(force, grown, 1.0) * run.gains), i)


@dataclass(frozen=True)
class WindowEvidence:
    """The evidence of one window."""

    record: Record  # its samples, with those before it in which the state is found
    information: np.ndarray  # H, shape (p, p)
    vector: np.ndarray  # h, shape (p,)
    square: float  # mean square of the whitened innovations at the window's own estimate [-]; 1 for a right model
    count: int  # number of these innovations
    # of each sample that counts, shape (n, 5): predicted position [m], velocity [m/s], acceleration [m/s²]; measured
    # position [m], acceleration [m/s²]
    motion: np.ndarray


def segment_of(record: Record) -> Segment:
    """The segment of a window; the noise of its accelerometer is a part of what the window shows, or more."""
    found = Segment.of(record)
    return replace(found, noise=(found.noise[0], QUIET * found.noise[1]))


def evidence(
    model: FreeModel, record: Record, levels: Levels, precision: np.ndarray, loudness: float = 0.0
) -> WindowEvidence:
    """The evidence of a window, by one linearisation at the last estimate.

    Parameters
    ----------
    model : followed parameters at their last estimate. levels : of noise.
    precision : inverse covariance of that estimate, which holds what the window leaves open, shape (p, p).
    loudness : of the motion at which the model's errors were measured; a calmer one shows them larger beside its own
        force, and counts less [m/s²].
    """
    segment, x = segment_of(record), model.x
    prediction = ScaledPredictor([segment], levels).filtered(model.vectors(x)[0])
    r, j = jacobian(prediction, model, x)
    j = scale_free(j, model, x)
    information, gradient = j.T @ j, j.T @ r
    left = r - j @ np.linalg.solve(information + precision, gradient)
    square = float(left @ left) / max(prediction.count, 1)
    weight = min(1.0, (segment.loudness / loudness) ** 2) if loudness else 1.0
    vector = information @ x - gradient
    return WindowEvidence(record, weight * information, weight * vector, square, prediction.count, _motion(prediction))


def scale_free(j: np.ndarray, model: FreeModel, x: np.ndarray) -> np.ndarray:
    """A Jacobian at x, shape (N, p), whose differences show nothing of the scale of all forces.

    No motion shows it. Where every number that it moves is free, the error of the differences is taken off the mass.
    """
    vector = model.vectors(x)[0]
    moved = {n for n in FORCES if vector[FULL_LAYOUT.index[n]] > 0.0}
    if not moved <= set(model.names) or MASS not in model.names:
        return j
    way, mass = x * [FORCES.get(n, 0.0) for n in model.names], model.names.index(MASS)
    way[mass] = float(np.sum(vector[MOVED_MASS])) / model.scale[mass]
    free = j.copy()
    free[:, mass] -= j @ way / way[mass]
    return free


def _motion(prediction: Predictor) -> np.ndarray:
    """Position and acceleration predicted from all before each sample, the corrected velocity, what was measured."""
    (run,) = prediction.runs
    s = run.segment
    velocity = run.path[:, int(np.flatnonzero(run.codes == VELOCITY)[0])]
    seen = s.measured()
    predicted = np.column_stack([seen[:, 0] - run.innovations[:, 0], velocity, seen[:, 1] - run.innovations[:, 1]])
    return np.hstack([predicted, seen])[s.start :]
