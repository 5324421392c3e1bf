"""What no listed effect explains, as a function estimated from recordings on equally spaced nodes.

    y(s) = linear between nodes y_0 … y_15 over low ≤ s ≤ high

Beyond its range a force of position goes on with the slope of its end, as a spring would; the others stay constant.

`kind` tells of what quantity s the function is and where it acts:

    1  force on the table [N] of position           −y(x)
    2  dry friction [N] of position                 −y(x) sign(v)
    3  force against motion [N] of velocity         −y(v)
    4  relative change of flow gain [-] of opening  C_v (1 + y(x_s*))
    5  flow across the piston [m³/s] of load pressure, added to the leakage
    6  relative change of stiffness [-] of load pressure  E (1 + y(P_L))
    7  relative change of flow gain [-] of time           C_v (1 + y(t))
    8  relative change of supply pressure [-] of the phase of a period high − low   P_s (1 + y(t mod T))
    9  relative change of all dry friction [-] of position, as where a seal presses harder  (1 + y(x))

Kinds 1 to 3 exist for a force-driven axis as well. The function of kind 8 is periodic. Time counts from the start of a
recording. Absent at kind 0. The search names it `unlisted` where the residual stands above the noise and no listed
effect explains it; the nodes are then the evidence of what a new law would have to say.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from shake_ros.core.compiled import njit
from shake_ros.core.effects.effect import Effect
from shake_ros.core.quantities import quantity

NODES = 16
FORCE_OF_POSITION = 1
FRICTION_OF_POSITION = 2
FORCE_OF_VELOCITY = 3
FLOW_GAIN_OF_OPENING = 4
LEAKAGE_OF_LOAD_PRESSURE = 5
STIFFNESS_OF_LOAD_PRESSURE = 6
FLOW_GAIN_OF_TIME = 7
SUPPLY_OF_PHASE = 8
FRICTION_FACTOR_OF_POSITION = 9


@dataclass(frozen=True)
class Unlisted(Effect):
    """An effect without a name: a function estimated on nodes."""

    place: ClassVar[str] = "force"
    depends_on: ClassVar[tuple[str, ...]] = ()
    models: ClassVar[tuple[str, ...]] = ("full", "axis")

    kind: int = quantity("-", "what the function is of and where it acts, 0 for absent", low=0, high=9, default=0)
    low: float = quantity("-", "argument at the first node, in its unit", default=-1.0)
    high: float = quantity("-", "argument at the last node, in its unit", default=1.0)
    node_00: float = quantity("-", "value at node 0, in the unit of the kind", default=0.0)
    node_01: float = quantity("-", "value at node 1, in the unit of the kind", default=0.0)
    node_02: float = quantity("-", "value at node 2, in the unit of the kind", default=0.0)
    node_03: float = quantity("-", "value at node 3, in the unit of the kind", default=0.0)
    node_04: float = quantity("-", "value at node 4, in the unit of the kind", default=0.0)
    node_05: float = quantity("-", "value at node 5, in the unit of the kind", default=0.0)
    node_06: float = quantity("-", "value at node 6, in the unit of the kind", default=0.0)
    node_07: float = quantity("-", "value at node 7, in the unit of the kind", default=0.0)
    node_08: float = quantity("-", "value at node 8, in the unit of the kind", default=0.0)
    node_09: float = quantity("-", "value at node 9, in the unit of the kind", default=0.0)
    node_10: float = quantity("-", "value at node 10, in the unit of the kind", default=0.0)
    node_11: float = quantity("-", "value at node 11, in the unit of the kind", default=0.0)
    node_12: float = quantity("-", "value at node 12, in the unit of the kind", default=0.0)
    node_13: float = quantity("-", "value at node 13, in the unit of the kind", default=0.0)
    node_14: float = quantity("-", "value at node 14, in the unit of the kind", default=0.0)
    node_15: float = quantity("-", "value at node 15, in the unit of the kind", default=0.0)


@njit
def interpolated(p, argument):
    """y at an argument, in the unit of the kind."""
    nodes = (
        p.unlisted_node_00,
        p.unlisted_node_01,
        p.unlisted_node_02,
        p.unlisted_node_03,
        p.unlisted_node_04,
        p.unlisted_node_05,
        p.unlisted_node_06,
        p.unlisted_node_07,
        p.unlisted_node_08,
        p.unlisted_node_09,
        p.unlisted_node_10,
        p.unlisted_node_11,
        p.unlisted_node_12,
        p.unlisted_node_13,
        p.unlisted_node_14,
        p.unlisted_node_15,
    )
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
def value(p, kind, argument):
    """y where this kind is present, else 0, in the unit of the kind."""
    return interpolated(p, argument) if p.unlisted_kind == kind else 0.0


@njit
def is_of_time(p):
    """Whether the function is one of time."""
    return p.unlisted_kind == FLOW_GAIN_OF_TIME or p.unlisted_kind == SUPPLY_OF_PHASE
