"""The loop about an operating point as one linear system in discrete time, and its margins.

Plant and model are `plant.linearisation`s of a table, held between samples and late by whole samples and a fraction of
one; the observer is `observer.model` with its constant gain, predicting through the model's dead time; the law is the
state feedback u = −(k_I ∫e + k_P e_1 + k_V e_2 + k_A e_3) that every law is near its surface. The loop is opened at the
valve: input is the command that goes to the table (and to the observer), output the one that the law demands.
Verified against: closed forms; the nonlinear loop, which rings where this one is no longer stable.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from shake_ros.core.plant.dead_time import dead_time
from shake_ros.core.plant.linearisation import LinearModel, linearise, state_scales
from shake_ros.core.plant.parameters import TableParameters
from shake_ros.core.plant.states import LAGGED_POSITION, POSITION, PRESSURE_A, PRESSURE_B, VELOCITY
from shake_ros.core.quantities import ShakeError

Array = NDArray[np.float64]
LOWEST = 0.3  # [rad/s] from which margins are sought


class Feedback(NamedTuple):
    """The law near its surface: command per ∫e [1/(m s)], e_1 [1/m], e_2 [s/m], e_3 [s²/m], with a minus sign."""

    integral: float
    position: float
    velocity: float
    acceleration: float


@dataclass(frozen=True)
class Margins:
    """Margins of a loop.

    gain : factor by which the gain may grow [-]. phase : [rad]. delay : further dead time [s].
    disk : factor by which gain may grow, and shrink by its inverse, at any phase within the disk; 1 for none.
    sensitivity : largest |1/(1 + L)|. stable : whether the closed loop's eigenvalues are within the unit circle.
    """

    stable: bool
    gain: float
    phase: float
    delay: float
    disk: float
    sensitivity: float

    @property
    def text(self) -> str:
        """In a line."""
        return (
            f"gain {self.gain:.2f}, phase {math.degrees(self.phase):.0f} deg, delay {1e3 * self.delay:.1f} ms, "
            f"disk {self.disk:.2f}, sensitivity {self.sensitivity:.2f}"
        )


class Held(NamedTuple):
    """A linear model sampled: x⁺ = a x + b_late u(k − whole − 1) + b u(k − whole); motion = c x (d is none).

    sensed : state that the position transducer shows, that behind its lag where it has one.
    """

    a: Array
    b_late: Array
    b: Array
    c: Array
    whole: int
    fraction: float
    a_part: Array  # over the fraction of a sample alone
    b_part: Array
    position: int
    velocity: int
    pressures: tuple[int, int]
    sensed: int
    scales: Array


def held(model: LinearModel, delay: tuple[int, float], sample_time: float) -> Held:
    """A linear model under a command that is held and late, in states over their typical size."""
    s = state_scales()[list(model.states)]
    a, b, c = model.a * s / s[:, None], model.b / s, model.c * s
    n = len(a)

    def over(time: float) -> tuple[Array, Array]:
        block = np.zeros((n + 1, n + 1))
        block[:n, :n], block[:n, n] = a * time, b * time
        result = expm(block)
        return result[:n, :n], result[:n, n]

    whole, fraction = delay
    a_part, b_part = over(fraction * sample_time)
    a_rest, b_rest = over((1.0 - fraction) * sample_time)
    sensed = LAGGED_POSITION if LAGGED_POSITION in model.states else POSITION
    at = [model.states.index(i) for i in (POSITION, VELOCITY, PRESSURE_A, PRESSURE_B, sensed)]
    return Held(
        a_rest @ a_part, a_rest @ b_part, b_rest, c, whole, fraction, a_part, b_part, at[0], at[1], (at[2], at[3]),
        at[4], s,
    )  # fmt: skip


class OpenLoop(NamedTuple):
    """x⁺ = a x + b u, w = c x: u goes to the valve and the observer, w is what the law demands."""

    a: Array
    b: Array
    c: Array
    sample_time: float


def carried(system: Held, x: Array, past: Array) -> Array:
    """One sample on; x (n, m) and past commands (h, m), newest first."""
    result: Array = (
        system.a @ x + np.outer(system.b_late, past[system.whole + 1]) + np.outer(system.b, past[system.whole])
    )
    return result


def ahead(system: Held, x: Array, past: Array) -> Array:
    """The state when the next command begins to act, as `observer.carried.motion_ahead` carries it."""
    for i in range(system.whole):
        x = system.a @ x + np.outer(system.b_late, past[system.whole - i])
        x = x + np.outer(system.b, past[system.whole - i - 1])
    return system.a_part @ x + np.outer(system.b_part, past[0])


def open_loop(
    plant: Held, model: Held, gains: Array, per_acceleration: float, feedback: Feedback, dt: float
) -> OpenLoop:
    """The loop opened at the valve.

    Parameters
    ----------
    model : what the observer carries and predicts with. gains : (4,) of `observer.linear.kalman_gain`.
    per_acceleration : load pressure per acceleration, half its change [Pa s²/m]. dt : sample time [s].
    """
    n, m = len(plant.a), len(model.a)
    late = max(plant.whole, model.whole) + 2
    size = n + m + late + 2  # plant, copy, past commands, disturbance, integral

    def following(states: Array, u: Array) -> tuple[Array, Array]:
        x, z, past = states[:n], states[n : n + m], states[n + m : n + m + late]
        disturbance, integral = states[-2], states[-1]
        predicted = z if model.whole == 0 and model.fraction == 0.0 else ahead(model, z, past)
        motion = model.c @ predicted
        demand = -(feedback.integral * integral + feedback.position * motion[0])
        demand = demand - feedback.velocity * motion[1] - feedback.acceleration * motion[2]
        past = np.vstack([u[None, :], past[:-1]])
        x, z = carried(plant, x, past), carried(model, z, past)
        innovation = plant.scales[plant.sensed] * x[plant.sensed] - model.scales[model.sensed] * z[model.sensed]
        correction = np.zeros_like(z)
        for place in {model.position, model.sensed}:
            correction[place] = gains[0] * innovation / model.scales[place]
        correction[model.velocity] = gains[1] * innovation / model.scales[model.velocity]
        push = per_acceleration * (gains[2] * innovation + dt * disturbance)
        for place, sign in zip(model.pressures, (1.0, -1.0), strict=True):
            correction[place] = sign * push / model.scales[place]
        z = z + correction
        disturbance = disturbance + gains[3] * innovation
        integral = integral + dt * motion[0]
        return np.vstack([x, z, past, disturbance[None, :], integral[None, :]]), demand

    states, u = np.eye(size, size + 1), np.zeros(size + 1)
    u[-1] = 1.0
    after, demand = following(states, u)
    kept = size if feedback.integral != 0.0 else size - 1  # an integral that is not used would not decay
    return OpenLoop(after[:kept, :kept], after[:kept, -1], demand[:kept], dt)


def is_stable(loop: OpenLoop) -> bool:
    """Whether the closed loop u = w decays."""
    closed = loop.a + np.outer(loop.b, loop.c)
    return bool(np.max(np.abs(np.linalg.eigvals(closed))) < 1.0 - 1e-7)


def response(loop: OpenLoop, omega: Array) -> NDArray[np.complex128]:
    """L = −w/u at frequencies (n,) [rad/s]."""
    z = np.exp(1j * omega * loop.sample_time)
    matrices = z[:, None, None] * np.eye(len(loop.a)) - loop.a
    states = np.linalg.solve(matrices, loop.b.astype(complex)[:, None])[..., 0]
    return np.asarray(-(states @ loop.c), dtype=np.complex128)


def grid(sample_time: float, count: int = 400) -> Array:
    """Frequencies up to the Nyquist frequency [rad/s]."""
    return np.geomspace(LOWEST, 0.999 * math.pi / sample_time, count)


def sensitivity(loop: OpenLoop, omega: Array) -> float:
    """Largest |1/(1 + L)| of a stable loop; infinite for one that is not."""
    if not is_stable(loop):
        return math.inf
    return float(1.0 / np.min(np.abs(1.0 + response(loop, omega))))


def margins_of(found: NDArray[np.complex128], omega: Array) -> tuple[float, float, float]:
    """Gain [-], phase [rad] and delay margin [s] of a frequency response; infinite where nothing crosses.

    An integrator with a dead time of 0.1 s crosses unit gain at 1 rad/s, and −180° at 5π rad/s:

    >>> omega = np.geomspace(0.1, 100.0, 20000)
    >>> gain, phase, delay = margins_of(np.exp(-0.1j * omega) / (1j * omega), omega)
    >>> round(gain, 2), round(phase, 3), round(delay, 3)  # 5π; π/2 − 0.1; the same over 1 rad/s
    (15.71, 1.471, 1.471)
    """
    real, imaginary, size = found.real, found.imag, np.abs(found)
    turned = np.flatnonzero((np.diff(np.sign(imaginary)) != 0.0) & (real[:-1] < 0.0) & (size[:-1] < 1.0))
    crossing = np.flatnonzero(np.diff(np.sign(size - 1.0)))
    angle = np.mod(np.pi + np.angle(found[crossing]), 2.0 * np.pi)
    gain = float(np.min(1.0 / size[turned], initial=np.inf))
    phase = float(np.min(np.minimum(angle, 2.0 * np.pi - angle), initial=np.inf))
    return gain, phase, float(np.min(angle / omega[crossing], initial=np.inf))


def margins(loop: OpenLoop) -> Margins:
    """Margins of the loop; the disk is the balanced one, of |S − 1/2| [Seiler, Packard, Gahinet 2020]."""
    omega = grid(loop.sample_time, 1500)
    found = response(loop, omega)
    reach = float(np.min(1.0 / np.abs(1.0 / (1.0 + found) - 0.5)))
    disk = (2.0 + reach) / (2.0 - reach) if reach < 2.0 else math.inf
    peak = float(np.max(1.0 / np.abs(1.0 + found)))
    return Margins(is_stable(loop), *margins_of(found, omega), disk, peak)


def linear_at(table: TableParameters, state: Array | None, loop_delay: float, sample_time: float) -> Held:
    """A table about a state, late by its own dead time and the loop's."""
    whole, fraction = dead_time(table, sample_time)
    extra = loop_delay / sample_time + fraction
    whole, fraction = whole + math.floor(extra + 1e-9), max(extra - math.floor(extra + 1e-9), 0.0)
    found = linearise(table, state)
    if not all(np.isfinite(part).all() for part in (found.a, found.b)):
        raise ShakeError("the table has no linear model at an operating point")
    return held(found, (whole, fraction if fraction > 1e-6 else 0.0), sample_time)
