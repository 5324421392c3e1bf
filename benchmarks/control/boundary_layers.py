"""Boundary layers of config/observer/sliding_mode_tuned.yaml: python -m benchmarks.control.boundary_layers.

Prints the layers within which the sliding-mode observer with its λ acts as the Kalman filter of the table's β for a
white jerk of 9 m/s^2.5.
"""

from __future__ import annotations

import numpy as np

from shake_ros.core.observer.linear import LinearObserver, kalman_gain
from shake_ros.settings import load_variant

SAMPLE_TIME = 0.001
JERK_NOISE = 9.0  # [m/s^2.5]
DISTURBANCE_NOISE = 1e-3  # [m/s^3.5]: hardly any, the sliding-mode observer has no state for it
GAINS = (0.3, 20.0, 2000.0)  # λ [m/s], [m/s²], [m/s³]


def boundary_layers(jerk_noise: float, gains: tuple[float, float, float]) -> tuple[float, float, float]:
    """Boundary layers within which the sliding-mode observer with λ = `gains` has the Kalman filter's gain."""
    _, parameters = load_variant("observer", "linear_bergamo", {"linear": LinearObserver})
    changed = parameters.replace(jerk_noise=jerk_noise, disturbance_noise=DISTURBANCE_NOISE)
    first, second, third, _ = kalman_gain(changed, SAMPLE_TIME)
    lambda1, lambda2, lambda3 = gains
    return (
        lambda1 * SAMPLE_TIME * (1.0 / first - 1.0),
        lambda2 * (first / second - SAMPLE_TIME),
        lambda3 * (second / third - SAMPLE_TIME),
    )


def main() -> None:
    print(f"boundary layers {np.round(boundary_layers(JERK_NOISE, GAINS), 6)}")


if __name__ == "__main__":
    main()
