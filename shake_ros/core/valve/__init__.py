"""Servo-valve: spool dynamics and port flows. Two models behind one interface: command and supply in, spool out.

To add one: write its file (parameters, its number, kernels), add its row here, and its branch in
plant/integration.py.
"""

from __future__ import annotations

from shake_ros.core.quantities import Parameters
from shake_ros.core.valve.detailed import DetailedValve
from shake_ros.core.valve.simplified import SimplifiedValve

VALVES: dict[str, type[Parameters]] = {"simplified": SimplifiedValve, "detailed": DetailedValve}
