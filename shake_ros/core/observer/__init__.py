"""Observers: position measurement and command → position, velocity, acceleration.

One file per observer: `CODE`, a frozen `Parameters` class, `pack` (parameters → float64 array, gains included),
`started` (the state that continues from an estimate) and a compiled `observe`, which changes the state in place. Those
of `runner.CARRYING` carry a whole table besides. To add one: write the file, add it here, in `runner.KERNELS` and in
`selected.step_observer`, write config/observer/<name>.yaml; the contract tests run over every entry.
"""

from shake_ros.core.observer.linear import LinearObserver
from shake_ros.core.observer.model import ModelObserver
from shake_ros.core.observer.model_sliding_mode import ModelSlidingModeObserver
from shake_ros.core.observer.robust_exact_differentiator import RobustExactDifferentiator
from shake_ros.core.observer.sliding_mode import SlidingModeObserver

OBSERVERS = {
    "sliding_mode": SlidingModeObserver,
    "linear": LinearObserver,
    "model": ModelObserver,
    "robust_exact_differentiator": RobustExactDifferentiator,
    "model_sliding_mode": ModelSlidingModeObserver,
}
