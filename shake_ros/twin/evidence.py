"""What windows of motion say of the followed parameters: quadratic log likelihoods, in information form.

The found model runs corrected towards the sensors (fit/prediction.py). Under the gains of the parameters as they were
last estimated, its whitened innovations r and their Jacobian J give the log likelihood

    ℓ(x) = −½ |r + J (x − x̂)|² = −½ xᵀ H x + hᵀ x + const,   H = Jᵀ J,  h = H x̂ − Jᵀ r

and windows add up: of any stretch of time H and h are the sums. Each is linearised once, at what is known before it.

The numbers of a table's file are a prior for the first windows, the reference. All of them that it shows are fitted
together by linearisations of every window at one common estimate, with the levels of noise and the filter behind the
accelerometer renewed on the way; it also shows how much windows scatter.

Held gains would break a symmetry: where mass, pressures, stiffness and friction grow together, every motion stays the
same, but corrections of the pressure and of the random force would act less, and the fit would take its scale of forces
from the noise. So these two gains grow with the moved mass.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize

from shake_ros.fit.likelihood import Levels
from shake_ros.fit.model import SENSOR_FILTER, TABLE, FreeModel
from shake_ros.fit.nuisances.sensor_filter import CUTOFFS
from shake_ros.fit.prediction import LIMITS, FilteredSegment, Predictor
from shake_ros.fit.records import Record
from shake_ros.fit.segment import Segment
from shake_ros.fit.solver import jacobian
from shake_ros.physics.plant.parameters import FULL_LAYOUT
from shake_ros.physics.plant.prediction import FORCE
from shake_ros.physics.plant.sensors import FILTER_DELAY
from shake_ros.physics.plant.states import PRESSURE_A, VELOCITY
from shake_ros.signals.stretches import stretches

MOVING = 20.0  # position noise and …
FELT = 4.0  # … acceleration noise, of which motion has so many times as much
FROZEN = 0.2  # for which a sensor stands still to the last digit while the table moves [s]
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

    def _run(self, vector: np.ndarray, run: FilteredSegment, following: bool) -> np.ndarray:
        force = np.isin(run.codes, (PRESSURE_A, FORCE))[:, None]
        grown = float(np.sum(vector[MOVED_MASS])) / self.mass
        return super()._run(vector, replace(run, gains=np.where(force, grown, 1.0) * run.gains), following)


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


def moves(record: Record) -> bool:
    """Whether a window has motion from which something can be estimated."""
    assert record.acceleration is not None
    far = float(np.std(record.position)) > MOVING * record.position_noise()
    return far and float(np.std(record.acceleration)) > FELT * record.acceleration_noise()


def trouble(record: Record) -> str:
    """Why a window cannot be used: a sensor or the command stands still while the table moves; else empty."""
    assert record.acceleration is not None
    least, dt = round(FROZEN / record.sample_time), record.sample_time
    felt, moved = record.acceleration, record.position
    noise = max(record.acceleration_noise(), 1e-9), max(record.position_noise(), 1e-12)
    for span in stretches(np.diff(moved) == 0.0):
        if span.stop - span.start >= least and np.std(felt[span]) > FELT * noise[0]:
            return f"the position stands still for {(span.stop - span.start) * dt:.2f} s while the accelerometer moves"
    for span in stretches(np.diff(felt) == 0.0):
        if span.stop - span.start >= least and np.std(moved[span]) > MOVING * noise[1]:
            return f"the acceleration stands still for {(span.stop - span.start) * dt:.2f} s while the table moves"
    if np.ptp(record.commands) == 0.0 and moves(record):
        return "the valve command stands still while the table moves: is it under manual control?"
    return ""


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


@dataclass(frozen=True)
class KnownState:
    """What was known of the parameters at the end of a window: mean, shape (p,), and covariance, (p, p), in units."""

    mean: np.ndarray
    covariance: np.ndarray


def pooled(first: KnownState, windows: list[WindowEvidence], inflation: float) -> KnownState:
    """What is known after windows, from what was known before them."""
    precision = np.linalg.inv(first.covariance)
    information = precision + sum(w.information for w in windows) / inflation
    vector = precision @ first.mean + sum(w.vector for w in windows) / inflation
    covariance = np.linalg.inv(information)
    return KnownState(covariance @ vector, covariance)


def conditional(covariance: np.ndarray, count: int) -> np.ndarray:
    """Covariance of the first parameters where the others are known, shape (count, count)."""
    found: np.ndarray = np.linalg.inv(np.linalg.inv(covariance)[:count, :count])
    return found


FEW = 3  # windows, from the loudest to the calmest, that show the levels of noise and where the parameters about lie
BEGUN = (0.05, 0.005)  # random force beside which they are led there: room for errors, or for commands that carry noise
LEVELS = ("force", "acceleration", "memory", "position")
MOVED = math.log(2.0)  # by which the search for levels begins to move their logarithms, and …
ENDED = {"fatol": 1.0, "xatol": 0.1}  # … within which it ends: of the log likelihood, and of theirs
HELD = {"null_drift": 1e-6, "bias": 1e-6, "bias_drift": 1e-7}  # offsets, which are followed instead
STEPS, CONVERGED = 4, 1.0  # linearisations of the few and of all at most; foreseen gain at which they end [nats]


def fitted_to(
    records: Sequence[Record], model: FreeModel, file: np.ndarray, loudness: float
) -> tuple[FreeModel, Levels, list[WindowEvidence]]:
    """A model fitted to the windows of a reference, with the levels of noise and the evidence of each window.

    The levels are sought where a few windows have led the model: beside a random force that leaves room for its errors,
    and beside a small one, since a controller may feed the accelerometer's noise back into the commands, and a
    predictor that takes this noise for a force is then biased. The likelier of both is kept.

    Parameters
    ----------
    file : covariance of the parameters before, shape (p, p). loudness : as in `evidence`.
    """
    order = sorted(records, key=lambda r: Segment.of(r).loudness)
    few = [order[i] for i in np.linspace(0, len(order) - 1, min(FEW, len(order))).astype(int)]
    segments = [segment_of(r) for r in few]
    first, precision = KnownState(model.x, file), np.linalg.inv(file)

    def led(model: FreeModel, windows: Sequence[Record], levels: Levels) -> tuple[FreeModel, list[WindowEvidence]]:
        found, model = list[WindowEvidence](), with_filter(segments[len(segments) // 2], model, levels)
        for _ in range(STEPS):
            found = [evidence(model, r, levels, precision, loudness) for r in windows]
            known = pooled(first, found, 1.0)
            moved = np.clip(known.mean, *model.bounds) - model.x
            model = model.at(known.mean)
            if 0.5 * float(moved @ np.linalg.solve(known.covariance, moved)) < CONVERGED:
                break
        return model, found

    tuned = list[tuple[float, FreeModel, Levels]]()
    for force in BEGUN:
        begin = Levels(force=force, memory=0.01, acceleration=0.5 / QUIET, **HELD)
        moved, _ = led(model, few, begin)
        levels = noise_levels(segments, moved, begin)
        tuned.append((likelihood_of(segments, moved, levels), moved, levels))
    _, model, levels = max(tuned, key=lambda t: t[0])
    model, found = led(model, records, levels)
    return model, levels, found


def likelihood_of(segments: Sequence[Segment], model: FreeModel, levels: Levels) -> float:
    """Log likelihood of a model over segments [nats]."""
    return float(np.sum(Predictor(segments, levels).filtered(model.vectors(model.x)[0]).log_likelihood()))


def noise_levels(few: Sequence[Segment], model: FreeModel, begin: Levels) -> Levels:
    """The levels of noise of a model; its random force is the same in all motions, or in proportion to them."""
    middle, usual = few[len(few) // 2], float(np.median([s.loudness for s in few]))
    found = _likeliest(middle, model, begin)
    same = replace(found, force=LIMITS["force"][0], least_force=found.force * middle.loudness)
    own, steady = (likelihood_of(few, model, levels) for levels in (found, same))
    return same if steady > own else replace(found, least_force=found.force * usual)


def _likeliest(segment: Segment, model: FreeModel, begin: Levels) -> Levels:
    """Levels of the largest likelihood of a segment (simplex search: Nelder and Mead 1965).

    A longer memory, a larger force and a better sensor explain nearly the same, and the filter's path moves with them.
    """

    def at(logs: np.ndarray) -> Levels:
        return replace(begin, **dict(zip(LEVELS, np.exp(logs).tolist(), strict=True)))

    def unlikely(logs: np.ndarray) -> float:
        return -likelihood_of([segment], model, at(logs))

    box = np.log([LIMITS[name] for name in LEVELS])
    first = np.clip(np.log([getattr(begin, name) for name in LEVELS]), *box.T)
    inward = np.where(first + MOVED > box[:, 1], -MOVED, MOVED)
    simplex = np.vstack([first, first + np.diag(inward)])
    found = minimize(unlikely, first, method="Nelder-Mead", bounds=box, options={"initial_simplex": simplex, **ENDED})
    return at(found.x)


def with_filter(segment: Segment, model: FreeModel, levels: Levels) -> FreeModel:
    """The model with the filter of the accelerometer, or none, under which a segment is likeliest."""
    if SENSOR_FILTER.name not in model.names:
        return model
    i, dt = model.names.index(SENSOR_FILTER.name), segment.dt
    tried = [0.0, *(FILTER_DELAY * dt / c for c in CUTOFFS), *([model.value(SENSOR_FILTER.name)] if model.x[i] else [])]
    models = [model.at(np.where(np.arange(len(model.x)) == i, lag / model.scale[i], model.x)) for lag in tried]
    return max(models, key=lambda m: likelihood_of([segment], m, levels))


def held(model: FreeModel, p: int) -> FreeModel:
    """A model of whose free parameters the first p remain so, and the others keep their values."""
    sensor = model.vectors(model.x)[0, TABLE:]
    return replace(model, table=model.found_table(), free=model.free[:p], x=model.x[:p], sensor=tuple(sensor.tolist()))


def scatter(windows: Sequence[WindowEvidence]) -> float:
    """Variance of the innovations by which windows scatter about their mean; their own mean square at least."""
    every = np.sum([w.information for w in windows], axis=0)
    scale = np.sqrt(np.maximum(np.diag(every), 1e-12))
    inner = np.linalg.pinv(every / np.outer(scale, scale), rcond=1e-9, hermitian=True)
    mean = inner @ (np.sum([w.vector for w in windows], axis=0) / scale) / scale
    squares = 0.0
    for w in windows:
        score = (w.vector - w.information @ mean) / scale
        inverse = np.linalg.pinv(w.information / np.outer(scale, scale), rcond=1e-9, hermitian=True)
        squares += float(score @ inverse @ score)
    shown = int(np.linalg.matrix_rank(inner, hermitian=True))
    least = float(np.mean([w.square for w in windows]))
    return max(squares / (max(len(windows) - 1, 1) * shown), least)
