"""The loop about an operating point as one linear system in discrete time, and its margins.

Plant and model are `plant.linearisation`s of a table, held between samples and late by whole samples and a fraction of
one; the observer is `observer.model` with its constant gain, predicting through the model's dead time; the law is the
state feedback u = −(k_I ∫e + k_P e_1 + k_V e_2 + k_A e_3) that every law is near its surface. The loop is opened at the
valve: input is the command that goes to the table (and to the observer), output the one that the law demands.
Verified against: closed forms; the nonlinear loop, which rings where this one is no longer stable.

Gains of each law from one state feedback, so that all laws near their surface are the loop that has the margins.

With the reduced model e⃛ = β_1 ė + β_2 ë + β_3 u of the error under a model feedforward, every law is near its surface
u = −(k_I ∫e + k_P e_1 + k_A e_3). Sliding mode (6.48) makes the polynomial s⁴ + (k_A β_3 − β_2) s³ − β_1 s² +
k_P β_3 s + k_I β_3 = (s + λ)(s³ + K_s3 s² + K_s2 s + K_s1) with K_s4 = 1 and the real root λ = K_s α_1. The root of
super-twisting, α_1 √|S| tanh(α_2 S), has its steepest chord at α_2 |S| = 1.09, where it is 0.763 α_1 √α_2 S: that is
the gain which must be sound. Feedforward PI and minimal control synthesis have no k_A. Away from the surface a gain
only falls: tanh saturates, the root flattens.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from shake_ros.control.laws.feedforward_pi import FeedforwardPI
from shake_ros.control.laws.law import LawParameters
from shake_ros.control.laws.minimal_control_synthesis import MinimalControlSynthesis
from shake_ros.control.laws.sliding_mode import SlidingMode
from shake_ros.control.laws.super_twisting import SuperTwisting
from shake_ros.control.laws.three_variable import ThreeVariable
from shake_ros.physics.plant.linearisation import LinearModel, balanced, linearise, state_scales
from shake_ros.physics.plant.parameters import TableParameters, dead_time
from shake_ros.physics.plant.reduced import ReducedParameters
from shake_ros.physics.plant.states import LAGGED_POSITION, POSITION, PRESSURE_A, PRESSURE_B, VELOCITY
from shake_ros.quantities import ShakeError

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
    """Margins of a loop."""

    stable: bool  # whether the closed loop's eigenvalues are within the unit circle
    gain: float  # factor by which the gain may grow [-]
    phase: float  # [rad]
    delay: float  # further dead time [s]
    disk: float  # factor by which gain may grow, and shrink by its inverse, at any phase within the disk; 1 for none
    sensitivity: float  # largest |1/(1 + L)|

    @property
    def text(self) -> str:
        """In a line."""
        return (
            f"gain {self.gain:.2f}, phase {math.degrees(self.phase):.0f} deg, delay {1e3 * self.delay:.1f} ms, "
            f"disk {self.disk:.2f}, sensitivity {self.sensitivity:.2f}"
        )


class Held(NamedTuple):
    """A linear model sampled: x⁺ = a x + b_late u(k − whole − 1) + b u(k − whole); motion = c x (d is none)."""

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
    sensed: int  # state that the position transducer shows, that behind its lag where it has one
    scales: Array


def held(model: LinearModel, delay: tuple[int, float], sample_time: float) -> Held:
    """A linear model under a command that is held and late, in states over their typical size."""
    s, (a, b, c) = state_scales()[list(model.states)], balanced(model)
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
    """The state when the next command begins to act, as `observer.law.seen_motion` carries it."""
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
    model : what the observer carries and predicts with.
    gains : (4,) of `observer.linear.kalman_gain`.
    per_acceleration : load pressure per acceleration, half its change [Pa s²/m].
    dt : sample time [s].
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


EXPECTED = 2e-3  # [m] position error about which the laws that are bent have the gain that they are designed for
STEEPEST, STEEPEST_AT = 0.763, 1.09  # of tanh(x)/√x, and its place
LARGE = 5.0  # times EXPECTED, from which sliding mode reaches the surface at its full rate
TWIST = 0.3  # share of the integral that the twisting term brings at EXPECTED
ADAPTATION = {  # of minimal control synthesis: slow, bounded, beside a fixed law that holds alone
    "adaptation_integral": 10.0,
    "adaptation_proportional": 0.02,
    "velocity_weight": 0.2,
    "leakage": 0.2,
    "gain_limit": 0.2,
    "model_damping": 0.9,
}


class Common(NamedTuple):
    """What all laws share: fields of `LawParameters`, and β of the table where its oil column is softest."""

    fields: Mapping[str, object]
    beta: ReducedParameters


def three_variable(f: Feedback, common: Common) -> ThreeVariable:
    """T = S: the law acts on the error alone, without an integral."""
    gains = {"displacement": f.position, "velocity": f.velocity, "acceleration": f.acceleration}
    both = {f"{side}_{name}": gain for side in ("reference", "feedback") for name, gain in gains.items()}
    return ThreeVariable(**common.fields, filter_frequency=0.0, filter_damping=0.7, **both)  # type: ignore[arg-type]


def sliding_mode(f: Feedback, common: Common) -> SlidingMode | None:
    """None where the polynomial has no real root."""
    b = common.beta
    wanted = [1.0, f.acceleration * b.beta3 - b.beta2, f.velocity * b.beta3 - b.beta1]
    roots = np.roots([*wanted, f.position * b.beta3, f.integral * b.beta3])
    real = np.flatnonzero(np.abs(roots.imag) < 1e-9 * np.abs(roots))
    if not real.size:
        return None
    place = real[np.argmax(np.abs(roots[real]))]
    rate = -float(roots[place].real)
    surface = np.poly(np.delete(roots, place)).real
    if rate <= 0.0 or np.any(surface < 0.0):
        return None
    largest = LARGE * EXPECTED * float(surface[2])
    return SlidingMode(
        **common.fields,  # type: ignore[arg-type]
        **vars(common.beta),
        surface_integral=float(surface[3]),
        surface_position=float(surface[2]),
        surface_velocity=float(surface[1]),
        surface_acceleration=1.0,
        reaching_gain=rate * largest,
        reaching_slope=1.0 / largest,
    )


def super_twisting(f: Feedback, common: Common) -> SuperTwisting | None:
    """None without a gain of the acceleration, which its surface needs."""
    if f.acceleration <= 0.0:
        return None
    beta3, weight = common.beta.beta3, f.acceleration / f.position
    steepest = weight * beta3 * f.position
    slope = STEEPEST_AT / EXPECTED
    return SuperTwisting(
        **common.fields,  # type: ignore[arg-type]
        beta3=beta3,
        surface_integral=f.integral / f.position,
        surface_position=1.0,
        surface_velocity=f.velocity / f.position,
        surface_acceleration=weight,
        root_gain=steepest / (STEEPEST * math.sqrt(slope)),
        root_slope=slope,
        twisting_gain=TWIST * steepest * (f.integral / f.position) * EXPECTED * math.pi / 4.0,
        feedforward_gain=common.beta.beta1 / beta3,
    )


def feedforward_pi(f: Feedback, common: Common) -> FeedforwardPI:
    """Without the acceleration."""
    ahead = -common.beta.beta1 / common.beta.beta3
    return FeedforwardPI(
        **common.fields,  # type: ignore[arg-type]
        proportional_gain=-f.position,
        integral_gain=-f.integral,
        feedforward_gain=ahead,
    )


def minimal_control_synthesis(f: Feedback, common: Common) -> MinimalControlSynthesis:
    """Slow adaptation beside the PI law; its reference model closes as fast as that does."""
    pi = feedforward_pi(f, common)
    return MinimalControlSynthesis(
        **common.fields,  # type: ignore[arg-type]
        strategy="inner",
        model_frequency=max(f.position / pi.feedforward_gain, 0.1),
        proportional_gain=pi.proportional_gain,
        integral_gain=pi.integral_gain,
        feedforward_gain=pi.feedforward_gain,
        **ADAPTATION,  # type: ignore[arg-type]
    )


LAWS: dict[str, Callable[[Feedback, Common], LawParameters | None]] = {
    "sliding_mode": sliding_mode,
    "super_twisting": super_twisting,
    "three_variable": three_variable,
    "minimal_control_synthesis": minimal_control_synthesis,
    "feedforward_pi": feedforward_pi,
}
WITHOUT_ACCELERATION = ("feedforward_pi", "minimal_control_synthesis")


def near_surface(kind: str, f: Feedback) -> Feedback:
    """The part of a state feedback that a law has."""
    return f._replace(integral=0.0) if kind == "three_variable" else f
