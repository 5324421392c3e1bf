"""The force that a model lacks, as a history: what would have to act for the model to give the measured motion.

Where a residual is on no list and no function of one quantity, its history still tells what kind of thing is missing. A
residual of the acceleration does not: the oil column rings after every push, and a slow force shows in the velocity
alone. The force is therefore a state of its own, smoothed over the whole recording (force_smoother.py).

Each pass runs the model under the force so far and smooths what is left beside the linear answer to that force: the
steps of Gauss and Newton towards the force under which the nonlinear model leaves no more than its noise. Friction that
reverses at another instant, a soft zone or a specimen's mode are in the runs, not in the linear model, whose errors
thus only slow the approach. That model is the reduced form (6.36) about the run, its damping with the valve's opening;
the position is the measured one, as in every run. Velocity counts where its noise is independent (twice the filter's
bandwidth), either channel with its noise, not below the floor that a model's accuracy has in a fit.

Verified against tables of another simulator, whose force is known (test_latent_force.py).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from shake_ros.explain.force_kinds import ForceKinds, band_factor, beside_band, judged_kinds
from shake_ros.explain.force_smoother import ForceSmoother, Residuals, Smoothed, force_dynamics, moving_mass
from shake_ros.fit.declared_model import DeclaredModel
from shake_ros.fit.records import Record, longest
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.search.problem import SearchProblem, side_by_side
from shake_ros.search.search_settings import SearchSettings
from shake_ros.signals.velocity_filter import CUTOFF, filtered_velocity, samples_apart

Array = NDArray[np.float64]
EXPLAINED = 0.5  # part of what a run leaves, from which on the force is the smaller part of what is missing
SPIKE = 8.0  # multiples of the noise by which a single sample stands out; no force of the estimated band does that


@dataclass(frozen=True)
class LatentForce:
    """History of the force that a model lacks in one recording, from the first sample compared, shape (n,).

    Attributes
    ----------
    recording, held_out : whose. time [s] since its start. force, deviation : along +x, its standard deviation [unit].
    unit : N, or m/s² where the model counts forces per mass. bandwidth : up to which it stands out of the noise [Hz].
    of_inertia : its rms over that of the force of inertia [-].
    left : what the run leaves without and with the force, in multiples of the noise. kinds : what kind of thing it is.
    known : what it may depend on, each of shape (n,). band : probability of its confidence band.
    near_noise : multiple of the noise within which a run is at it.
    """

    recording: str
    held_out: bool
    time: Array
    force: Array
    deviation: Array
    unit: str
    bandwidth: float
    of_inertia: float
    left: tuple[float, float]
    kinds: ForceKinds
    known: dict[str, Array]
    band: float
    near_noise: float

    @property
    def ends(self) -> tuple[Array, Array]:
        """Lower and upper end of the confidence band, shape (n,) [unit]."""
        half = band_factor(self.band) * self.deviation
        return self.force - half, self.force + half

    @property
    def explains(self) -> bool:
        """Whether a run under the force is at its noise, or leaves at most EXPLAINED of what one without it does."""
        without, under = self.left
        return under <= max(self.near_noise, EXPLAINED * without)

    @property
    def rms(self) -> float:
        """Root mean square [unit]."""
        return float(np.sqrt(np.mean(self.force**2)))

    @property
    def peak(self) -> float:
        """Largest size [unit]."""
        return float(np.max(np.abs(self.force)))


@dataclass(frozen=True)
class _Pass:
    """Smoothed states of one pass.

    applied : force per mass from each sample to the next, shape (n,). left : by the run. linear : by the run and the
    linear answer to the force.
    """

    smoothed: Smoothed
    applied: Array
    intensity: float
    left: float
    linear: float


def rests(model: DeclaredModel, record: Record, run: Array) -> tuple[Array, Array]:
    """Velocity and acceleration measured less those of a run, from the first sample compared, NaN where not measured.

    Without their mean where a model leaves each channel an offset.
    """
    span, unseen = slice(record.start, None), np.full(len(run), np.nan)
    velocity = (record.motion[:, 0] - filtered_velocity(run[:, 1], record.sample_time))[span]
    acceleration = (unseen if record.acceleration is None else record.acceleration - run[:, 2])[span]
    acceleration[~record.whole[span]] = np.nan
    if record.acceleration is not None:
        acceleration[single(acceleration, SPIKE * record.acceleration_noise())] = np.nan
    if model.nuisances:
        velocity -= np.mean(velocity)
        acceleration -= np.nanmean(acceleration) if record.acceleration is not None else 0.0
    return velocity, acceleration


def single(values: Array, height: float) -> NDArray[np.bool_]:
    """Samples that stand out of both neighbours: a reversal within a sample, which a model may show as none.

    >>> single(np.array([0.0, 9.0, 0.0, 0.0, 9.0, 9.0, 0.0]), 5.0).tolist()
    [False, True, False, False, False, False, False]
    """
    found = np.zeros(len(values), dtype=bool)
    middle = np.median(np.stack([values[:-2], values[1:-1], values[2:]]), axis=0)
    found[1:-1] = np.abs(values[1:-1] - middle) > height
    return found


def size(rest: tuple[Array, Array], noise: tuple[float, float]) -> float:
    """Rms of what is left, in multiples of the noise, the channels alike."""
    squares = [np.nanmean(r**2) / n**2 for r, n in zip(rest, noise, strict=True) if n > 0.0]
    return float(np.sqrt(np.mean(squares)))


class _Passes:
    """The passes over one recording."""

    def __init__(self, model: DeclaredModel, table: TableParameters, record: Record) -> None:
        self.model, self.table, self.record = model, table, record
        self.mass = moving_mass(table, model.moved_mass(table))
        self.noise = record.deviations()
        self.stride = samples_apart(record.sample_time)
        self.start: tuple[float, float, float] | None = None

    def smoothed(self, run: Array, applied: Array, intensity: float | None = None) -> _Pass | None:
        """One pass beside a run under a force; None where it is lost."""
        if not np.isfinite(run[:, :3]).all():
            return None
        dt = self.record.sample_time
        velocity, acceleration = rests(self.model, self.record, run)
        left = size((velocity, acceleration), self.noise)
        dynamics = force_dynamics(self.table, run[self.record.start :], dt)
        if self.start is None:
            self.start = self._start(velocity, acceleration)
        by_velocity, by_acceleration = dynamics.response(applied)
        residuals = np.full(len(velocity), np.nan)
        residuals[:: self.stride] = (velocity + by_velocity)[:: self.stride]
        smoother = ForceSmoother(dynamics, Residuals(residuals, acceleration + by_acceleration, self.noise), self.start)
        intensity = smoother.most_likely() if intensity is None else intensity
        result = smoother.smoothed(intensity)
        force = result.states[:, 2]
        answers = result.states[:, 0] - by_velocity, result.states @ dynamics.acceleration_row - by_acceleration
        linear = size((velocity - answers[0], acceleration - answers[1]), self.noise)
        return _Pass(result, np.append(force[1:], force[-1]), intensity, left, linear)

    def _start(self, velocity: Array, acceleration: Array) -> tuple[float, float, float]:
        """Deviations of the first state: as large as what the run without the force leaves."""
        if self.record.acceleration is None:
            push = float(np.std(np.gradient(velocity, self.record.sample_time)))
        else:
            push = float(np.nanstd(acceleration)) + self.noise[1]
        speed = velocity if self.record.position_measured else self.record.velocity
        return float(np.std(speed)) + self.noise[0], push, push

    def under(self, applied: Array) -> Array | None:
        """The run under a force per mass."""
        forces = np.concatenate([np.zeros(self.record.start), self.mass * applied])
        return self.model.run_under(self.table, self.record, forces)

    def bandwidth(self, intensity: float) -> float:
        """Frequency up to which a force of this intensity stands above the acceleration's noise [Hz]."""
        dt = self.record.sample_time
        density = self.noise[1] ** 2 * dt
        if density == 0.0:
            return CUTOFF
        return min(math.sqrt(intensity / density) / (2.0 * math.pi), CUTOFF, 0.5 / dt)


