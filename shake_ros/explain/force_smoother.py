"""History of a force from what a model's run lacks: Kalman filter and fixed-interval smoother, compiled.

    v̇ = −φ v + w + g,    ẇ = −κ v − ζ w,    g a random walk of intensity s

v, w and g are what the table has beyond the model: velocity [m/s], force of the drive per mass [m/s²], the force that
the model lacks per mass [m/s²]. φ is viscous friction per mass, κ the oil spring per mass, ζ its relaxation; a model
that is driven by a force has κ = ζ = 0. g is held from sample to sample, as a simulation holds a force, so that the
transition is exact. Residuals are v, where its noise is independent, and the acceleration −φ v + w + g. Of a full table
κ, ζ and φ are those of the reduced form (6.36) about mid-stroke, ζ at the simulated opening of the valve.

The backward pass is that of Bryson and Frazier, which gives what Rauch, Tung and Striebel's gives and inverts nothing.
Verified against least squares over all samples at once (test_force_smoother.py).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from shake_ros.compiled import njit
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.physics.plant.reduced import closed_form

Array = NDArray[np.float64]
STATES = 3  # v, w, g
TERMS = 10  # of the series of a transition
LARGEST = 0.5  # norm up to which the series is taken; above it the step is halved and the transition squared
WEAKEST, STRONGEST = -4.0, 5.0  # decades of the intensity about the acceleration's noise per root of a second
CLOSE = 0.05  # decades to which the intensity is sought


@dataclass(frozen=True)
class ForceDynamics:
    """How a force shows beside a run.

    viscous : φ [1/s]. spring : κ, shape (n,) [1/s²]. relaxation : ζ, shape (n,) [1/s]. sample_time [s].
    """

    viscous: float
    spring: Array
    relaxation: Array
    sample_time: float

    @cached_property
    def steps(self) -> Array:
        """Transitions of the state from each sample to the next, the force held, shape (n, 3, 3)."""
        return np.asarray(_transitions(self.viscous, self.spring, self.relaxation, self.sample_time))

    def response(self, force: Array) -> tuple[Array, Array]:
        """Velocity and acceleration of forces per mass that are held from each sample to the next, shape (n,)."""
        states = _responses(self.steps, force)
        return states[:, 0], states @ self.acceleration_row

    @property
    def acceleration_row(self) -> Array:
        """The acceleration per state."""
        return np.array([-self.viscous, 1.0, 1.0])


def _of_full(table: TableParameters, run: Array, dt: float) -> ForceDynamics:
    """The oil column of (6.36), its relaxation at each opening; viscous friction apart from it."""
    beta = closed_form(table).beta
    viscous = table.value("friction.viscous") / moving_mass(table, table.moved_mass)
    closed = -beta.beta2 - viscous
    spring = np.full(len(run), max(-beta.beta1 - closed * viscous, 0.0))
    return ForceDynamics(viscous, spring, np.maximum(closed - beta.beta4 * np.abs(run[:, 6]), 0.0), dt)


def _of_reduced(table: TableParameters, run: Array, dt: float) -> ForceDynamics:
    beta = {name: table.value(f"dynamics.{name}") for name in ("beta1", "beta2", "beta4", "beta5")}
    opening = np.abs(run[:, 3])
    spring = np.maximum(-beta["beta1"] - beta["beta5"] * opening, 0.0)
    return ForceDynamics(0.0, spring, np.maximum(-beta["beta2"] - beta["beta4"] * opening, 0.0), dt)


def _of_axis(table: TableParameters, run: Array, dt: float) -> ForceDynamics:
    none = np.zeros(len(run))
    return ForceDynamics(table.value("axis.viscous") / table.value("axis.mass"), none, none, dt)


DYNAMICS: dict[str, Callable[[TableParameters, Array, float], ForceDynamics]] = {
    "full": _of_full,
    "reduced": _of_reduced,
    "axis": _of_axis,
}


def moving_mass(table: TableParameters, declared: float) -> float:
    """Declared mass with the error of the payload that was found [kg]."""
    return declared + (table.value("effects.payload_error.mass") if table.layout.name == "full" else 0.0)


def force_dynamics(table: TableParameters, run: Array, sample_time: float) -> ForceDynamics:
    """How a force shows beside a run with the columns of the table's model, shape (n, …)."""
    return DYNAMICS[table.layout.name](table, run, sample_time)


@dataclass(frozen=True)
class Residuals:
    """What a run lacks of the measurement, NaN where nothing was measured.

    Attributes
    ----------
    velocity [m/s], acceleration [m/s²] : measured less simulated, shape (n,). noise : standard deviation of either.
    """

    velocity: Array
    acceleration: Array
    noise: tuple[float, float]


@dataclass(frozen=True)
class Smoothed:
    """States after smoothing, shape (n, 3), and the standard deviation of the force, shape (n,) [m/s²]."""

    states: Array
    deviation: Array


@njit
def _transitions(viscous, spring, relaxation, dt):  # type: ignore[no-untyped-def]
    n = spring.shape[0]
    result, a = np.zeros((n, STATES, STATES)), np.zeros((STATES, STATES))
    for k in range(n):
        a[0, 0], a[0, 1], a[0, 2] = -viscous * dt, dt, dt
        a[1, 0], a[1, 1] = -spring[k] * dt, -relaxation[k] * dt
        scale = max(viscous * dt, math.sqrt(spring[k]) * dt, relaxation[k] * dt)
        halvings = max(0, math.ceil(math.log2(scale / LARGEST))) if scale > 0.0 else 0
        b = a * 0.5**halvings
        e, term = np.eye(STATES), np.eye(STATES)
        for i in range(1, TERMS):
            term = _product(term, b) / i
            e += term
        for _ in range(halvings):
            e = _product(e, e)
        result[k] = e
    return result


