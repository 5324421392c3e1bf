"""Three-variable control (5.1), (5.3), (5.4): u = T(s) x_ref − S(s) x̂.

T = K_dr + K_vr s + K_ar s² acts on the three variables of the input filter (5.1), which is driven by the position wish;
S = K_df + K_vf s + K_af s² acts on the observer's. `filter_frequency` of zero takes the reference's own three
variables. With x/u = β_3/(s (s² − β_2 s − β_1)) the loop's x/x_ref is flat to the second order where

    K_dr = K_df,  K_vr = K_vf − β_1/β_3 + K_df c_1,  K_ar = K_af − β_2/β_3 + (K_vf − β_1/β_3) c_1 + K_df c_2

with c_1 = 2 ξ_f/ω_f, c_2 = 1/ω_f² of the filter, zero without one (`matched`). Under a model feedforward T is S, so
that the law acts on the error alone, and the filter is out. Verified against: the difference equation by hand; the
frequency response of the reduced loop.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from shake_ros.compiled import njit
from shake_ros.control.laws.law import LawParameters, advance, moving, saturate
from shake_ros.quantities import quantity


@dataclass(frozen=True, kw_only=True)
class ThreeVariableGains(LawParameters):
    """Gains of (5.3), (5.4) and the input filter."""

    filter_frequency: float = quantity("rad/s", "ω_f of the input filter, 0 for none", low=0.0, high=2000.0, live=True)
    filter_damping: float = quantity("-", "ξ_f of the input filter", low=0.05, high=0.99, live=True)
    reference_displacement: float = quantity("1/m", "K_dr, command per reference position", low=0.0, live=True)
    reference_velocity: float = quantity("s/m", "K_vr, command per reference velocity", live=True)
    reference_acceleration: float = quantity("s^2/m", "K_ar, command per reference acceleration", live=True)
    feedback_displacement: float = quantity("1/m", "K_df, minus the command per position", low=0.0, live=True)
    feedback_velocity: float = quantity("s/m", "K_vf, minus the command per velocity", live=True)
    feedback_acceleration: float = quantity("s^2/m", "K_af, minus the command per acceleration", live=True)

    def under_model(self) -> ThreeVariableGains:
        """T = S and no filter: the law acts on the error alone."""
        return self.replace(
            filter_frequency=0.0,
            reference_displacement=self.feedback_displacement,
            reference_velocity=self.feedback_velocity,
            reference_acceleration=self.feedback_acceleration,
        )


@dataclass(frozen=True, kw_only=True)
class ThreeVariable(ThreeVariableGains):
    """The law by itself."""

    code: ClassVar[int] = 6
    states: ClassVar[int] = 4


def matched(parameters: ThreeVariable, beta: NDArray[np.float64]) -> ThreeVariable:
    """The parameters with K_dr, K_vr, K_ar for a loop that is flat to the second order; β_1, β_2, β_3 lead `beta`."""
    p = parameters
    first, second = 0.0, 0.0
    if p.filter_frequency > 0.0:
        first, second = 2.0 * p.filter_damping / p.filter_frequency, 1.0 / p.filter_frequency**2
    velocity = p.feedback_velocity - float(beta[0] / beta[2])
    acceleration = p.feedback_acceleration - float(beta[1] / beta[2])
    return p.replace(
        reference_displacement=p.feedback_displacement,
        reference_velocity=velocity + p.feedback_displacement * first,
        reference_acceleration=acceleration + velocity * first + p.feedback_displacement * second,
    )


@njit
def step(state, p, reference, estimate, feedforward, dt):  # type: ignore[no-untyped-def]
    """One sample; as in `feedforward_pi.step`, state (started, wish [m], filter's x [m] and ẋ [m/s])."""
    x, v, a = reference[0], reference[1], reference[2]
    if p.filter_frequency > 0.0:
        if state[0] != 0.0:
            x, v, a = advance(
                state[2], state[3], state[1], reference[0], p.filter_frequency, p.filter_damping, dt
            )  # (5.1)
        else:
            x, v, a = moving(reference, p.filter_frequency, p.filter_damping)
    there = p.reference_displacement * x + p.reference_velocity * v + p.reference_acceleration * a  # (5.3)
    back = p.feedback_displacement * estimate[0] + p.feedback_velocity * estimate[1]
    back = back + p.feedback_acceleration * estimate[2]  # (5.4)
    following = np.empty(4)
    following[0], following[1], following[2], following[3] = 1.0, reference[0], x, v
    return following, saturate(there - back + feedforward, p.limit)