def latent_force(
    model: DeclaredModel, table: TableParameters, record: Record, settings: SearchSettings, held_out: bool = True
) -> LatentForce | None:
    """The force that a table lacks in a recording; None where its run is lost or the recording is too short.

    None as well for a table that shakes by itself: what shakes it is such a force.
    """
    if record.explained is not None:
        return None
    passes = _Passes(model, table, record)
    run = model.run(table, record)
    none = np.zeros(len(record.commands) - record.start)
    best = passes.smoothed(run, none)
    if best is None:
        return None
    without = best.left
    if not beside_band(*_estimated(passes, best), without, settings)[0]:
        best, run = _approached(passes, best, run, settings)
    force, deviation = _estimated(passes, best)
    known = _known(passes, run)
    inertia = passes.mass * float(np.sqrt(np.mean(_accelerations(record) ** 2)))
    return LatentForce(
        recording=record.name,
        held_out=held_out,
        time=np.asarray(record.begin + np.arange(record.start, len(record.commands)) * record.sample_time),
        force=force,
        deviation=deviation,
        unit="m/s²" if table.layout.name == "reduced" else "N",
        bandwidth=passes.bandwidth(best.intensity),
        of_inertia=float(np.sqrt(np.mean(force**2))) / max(inertia, 1e-300),
        left=(without, best.left),
        kinds=judged_kinds(force, deviation, without, known, record.sample_time, settings),
        known=known,
        band=settings.force_band,
        near_noise=settings.near_noise,
    )


