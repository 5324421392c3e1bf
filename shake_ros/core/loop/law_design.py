"""Gains of each law from one state feedback, so that all laws near their surface are the loop that has the margins.

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
from typing import NamedTuple

import numpy as np

from shake_ros.core.control.feedforward_pi import FeedforwardPI
from shake_ros.core.control.law import LawParameters
from shake_ros.core.control.minimal_control_synthesis import MinimalControlSynthesis
from shake_ros.core.control.sliding_mode import SlidingMode
from shake_ros.core.control.super_twisting import SuperTwisting
from shake_ros.core.control.three_variable import ThreeVariable
from shake_ros.core.loop.linear_loop import Feedback
from shake_ros.core.plant.reduced import ReducedParameters

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
