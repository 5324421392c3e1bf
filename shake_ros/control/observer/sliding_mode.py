"""Sliding-mode observer with hierarchical injection (5.48, 5.49, 6.38, 6.39).

ẑ_1' = ẑ_2 + λ_1 sgn(z̃_1), ẑ_2' = ẑ_3 + λ_2 sgn(z̃_2), ẑ_3' = model + λ_3 sgn(z̃_3), where a stage's error is the
equivalent injection of the stage before and a stage is fed only once the stages before have reached their surface.

Discretisation: the model is advanced exactly under the held command (`physics.plant.reduced`), then each sign is solved
implicitly: ẑ⁺ = ẑ⁻ + dt λ s with s ∈ Sgn(ε − dt λ s) has the one solution s = clip(ε/(dt λ), −1, 1). A stage with
|s| < 1 has reached its surface within this sample (E_i = 1) and s is its equivalent injection, so no chatter is made.
A boundary layer δ turns the sign into clip(·/δ), solved implicitly as well: s = clip(ε/(dt λ + δ), −1, 1).
With all three δ = 0 this is the thesis's observer; with δ > 0 measurement noise is averaged within the layer.

Range of validity: |velocity error| < λ_1, else the first surface is left and the position estimate follows the
measurement at λ_1 only. Verified against: a finely stepped explicit solution of (6.38).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from shake_ros.compiled import njit
from shake_ros.control.observer.law import ObserverParameters
from shake_ros.physics.plant.reduced import ReducedParameters, advance
from shake_ros.quantities import quantity

STATES = 3


@dataclass(frozen=True)
class SlidingModeObserver(ObserverParameters, ReducedParameters):
    """The reduced model's β and the gains of (6.39)."""

    code: ClassVar[int] = 1

    lambda1: float = quantity("m/s", "injection into the position's rate", low=1e-9)
    lambda2: float = quantity("m/s^2", "injection into the velocity's rate", low=1e-9)
    lambda3: float = quantity("m/s^3", "injection into the acceleration's rate", low=1e-9)
    boundary1: float = quantity("m", "boundary layer of the position error, 0 for a sign", low=0.0)
    boundary2: float = quantity("m/s", "boundary layer of the velocity error, 0 for a sign", low=0.0)
    boundary3: float = quantity("m/s^2", "boundary layer of the acceleration error, 0 for a sign", low=0.0)


@njit
def injection(error, gain, boundary, dt):  # type: ignore[no-untyped-def]
    """s ∈ [−1, 1], the implicit solution of a stage's sign; |s| < 1 is on the surface."""
    return max(-1.0, min(1.0, error / (gain * dt + boundary)))


@njit
def observe(state, p, model, measured, command, dt, work, estimate):  # type: ignore[no-untyped-def]
    """One sample, in place.

    Parameters
    ----------
    state : (3,) array, estimate at the sample before; becomes that of now
    p : record of the observer
    model : record of the table that an observer may carry
    measured : now; position [m], acceleration [m/s²], P_A, P_B [Pa], NaN where there is no such sensor
    command : u held since the sample before [-]
    dt : sample time [s]
    work : from `law.work`
    estimate : (3,) array for the result: position [m], velocity [m/s], acceleration [m/s²] now
    """
    following = advance(state, p, command, 0.0, dt)
    gain1, gain2, gain3 = p.lambda1, p.lambda2, p.lambda3
    # (5.48), first stage
    s = injection(measured[0] - following[0], gain1, p.boundary1, dt)
    following[0] += dt * gain1 * s
    if abs(s) < 1.0:  # E_2: z̃_2 − ẑ_2 = λ_1 s (5.49)
        s = injection(gain1 * s, gain2, p.boundary2, dt)
        following[1] += dt * gain2 * s
        if abs(s) < 1.0:  # E_3: z̃_3 − ẑ_3 = λ_2 s
            s = injection(gain2 * s, gain3, p.boundary3, dt)
            following[2] += dt * gain3 * s
    for i in range(STATES):
        state[i] = following[i]
        estimate[i] = following[i]