def _approached(passes: _Passes, first: _Pass, run: Array, settings: SearchSettings) -> tuple[_Pass, Array]:
    """Last pass that left less than the one before, and its run. A step that leaves more is halved.

    A model that runs under no force leaves what its linear answer does.
    """
    best, base, step = first, np.zeros(len(first.applied)), 1.0
    for _ in range(settings.force_passes):
        trial = base + step * (best.applied - base)
        under = passes.under(trial)
        if under is None:
            return replace(best, left=best.linear), run
        following = passes.smoothed(under, trial)
        if following is None or not following.left < best.left:
            step *= 0.5
            continue
        fell, base = best.left - following.left, trial
        best, run, step = following, under, min(2.0 * step, 1.0)
        if fell < settings.force_settled * first.left:
            break
    return best, run


def _estimated(passes: _Passes, best: _Pass) -> tuple[Array, Array]:
    """Force at each sample, the mean of those held before and after it, and its standard deviation."""
    held = best.smoothed.states[:, 2]
    return passes.mass * 0.5 * (held + best.applied), passes.mass * best.smoothed.deviation


def _accelerations(record: Record) -> Array:
    """What was felt, or the derivative of the velocity, from the first sample compared, shape (n,) [m/s²]."""
    return record.felt[record.start :]


def _known(passes: _Passes, run: Array) -> dict[str, Array]:
    """What the force may depend on, from the first sample compared."""
    quantities = passes.model.quantities(passes.record, run)
    return {name: values[passes.record.start :] for name, values in quantities.items()}


def latent_forces(problem: SearchProblem, table: TableParameters) -> tuple[LatentForce, ...]:
    """The force that a table lacks in the longest part of every recording, those of validation first."""
    records = {(r.name, False): r for r in longest(problem.estimation.records)}
    names = {name for name, _ in records}
    held_out = {(r.name, True): r for r in longest(problem.validation.records) if r.name not in names}

    def one(item: tuple[tuple[str, bool], Record]) -> LatentForce | None:
        (_, held), record = item
        return latent_force(problem.estimation.model, table, record, problem.settings, held)

    found = side_by_side(one, list({**held_out, **records}.items()))
    return tuple(force for force in found if force is not None)
