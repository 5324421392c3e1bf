"""What no listed effect explains, as a function estimated from recordings on equally spaced nodes.

    y(s) = linear between nodes y_0 … y_15 over low ≤ s ≤ high

Beyond its range a force of position goes on with the slope of its end, as a spring would; the others stay constant.

`kind` is the quantity s of the function and the place where it acts:

    1  force on the table [N] of position           −y(x)
    2  dry friction [N] of position                 −y(x) sign(v)
    3  force against motion [N] of velocity         −y(v)
    4  relative change of flow gain [-] of opening  C_v (1 + y(x_s*))
    5  flow across the piston [m³/s] of load pressure, added to the leakage
    6  relative change of stiffness [-] of load pressure  E (1 + y(P_L))
    7  relative change of flow gain [-] of time           C_v (1 + y(t))
    8  relative change of supply pressure [-] of the phase of a period high − low   P_s (1 + y(t mod T))
    9  relative change of all dry friction [-] of position, as where a seal presses harder  (1 + y(x))

A second quantity q (`second`; 0 for none) may change the function, with values a_0 … a_7 and b_0 … b_7 on nodes over
the same range of s:

    y(s, q) = y(s) + max(τ, 0) a(s) + max(−τ, 0) b(s),   τ = (q − middle)/(half the range of q), at most ±1

so y(s) is the function at the middle of the range of q, y + a the one at its upper end, y + b at its lower one. `PAIRS`
lists the second quantities that a kind can have; beside friction the velocity counts without its sign.

Kinds 1 to 3 exist for a force-driven axis as well. The function of kind 8 is periodic. Time counts from the start of a
recording. Absent at kind 0. The search names it `unlisted` where the residual stands above the noise and no listed
effect explains it; the nodes are then the evidence of what a new law would have to say.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from shake_ros.compiled import inlined_kernel, njit
from shake_ros.packing import written
from shake_ros.physics.effects.effect import Effect
from shake_ros.quantities import ShakeError, quantity

NODES = 16
CHANGES = 8  # nodes of each change by a second quantity
FORCE_OF_POSITION = 1
FRICTION_OF_POSITION = 2
FORCE_OF_VELOCITY = 3
FLOW_GAIN_OF_OPENING = 4
LEAKAGE_OF_LOAD_PRESSURE = 5
STIFFNESS_OF_LOAD_PRESSURE = 6
FLOW_GAIN_OF_TIME = 7
SUPPLY_OF_PHASE = 8
FRICTION_FACTOR_OF_POSITION = 9

NO_SECOND, POSITION, VELOCITY, VALVE_OPENING, LOAD_PRESSURE, TIME = range(6)
SECONDS: Mapping[int, str] = {  # quantity of each code of `second`
    POSITION: "position",
    VELOCITY: "velocity",
    VALVE_OPENING: "valve_opening",
    LOAD_PRESSURE: "load_pressure",
    TIME: "time",
}
PAIRS: Mapping[int, tuple[int, ...]] = {  # kind → second quantities that it can have, known where it acts
    FORCE_OF_POSITION: (VELOCITY, TIME),
    FRICTION_OF_POSITION: (VELOCITY, LOAD_PRESSURE, TIME),
    FORCE_OF_VELOCITY: (POSITION, LOAD_PRESSURE, TIME),
    FLOW_GAIN_OF_OPENING: (LOAD_PRESSURE, TIME),
    LEAKAGE_OF_LOAD_PRESSURE: (POSITION, TIME),
    STIFFNESS_OF_LOAD_PRESSURE: (POSITION, TIME),
    FLOW_GAIN_OF_TIME: (VALVE_OPENING, LOAD_PRESSURE),
    FRICTION_FACTOR_OF_POSITION: (VELOCITY, LOAD_PRESSURE, TIME),
}
OF_SPEED = (FRICTION_OF_POSITION, FRICTION_FACTOR_OF_POSITION)  # where the velocity counts without its sign


@dataclass(frozen=True)
class FunctionOnKnots(Effect):
    """What the function depends on, where it acts, and between which values it is known."""

    place: ClassVar[str] = "force"
    models: ClassVar[tuple[str, ...]] = ("full", "axis")

    kind: int = quantity("-", "what the function depends on and where it acts, 0 for absent", low=0, high=9, default=0)
    low: float = quantity("-", "argument at the first knot, in its unit", default=-1.0)
    high: float = quantity("-", "argument at the last knot, in its unit", default=1.0)
    second: int = quantity("-", "second quantity: 1 x, 2 v, 3 opening, 4 P_L, 5 time; 0 none", low=0, high=5, default=0)
    second_low: float = quantity("-", "second quantity at the lower end, in its unit", default=-1.0)
    second_high: float = quantity("-", "second quantity at the upper end, in its unit", default=1.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.kind and self.second and self.second not in PAIRS.get(self.kind, ()):
            known = ", ".join(str(code) for code in (NO_SECOND, *PAIRS.get(self.kind, ())))
            raise ShakeError(f"second = {self.second}: kind {self.kind} can have {known}")


KNOTS = {  # names of the function's values → what they are at each knot
    "node": [(f"node_{i:02d}", f"value at knot {i}") for i in range(NODES)],
    "above": [(f"above_{i}", f"change at knot {i} at the upper end") for i in range(CHANGES)],
    "below": [(f"below_{i}", f"change at knot {i} at the lower end") for i in range(CHANGES)],
}
Unlisted: type[FunctionOnKnots] = dataclasses.make_dataclass(
    "Unlisted",
    [
        (name, "float", quantity("-", f"{meaning}, in the unit of the kind", default=0.0))
        for knots in KNOTS.values()
        for name, meaning in knots
    ],
    bases=(FunctionOnKnots,),
    namespace={"__doc__": "An effect without a name: a function estimated on nodes.", "__module__": __name__},
    frozen=True,
)


def _tuple_of(values: str) -> Any:
    """Compiled: the values of a record on all knots, as a tuple."""
    fields = ", ".join(f"p.unlisted_{name}" for name, _ in KNOTS[values])
    return written(__name__, f"def {values}_values(p):\n    return {fields}", {})


node_values, above_values, below_values = _tuple_of("node"), _tuple_of("above"), _tuple_of("below")


@njit
def interpolated(p, argument):
    """y at an argument, in the unit of the kind."""
    nodes = node_values(p)
    place = (argument - p.unlisted_low) / (p.unlisted_high - p.unlisted_low) * (NODES - 1)
    if p.unlisted_kind == SUPPLY_OF_PHASE:
        place = (place / (NODES - 1) - math.floor(place / (NODES - 1))) * NODES
        i = int(place)
        return nodes[i % NODES] + (place - i) * (nodes[(i + 1) % NODES] - nodes[i % NODES])
    if p.unlisted_kind != FORCE_OF_POSITION:
        place = min(max(place, 0.0), NODES - 1.0)
    i = min(max(int(place), 0), NODES - 2)
    part = place - i
    return nodes[i] * (1.0 - part) + nodes[i + 1] * part


@njit
def second_argument(p, position, velocity, opening, pressure, clock):
    """The second quantity of the function, in its unit."""
    code = p.unlisted_second
    if code == POSITION:
        return position
    if code == VELOCITY:
        return velocity
    if code == VALVE_OPENING:
        return opening
    return pressure if code == LOAD_PRESSURE else clock


@njit
def changed_by(p, argument, second):
    """What the second quantity adds to y at an argument, in the unit of the kind."""
    tau = (second - 0.5 * (p.unlisted_second_low + p.unlisted_second_high)) / (
        0.5 * (p.unlisted_second_high - p.unlisted_second_low)
    )
    nodes = above_values(p) if tau > 0.0 else below_values(p)
    place = (argument - p.unlisted_low) / (p.unlisted_high - p.unlisted_low) * (CHANGES - 1)
    if p.unlisted_kind != FORCE_OF_POSITION:
        place = min(max(place, 0.0), CHANGES - 1.0)
    i = min(max(int(place), 0), CHANGES - 2)
    part = place - i
    return min(abs(tau), 1.0) * (nodes[i] * (1.0 - part) + nodes[i + 1] * part)


@njit
def of_both(p, argument, position, velocity, opening, pressure, clock):
    """y at an argument and at the second quantity, if there is one, in the unit of the kind."""
    y = interpolated(p, argument)
    if p.unlisted_second != NO_SECOND:
        y += changed_by(p, argument, second_argument(p, position, velocity, opening, pressure, clock))
    return y


@inlined_kernel
def value(p, kind, argument, position=0.0, velocity=0.0, opening=0.0, pressure=0.0, clock=0.0):
    """y where this kind is present, else 0, in the unit of the kind; with the quantities that PAIRS has for the kind.

    Inlined, for all but one kind are absent wherever it stands: a call each would take 4 % of a step.
    """
    return of_both(p, argument, position, velocity, opening, pressure, clock) if p.unlisted_kind == kind else 0.0


@njit
def is_of_time(p):
    """Whether the function is one of time."""
    return (
        p.unlisted_kind == FLOW_GAIN_OF_TIME
        or p.unlisted_kind == SUPPLY_OF_PHASE
        or (p.unlisted_kind != 0.0 and p.unlisted_second == TIME)
    )
