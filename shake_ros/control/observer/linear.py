"""Linear observer with a disturbance state.

The reduced model (6.36), advanced exactly, with d in its third line as a fourth state that wanders; the gain is the
steady state of the Kalman filter for the stated position noise and the stated unrest of jerk and disturbance.
The disturbance takes up what the reduced model lacks (null shift, friction, load, drift), so velocity and
acceleration are estimated without a steady error. Not in the thesis, where (6.38) is the only observer.

Verified against: the time-varying Riccati recursion.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from shake_ros.compiled import njit
from shake_ros.control.observer.law import ObserverParameters
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.physics.plant.reduced import ReducedParameters, transition
from shake_ros.quantities import quantity

GAINS = ("position_gain", "velocity_gain", "acceleration_gain", "disturbance_gain")


@dataclass(frozen=True)
class LinearObserver(ObserverParameters, ReducedParameters):
    """The reduced model's β and the noise levels that set the gain."""

    code: ClassVar[int] = 2
    derived: ClassVar[tuple[str, ...]] = GAINS

    position_noise: float = quantity("m", "standard deviation of a position sample, quantisation included", low=1e-9)
    jerk_noise: float = quantity("m/s^2.5", "density of the white jerk that the model lacks", low=1e-9)
    disturbance_noise: float = quantity("m/s^3.5", "density of the disturbance's random walk", low=1e-9)

    def derive(self, sample_time: float, model: TableParameters | None) -> dict[str, float]:
        """The gains on the innovation."""
        return dict(zip(GAINS, kalman_gain(self, sample_time).tolist(), strict=True))

    def started(
        self, estimate: NDArray[np.float64], command: float, sample_time: float, model: TableParameters | None
    ) -> NDArray[np.float64]:
        """Without a disturbance."""
        return np.append(estimate, 0.0)


def extended_transition(parameters: LinearObserver, sample_time: float) -> NDArray[np.float64]:
    """(4, 4) transition of (z_1, z_2, z_3, d) over one sample at u = 0."""
    phi, gamma = transition(parameters.beta1, parameters.beta2, sample_time)
    matrix = np.eye(4)
    matrix[:3, :3] = phi
    matrix[:3, 3] = gamma
    return matrix


def kalman_gain(parameters: LinearObserver, sample_time: float) -> NDArray[np.float64]:
    """(4,) steady gain on the position innovation."""
    from scipy.linalg import solve_discrete_are  # slow to import, and only this kind needs it

    matrix = extended_transition(parameters, sample_time)
    unrest = np.diag([0.0, 0.0, parameters.jerk_noise**2, parameters.disturbance_noise**2]) * sample_time
    noise = parameters.position_noise**2
    output = np.array([[1.0, 0.0, 0.0, 0.0]])
    scale = np.diag([1e-5, 1e-3, 1e-1, 1e1])  # orders of magnitude of the states, for the solver's sake
    back = np.linalg.inv(scale)
    covariance = scale @ solve_discrete_are(
        (back @ matrix @ scale).T, (output @ scale).T, back @ unrest @ back, np.array([[noise]])
    ) @ scale  # fmt: skip
    gain: NDArray[np.float64] = covariance[:, 0] / (covariance[0, 0] + noise)
    return gain


@njit
def observe(state, p, model, measured, command, dt, work, estimate):  # type: ignore[no-untyped-def]
    """One sample, in place; arguments as in `sliding_mode.observe`, with a (4,) state."""
    opening = abs(command)
    phi, gamma = transition(p.beta1 + p.beta5 * opening, p.beta2 + p.beta4 * opening, dt)
    jerk = p.beta3 * command + state[3]
    gains = (p.position_gain, p.velocity_gain, p.acceleration_gain)
    for i in range(3):
        estimate[i] = phi[i, 0] * state[0] + phi[i, 1] * state[1] + phi[i, 2] * state[2] + gamma[i] * jerk
    innovation = measured[0] - estimate[0]
    for i in range(3):
        estimate[i] += gains[i] * innovation
        state[i] = estimate[i]
    state[3] += p.disturbance_gain * innovation