@njit
def _responses(steps, force):  # type: ignore[no-untyped-def]
    n = force.shape[0]
    states = np.zeros((n, STATES))
    for k in range(n - 1):
        for j in range(STATES):
            held = force[k] if j == 2 else states[k, j]
            for i in range(STATES):
                states[k + 1, i] += steps[k, i, j] * held
    return states


@njit
def _product(a, b):  # type: ignore[no-untyped-def]
    result = np.zeros((STATES, STATES))
    for i in range(STATES):
        for j in range(STATES):
            for k in range(STATES):
                result[i, j] += a[i, k] * b[k, j]
    return result


@njit
def _forward(steps, rows, residuals, variances, growth, start, x, p, gains, errors, spreads):  # type: ignore[no-untyped-def]
    """Predictions x, p of every sample with gains, errors and spreads of its two channels, in place; log-likelihood.

    A channel without a measurement has spread 0.
    """
    n = residuals.shape[0]
    mean, cov, moved = np.zeros(STATES), np.diag(start), np.zeros((STATES, STATES))
    likelihood = 0.0
    for k in range(n):
        x[k], p[k] = mean, cov
        for c in range(2):
            spreads[k, c] = 0.0
            if not math.isfinite(residuals[k, c]):
                continue
            h = rows[c]
            e, s = residuals[k, c], variances[c]
            for i in range(STATES):
                e -= h[i] * mean[i]
                gains[k, c, i] = 0.0
                for j in range(STATES):
                    gains[k, c, i] += cov[i, j] * h[j]
                s += h[i] * gains[k, c, i]
            for i in range(STATES):
                for j in range(STATES):
                    moved[i, j] = cov[i, j] - gains[k, c, i] * gains[k, c, j] / s
            cov[:] = moved
            for i in range(STATES):
                gains[k, c, i] /= s
                mean[i] += gains[k, c, i] * e
            errors[k, c], spreads[k, c] = e, s
            likelihood -= 0.5 * (e * e / s + math.log(s))
        cov[2, 2] += growth
        f = steps[k]
        mean = _applied(f, mean)
        cov = _product(_product(f, cov), f.T)
    return likelihood


@njit
def _applied(f, x):  # type: ignore[no-untyped-def]
    result = np.zeros(STATES)
    for i in range(STATES):
        for j in range(STATES):
            result[i] += f[i, j] * x[j]
    return result


@njit
def _backward(steps, rows, x, p, gains, errors, spreads):  # type: ignore[no-untyped-def]
    """Smoothed states and the variance of the force at every sample."""
    n = x.shape[0]
    states, variance = np.empty((n, STATES)), np.empty(n)
    adjoint, weight = np.zeros(STATES), np.zeros((STATES, STATES))
    for k in range(n - 1, -1, -1):
        adjoint = _applied(steps[k].T, adjoint)
        weight = _product(_product(steps[k].T, weight), steps[k])
        for back in range(2):
            c = 1 - back
            s = spreads[k, c]
            if s == 0.0:
                continue
            h, keep = rows[c], np.eye(STATES)
            for i in range(STATES):
                for j in range(STATES):
                    keep[i, j] -= gains[k, c, i] * h[j]
            adjoint = _applied(keep.T, adjoint)
            weight = _product(_product(keep.T, weight), keep)
            for i in range(STATES):
                adjoint[i] -= h[i] * errors[k, c] / s
                for j in range(STATES):
                    weight[i, j] += h[i] * h[j] / s
        states[k] = x[k] - _applied(p[k], adjoint)
        variance[k] = p[k, 2, 2] - _product(_product(p[k], weight), p[k])[2, 2]
    return states, variance


class ForceSmoother:
    """The smoother of one recording. start : standard deviations of v, w, g at its first sample."""

    def __init__(self, dynamics: ForceDynamics, residuals: Residuals, start: tuple[float, float, float]) -> None:
        self.dt = dynamics.sample_time
        self.noise = residuals.noise
        self.residuals = np.column_stack([residuals.velocity, residuals.acceleration])
        self.start = np.array(start) ** 2
        self.rows = np.array([[1.0, 0.0, 0.0], dynamics.acceleration_row])
        self.steps = dynamics.steps
        n = len(self.residuals)
        self._x, self._p = np.empty((n, STATES)), np.empty((n, STATES, STATES))
        self._gains, self._errors, self._spreads = np.zeros((n, 2, STATES)), np.zeros((n, 2)), np.zeros((n, 2))

    def likelihood(self, intensity: float) -> float:
        """Logarithm of the likelihood of the innovations, but for a constant; intensity s [(m/s²)²/s]."""
        work = self._x, self._p, self._gains, self._errors, self._spreads
        variances = np.array(self.noise) ** 2
        return float(_forward(self.steps, self.rows, self.residuals, variances, intensity * self.dt, self.start, *work))

    def most_likely(self) -> float:
        """Intensity of the largest likelihood [(m/s²)²/s]."""
        middle = 2.0 * math.log10(self.noise[1]) if self.noise[1] > 0.0 else 0.0
        found = minimize_scalar(
            lambda exponent: -self.likelihood(10.0**exponent),
            bounds=(middle + WEAKEST, middle + STRONGEST),
            method="bounded",
            options={"xatol": CLOSE},
        )
        return float(10.0**found.x)

    def smoothed(self, intensity: float) -> Smoothed:
        """States and the force's standard deviation under an intensity."""
        self.likelihood(intensity)
        states, variance = _backward(self.steps, self.rows, self._x, self._p, self._gains, self._errors, self._spreads)
        return Smoothed(states, np.sqrt(np.maximum(variance, 0.0)))
