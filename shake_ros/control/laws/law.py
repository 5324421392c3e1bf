"""What control laws share: limit, start, model feedforward, saturation, and the input filter (5.1); and no law at all.

The input filter (5.1) sample by sample: ẍ + 2ξ_f ω_f ẋ + ω_f² x = ω_f² r, exact for a wish that runs straight.

With r = r_0 + ṙ t a particular solution is x = r − 2ξ_f ṙ/ω_f, ẋ = ṙ; what is left decays freely.
Verified against: `control.reference.filter`, which takes the matrix exponential.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from shake_ros.compiled import njit
from shake_ros.quantities import Parameters, choice, quantity


@dataclass(frozen=True, kw_only=True)
class LawParameters(Parameters):
    """Fields of every controller.

    `model` names the table configuration whose virtual copy makes the feedforward (`virtual_table`); empty for the
    law's own feedforward from the reference. With `predict` the virtual table runs ahead by the whole dead time, and so
    must the observer; without a model there is nothing to predict with. `flow_asymmetry` is that of a cylinder with
    unequal areas (`plant.reduced.closed_form`): the command is divided by the velocity that it gives in its direction;
    a model feedforward knows the cylinder, so it counts for nothing there.
    """

    code: ClassVar[int]  # number by which compiled code knows the law
    states: ClassVar[int]  # length of its own state

    limit: float = quantity("-", "largest magnitude of the command", low=0.0, high=1.0)
    start_time: float = quantity("s", "time constant of the bumpless start, 0 for none", low=0.0, high=10.0)
    model: str = choice("table configuration for the model feedforward, empty for none", default="", live=True)
    model_bandwidth: float = quantity("rad/s", "bandwidth of the virtual table's control", low=1.0, high=2000.0)
    model_horizon: float = quantity("s", "horizon of the virtual table's control", low=1e-4, high=0.1)
    model_rate: float = quantity("1/s", "largest rate of the virtual table's command", low=1.0, high=1e5, default=1e5)
    loop_delay: float = quantity("s", "dead time of the feedback beyond the model's", low=0.0, high=0.1, default=0.0)
    flow_asymmetry: float = quantity(
        "-",
        "excess of the steady velocity along +x over the mean",
        low=-0.9,
        high=0.9,
        default=0.0,
        live=True,
    )
    predict: bool = choice(
        "whether estimate and virtual table are predicted to the instant at which the command acts", default=False
    )

    def under_model(self) -> LawParameters:
        """The parameters under a model feedforward, which brings what the law then has to leave out."""
        return self


@dataclass(frozen=True, kw_only=True)
class Hold(LawParameters):
    """No control: the command is held at zero, and a model feedforward, where one is asked for, passes through."""

    code: ClassVar[int] = 0
    states: ClassVar[int] = 0


@njit
def feedforward(p, reference):  # type: ignore[no-untyped-def]
    """Zero: that of every law without one of its own [-]."""
    return 0.0


@njit
def step(state, p, reference, estimate, feedforward, dt):  # type: ignore[no-untyped-def]
    """One sample of `Hold`; arguments and results as in `feedforward_pi.step`."""
    return state.copy(), saturate(feedforward, p.limit)


@njit
def saturate(command, limit):  # type: ignore[no-untyped-def]
    """The command within ±limit; NaN stays NaN.

    >>> float(saturate(1.4, 0.9)), float(saturate(-0.2, 0.9))
    (0.9, -0.2)
    """
    if command > limit:
        return limit
    if command < -limit:
        return -limit
    return command


@njit
def with_direction(command, asymmetry):  # type: ignore[no-untyped-def]
    """The velocity that a command gives relative to the mean of both directions.

    >>> float(with_direction(0.5, 0.2)), float(with_direction(-0.5, 0.2))
    (0.6, -0.4)
    """
    return command * (1.0 + asymmetry) if command > 0.0 else command * (1.0 - asymmetry)


@njit
def against_direction(command, asymmetry):  # type: ignore[no-untyped-def]
    """The command that gives this velocity relative to the mean: the inverse of `with_direction`.

    >>> round(float(against_direction(0.6, 0.2)), 12), round(float(against_direction(-0.4, 0.2)), 12)
    (0.5, -0.5)
    """
    return command / (1.0 + asymmetry) if command > 0.0 else command / (1.0 - asymmetry)


@njit
def winds_up(command, limit, push):  # type: ignore[no-untyped-def]
    """Whether an integrator that pushes the command by `push` must stop: saturated, and pushing further.

    >>> bool(winds_up(1.2, 1.0, 0.1)), bool(winds_up(1.2, 1.0, -0.1)), bool(winds_up(0.5, 1.0, 0.1))
    (True, False, False)
    """
    return abs(command) > limit and command * push > 0.0


@njit
def free_motion(x, v, frequency, damping, dt):  # type: ignore[no-untyped-def]
    """(x, ẋ) after `dt` of ẍ + 2ξω ẋ + ω² x = 0, ξ < 1."""
    decay, damped = damping * frequency, frequency * math.sqrt(1.0 - damping * damping)
    c, s = math.cos(damped * dt), math.sin(damped * dt) / damped
    fade = math.exp(-decay * dt)
    return fade * (x * c + (v + decay * x) * s), fade * (v * c - (frequency**2 * x + decay * v) * s)


@njit
def advance(x, v, wish_before, wish, frequency, damping, dt):  # type: ignore[no-untyped-def]
    """(x, ẋ, ẍ)_ref after a sample in which the wish ran straight from `wish_before` to `wish` [m]."""
    slope = (wish - wish_before) / dt
    lag = 2.0 * damping * slope / frequency
    x, v = free_motion(x - wish_before + lag, v - slope, frequency, damping, dt)
    x, v = x + wish - lag, v + slope
    return x, v, frequency**2 * (wish - x) - 2.0 * damping * frequency * v  # (5.1)


@njit
def moving(reference, frequency, damping):  # type: ignore[no-untyped-def]
    """(x, ẋ, ẍ)_ref of a filter that has followed the reference for long, its acceleration being constant."""
    lag, spread = 2.0 * damping / frequency, 1.0 / frequency**2
    x, v, a = reference[0], reference[1], reference[2]
    return x - lag * v + (lag * lag - spread) * a, v - lag * a, a
