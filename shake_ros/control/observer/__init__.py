"""Observers: measurements and command → position, velocity, acceleration.

One file per observer: a frozen `ObserverParameters` class with its number, what it derives once (gains, say) and the
state that continues from an estimate, and a compiled `observe(state, p, model, measured, command, dt, work, estimate)`,
which changes the state in place; `p` is the record of the parameters by name, `model` that of the table which some of
them carry. To add one: write the file with the next number, add its row here, write config/observer/<name>.yaml;
`runner` and the contract tests take it from this table.
"""

from shake_ros.control.observer.fused import FusedObserver
from shake_ros.control.observer.law import ObserverParameters
from shake_ros.control.observer.linear import LinearObserver
from shake_ros.control.observer.model import ModelObserver
from shake_ros.control.observer.model_sliding_mode import ModelSlidingModeObserver
from shake_ros.control.observer.robust_exact_differentiator import RobustExactDifferentiator
from shake_ros.control.observer.sliding_mode import SlidingModeObserver

OBSERVERS: dict[str, type[ObserverParameters]] = {
    "sliding_mode": SlidingModeObserver,
    "linear": LinearObserver,
    "model": ModelObserver,
    "robust_exact_differentiator": RobustExactDifferentiator,
    "model_sliding_mode": ModelSlidingModeObserver,
    "fused": FusedObserver,
}
