"""Drive-file iteration: the reference of the next run from the acceleration that the last one missed.

A shaking table is driven again and again with the same motion; what it missed is known after each run. From the drive
of the run that missed least:

    D' (f) = D(f) + L(f) [W(f) − A(f)],  L = μ B(f) γ²(f) H*(f) / (|H|² + ε max|H|²)

with the drive D (the acceleration of the reference that is played), the wanted W and achieved acceleration A, the band
B with soft edges, and H = (S_AD + δ)/(S_DD + δ), δ = ε² max S_DD, γ² = |S_AD|²/(S_AA S_DD) from the runs themselves,
averaged over neighbouring frequencies: learning is slow where the table does not answer in proportion. δ lets H go
over into 1, a loop that follows, where the drive has no power: there S_AD/S_DD is noise over nothing, of any size, and
max|H|² would leave no learning at all. The drive is made to end at rest, its
position and velocity follow by exact integration, and it is scaled back as a whole where it would leave its limits.

The iteration stops where the error is small enough or no longer falls; the best drive is kept.
The usual practice of earthquake testing; not in the thesis.
Verified against: a linear table with known response, which is inverted within the band; the simulated table.

`iterate_model` moves the model instead: a run is played under the model feedforward of the virtual table, and its
recording (the command that acted, position, acceleration) is what an identification needs: the parameters of the
declared model and of the effects that it is to have are fitted to the error of the free run, from the last model and
from each trial of an effect, whichever start is the closest. So the motion that was missed moves the inverse of the
table and not the reference; where the model can become the table, one run is enough. Correcting the reference needs a
table that answers nearly linearly, which one with a soft zone does not. Not in the thesis. Verified against: the
simulated table, with models wrong by known amounts.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shake_ros.control.reference.baseline import end_at_rest, states_from_rest
from shake_ros.control.reference.motion import smooth_step
from shake_ros.fit.free_parameters import FreeParameter, FreeParameters
from shake_ros.fit.least_squares import fit
from shake_ros.fit.recording_problem import RecordingProblem
from shake_ros.fit.records import Record
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.quantities import Parameters, ShakeError, quantity
from shake_ros.search.candidate_effects import CandidateEffect

Array = NDArray[np.float64]
Complexes = NDArray[np.complex128]
EDGE = 0.25  # of a corner frequency, over which the band fades
FADE = 0.5  # [s] at either end, over which a correction fades
EVALUATIONS = 20  # trial points of a fit, at most; it starts near its end after the first run


@dataclass(frozen=True)
class Iteration(Parameters):
    """How a drive is corrected."""

    learning_gain: float = quantity("-", "mu, share of the error that a run corrects", low=0.0, high=1.0)
    lowest_frequency: float = quantity("Hz", "below which nothing is corrected", low=0.0)
    highest_frequency: float = quantity("Hz", "above which nothing is corrected", low=0.1)
    smoothing: float = quantity("Hz", "width over which the response is averaged", low=0.01)
    regularisation: float = quantity("-", "epsilon, share of the largest response that is not inverted", low=0.0)
    position_limit: float = quantity("m", "largest position of a drive", low=1e-6)
    velocity_limit: float = quantity("m/s", "largest velocity of a drive", low=1e-6)
    acceleration_limit: float = quantity("m/s^2", "largest acceleration of a drive", low=1e-6)
    good_enough: float = quantity("-", "normalised error at which the iteration stops", low=0.0)
    least_gain: float = quantity("-", "relative fall of the error in two runs below which it stops", low=0.0, high=1.0)
    runs: int = quantity("-", "most runs", low=1, high=100)
    accepted: float = quantity("-", "error of the best run up to which an iteration has converged", low=0.0)


@dataclass(frozen=True)
class Run:
    """One run: the acceleration that was played and that which the accelerometer measured, (n,) each [m/s²]."""

    drive: Array
    achieved: Array


def error_in_band(wanted: Array, achieved: Array, sample_time: float, parameters: Iteration) -> float:
    """Root mean square of the difference within the band over that of the wanted acceleration about its mean.

    Outside the band nothing is corrected, and most of an accelerometer's noise lies there.
    """
    frequency = np.fft.rfftfreq(len(wanted), sample_time)
    weight = band(frequency, parameters.lowest_frequency, parameters.highest_frequency)
    missed = np.fft.irfft(weight * np.fft.rfft(achieved - wanted), len(wanted))
    return float(np.sqrt(np.mean(missed**2)) / np.std(wanted))


def band(frequency: NDArray[np.floating[Any]], low: float, high: float) -> Array:
    """B(f): one inside low … high [Hz], fading over `EDGE` of either corner outside.

    >>> band(np.array([0.0, 1.0, 5.0, 10.0, 13.0]), 1.0, 10.0).tolist()
    [0.0, 1.0, 1.0, 1.0, 0.0]
    """
    inside = np.clip(((1.0 + EDGE) * high - frequency) / (EDGE * high), 0.0, 1.0)
    if low > 0.0:
        inside = inside * np.clip((frequency - (1.0 - EDGE) * low) / (EDGE * low), 0.0, 1.0)
    smooth: Array = inside * inside * (3.0 - 2.0 * inside)
    return smooth


def _averaged(spectrum: NDArray[np.generic], width: int) -> Complexes:
    """Mean over `width` neighbours by a Hann window."""
    window = np.hanning(width + 2)[1:-1]
    padded = np.pad(spectrum.astype(np.complex128), width // 2, mode="edge")
    return np.convolve(padded, window / window.sum(), mode="valid")[: len(spectrum)]


def response(
    runs: Sequence[Run], sample_time: float, smoothing: float, regularisation: float
) -> tuple[Complexes, Array]:
    """(H, γ²) of achieved over drive at the frequencies of `rfft`, from all runs.

    Where the drives have less than `regularisation` times their largest amplitude, H goes over into 1: a loop follows.

    Raises
    ------
    ShakeError : no runs, or runs of different lengths.
    """
    if not runs or len({len(part) for run in runs for part in (run.drive, run.achieved)}) != 1:
        raise ShakeError("iteration: needs runs of one length")
    n = len(runs[0].drive)
    width = 2 * (max(1, round(smoothing * n * sample_time)) // 2) + 1
    given = [np.fft.rfft(run.drive) for run in runs]
    answer = [np.fft.rfft(run.achieved) for run in runs]
    cross = _averaged(np.sum([a * d.conj() for a, d in zip(answer, given, strict=True)], axis=0), width)
    power = _averaged(np.sum([np.abs(d) ** 2 for d in given], axis=0), width).real
    answered = _averaged(np.sum([np.abs(a) ** 2 for a in answer], axis=0), width).real
    tiny = np.finfo(float).tiny
    unknown = max(regularisation**2 * float(np.max(power)), tiny)
    return (cross + unknown) / (power + unknown), np.abs(cross) ** 2 / np.maximum(power * answered, tiny)


def faded_to_rest(correction: Array, sample_time: float) -> Array:
    """The correction, faded in and out, less a smooth course that takes its last velocity and position to zero.

    Faded and not tilted: a ramp that takes ends of 0.02 m/s² to zero moves a table by a decimetre within 10 s.
    """
    place = np.arange(len(correction), dtype=np.float64)
    length = min(FADE, 0.1 * len(correction) * sample_time)
    fade = smooth_step(np.minimum(place, place[::-1]) * sample_time / length)[0]
    return end_at_rest(correction * fade, sample_time)


def next_drive(wanted: Array, runs: Sequence[Run], sample_time: float, parameters: Iteration) -> tuple[Array, float]:
    """The reference of the next run.

    Parameters
    ----------
    wanted : (n,) acceleration that the table should have [m/s²]
    runs : at least one, oldest first; the last one is corrected, all of them give the response.

    Returns
    -------
    (reference, factor) : (n, 3) position [m], velocity [m/s], acceleration [m/s²]; the factor by which it had to be
    scaled to stay within its limits, 1 where it had not
    """
    p = parameters
    found, coherence = response(runs, sample_time, p.smoothing, p.regularisation)
    last = runs[-1]
    if len(wanted) != len(last.drive):
        raise ShakeError(f"iteration: {len(wanted)} samples are wanted, the run has {len(last.drive)}")
    frequency = np.fft.rfftfreq(len(wanted), sample_time)
    weight = p.learning_gain * coherence * band(frequency, p.lowest_frequency, p.highest_frequency)
    size = np.abs(found) ** 2
    floor = p.regularisation * float(np.max(size[weight > 0.0], initial=0.0))
    gain = weight * found.conj() / np.maximum(size + floor, np.finfo(float).tiny)
    correction = np.fft.irfft(gain * np.fft.rfft(wanted - last.achieved), len(wanted))
    drive = last.drive + faded_to_rest(correction, sample_time)
    states = states_from_rest(drive, sample_time)
    largest = np.max(np.abs(states), axis=0) / np.array([p.position_limit, p.velocity_limit, p.acceleration_limit])
    factor = 1.0 / max(1.0, float(np.max(largest)))
    return states * factor, factor


def drive_from_best(
    wanted: Array, runs: Sequence[Run], errors: Sequence[float], sample_time: float, parameters: Iteration
) -> tuple[Array, float]:
    """`next_drive` from the run of the least error, with half the learning gain for each run since that missed more.

    A correction that made it worse is not built upon: where the drive has little power its response is known badly.
    """
    best = int(np.argmin(errors))
    since = len(errors) - 1 - best
    ordered = [run for k, run in enumerate(runs) if k != best] + [runs[best]]
    slower = parameters.replace(learning_gain=parameters.learning_gain * 0.5**since)
    return next_drive(wanted, ordered, sample_time, slower)


def converged(errors: Sequence[float], parameters: Iteration) -> str:
    """Why the iteration stops after these errors; empty where it goes on.

    >>> settings = Iteration(learning_gain=0.8, lowest_frequency=0.2, highest_frequency=20.0, smoothing=0.5,
    ...     regularisation=0.01, position_limit=0.1, velocity_limit=0.6, acceleration_limit=9.0, good_enough=0.05,
    ...     least_gain=0.05, runs=8, accepted=0.1)
    >>> converged([0.5, 0.2], settings), converged([0.5, 0.04], settings), converged([0.5, 0.2, 0.2, 0.21], settings)
    ('', 'good enough', 'no longer falls')
    """
    if errors[-1] <= parameters.good_enough:
        return "good enough"
    if len(errors) > 3 and min(errors[-2:]) > (1.0 - parameters.least_gain) * min(errors[:-2]):
        return "no longer falls"
    return "most runs" if len(errors) >= parameters.runs else ""


def verdict(errors: Sequence[float], parameters: Iteration) -> str:
    """What is wrong with an iteration that ended; empty where it converged."""
    best = min(errors)
    if best <= parameters.accepted:
        return ""
    if len(errors) > 1 and best == errors[0]:
        return (
            f"diverges: run 1 missed {100.0 * best:.1f} %, the runs after it at least {100.0 * min(errors[1:]):.1f} %"
        )
    text = f"has not converged: the best of {len(errors)} runs misses {100.0 * best:.1f} %"
    return f"{text}, accepted are {100.0 * parameters.accepted:.1f} %"


def iterate(
    wanted: Array,
    first: Array,
    play: Callable[[Array, int], Array],
    sample_time: float,
    parameters: Iteration,
    learnt: Callable[[], bool] = lambda: False,
) -> tuple[list[Array], list[float], str]:
    """Run after run until `converged`.

    Parameters
    ----------
    wanted : (n,) acceleration [m/s²].
    first : (n, 3) reference of the first run.
    play : plays a reference (n, 3) in the run of this number and returns the measured acceleration, (n,).
    learnt : asked after each run whether it changed what plays; the drive then begins anew from `first`.

    Returns
    -------
    (references, errors, reason) : one of each a run; the best run is that of the least error
    """
    references, errors, runs = [first], list[float](), list[Run]()
    while True:
        achieved = play(references[-1], len(errors))
        runs.append(Run(references[-1][:, 2], achieved))
        errors.append(error_in_band(wanted, achieved, sample_time, parameters))
        reason = converged(errors, parameters)
        if reason:
            return references, errors, reason
        if learnt():
            runs.clear()
            references.append(first)
        else:
            since = errors[-len(runs) :]
            references.append(drive_from_best(wanted, runs, since, sample_time, parameters)[0])


def starts(free: FreeParameters, effects: Sequence[CandidateEffect]) -> Array:
    """The model as it is, and the model with each trial of each effect that it does not have yet, (m, p)."""
    rows = [free.start()]
    for effect in effects:
        if free.base.value(effect.strength.name) == effect.neutral:
            rows += [free.x_of(trial) for trial in effect.trials]
    return np.array(rows)


def refit(
    model: TableParameters, free: Sequence[FreeParameter], effects: Sequence[CandidateEffect], records: Sequence[Record]
) -> TableParameters:
    """The model fitted to recordings.

    Parameters
    ----------
    model : where the fit starts.
    free : its parameters that may move.
    effects : whose parameters may move as well.
    records : with acceleration.

    Raises
    ------
    ShakeError : a recording without acceleration, or none at all.
    """
    if not records or any(record.acceleration is None for record in records):
        raise ShakeError("iteration: the model needs recordings with acceleration")
    moved = FreeParameters(model, free).extended([p for effect in effects for p in effect.free])
    problem = RecordingProblem(list(records))
    rows = starts(moved, effects)
    costs = [np.mean(np.square(row)) for row in problem.residuals(moved.vectors(rows))]
    start = rows[int(np.argmin(np.nan_to_num(costs, nan=np.inf)))]
    return moved.table(fit(problem, moved, start, evaluations=EVALUATIONS).x)


def iterate_model(
    wanted: Array,
    model: TableParameters,
    play: Callable[[TableParameters, int], Record],
    learn: Callable[[TableParameters, Sequence[Record]], TableParameters],
    parameters: Iteration,
) -> tuple[list[TableParameters], list[float], str]:
    """Run after run until `converged`, each under the model fitted to the run before.

    Parameters
    ----------
    wanted : (n,) acceleration [m/s²].
    model : of the first run.
    play : plays the motion under the feedforward of this model in the run of this number and returns its recording.
    learn : the next model from this one and the recordings of a run, such as `refit`.

    Returns
    -------
    (models, errors, reason) : one of each a run; the best run is that of the least error
    """
    models, errors = [model], list[float]()
    while True:
        record = play(models[-1], len(errors))
        if record.acceleration is None or len(record.acceleration) != len(wanted):
            raise ShakeError("iteration: a run needs the acceleration of every sample of the wanted motion")
        errors.append(error_in_band(wanted, record.acceleration, record.sample_time, parameters))
        reason = converged(errors, parameters)
        if reason:
            return models, errors, reason
        models.append(learn(models[-1], [record]))
