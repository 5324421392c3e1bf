"""Controllers: reference and estimate → valve command.

One file per law: a frozen `Parameters` class with its number and the length of its state, and two compiled functions,
`feedforward(p, reference)`, zero where a law has none, and `step(state, p, reference, estimate, feedforward, dt)`; `p`
is the record of the parameters by name. The feedforward is an argument of `step`, so that any law also runs under that
of a virtual table (`virtual_table`). To add one: write the file with the next number, add its row here, write
config/controller/<name>.yaml; `runner` and the contract tests take it from this table.
"""

from shake_ros.control.laws.differential_pressure import DifferentialPressure
from shake_ros.control.laws.feedforward_minimal_control import FeedforwardMinimalControl
from shake_ros.control.laws.feedforward_pi import FeedforwardPI
from shake_ros.control.laws.law import Hold, LawParameters
from shake_ros.control.laws.linear_quadratic import LinearQuadratic
from shake_ros.control.laws.minimal_control_synthesis import MinimalControlSynthesis
from shake_ros.control.laws.pid import PID
from shake_ros.control.laws.reaction_compensation import ReactionCompensation
from shake_ros.control.laws.sliding_mode import SlidingMode
from shake_ros.control.laws.super_twisting import SuperTwisting
from shake_ros.control.laws.super_twisting_implicit import SuperTwistingImplicit
from shake_ros.control.laws.three_variable import ThreeVariable

CONTROLLERS: dict[str, type[LawParameters]] = {
    "none": Hold,
    "feedforward_pi": FeedforwardPI,
    "sliding_mode": SlidingMode,
    "super_twisting": SuperTwisting,
    "pid": PID,
    "super_twisting_implicit": SuperTwistingImplicit,
    "three_variable": ThreeVariable,
    "minimal_control_synthesis": MinimalControlSynthesis,
    "linear_quadratic": LinearQuadratic,
    "differential_pressure": DifferentialPressure,
    "feedforward_minimal_control": FeedforwardMinimalControl,
    "reaction_compensation": ReactionCompensation,
}
