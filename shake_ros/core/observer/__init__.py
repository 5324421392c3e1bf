"""Observers: position measurement and command → position, velocity, acceleration.

One file per observer: a frozen `Parameters` class with the reduced model's β among its fields, `pack` (parameters →
float64 array, gains included), `initial_state` and a compiled `step`; `model` carries a whole table instead. To add
one: write the file, add it here and in `runner.KERNELS`, write config/observer/<name>.yaml; the contract tests run
over every entry.
"""

from shake_ros.core.observer.linear import LinearObserver
from shake_ros.core.observer.model import ModelObserver
from shake_ros.core.observer.sliding_mode import SlidingModeObserver

OBSERVERS = {
    "sliding_mode": SlidingModeObserver,
    "linear": LinearObserver,
    "model": ModelObserver,
}
