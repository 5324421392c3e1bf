"""Controllers: reference and estimate → valve command.

One file per law: a frozen `Parameters` class, `STATES`, `pack` (parameters → float64 array) and two compiled
functions, `feedforward(parameters, reference)` and `step(state, parameters, reference, estimate, feedforward, dt)`.
The feedforward is an argument of `step`, so that any law also runs under that of a virtual table
(`virtual_table`). To add one: write the file, give it the next `CODE`, add it here, in
`runner.KERNELS` and in `selected`, write config/controller/<name>.yaml; the contract tests run over every entry.
"""

from shake_ros.core.control.feedforward_pi import FeedforwardPI
from shake_ros.core.control.hold import Hold
from shake_ros.core.control.minimal_control_synthesis import MinimalControlSynthesis
from shake_ros.core.control.pid import PID
from shake_ros.core.control.sliding_mode import SlidingMode
from shake_ros.core.control.super_twisting import SuperTwisting
from shake_ros.core.control.super_twisting_implicit import SuperTwistingImplicit
from shake_ros.core.control.three_variable import ThreeVariable

CONTROLLERS = {
    "none": Hold,
    "feedforward_pi": FeedforwardPI,
    "sliding_mode": SlidingMode,
    "super_twisting": SuperTwisting,
    "pid": PID,
    "super_twisting_implicit": SuperTwistingImplicit,
    "three_variable": ThreeVariable,
    "minimal_control_synthesis": MinimalControlSynthesis,
}
