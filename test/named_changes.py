"""Changes as the twin names them, without the fits behind, and a twin that publishes the windows that it is given."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np

from shake_ros.twin.naming import Hypothesis, Named
from shake_ros.twin.twin import NO_MOTION, Change, TwinWindow

SECOND = 10**9


def hypothesis(name: str, place: str) -> Hypothesis:
    """A parameter that doubled."""
    nothing = np.zeros(0)
    return Hypothesis(name, name, place, "-", 1.0, 2.0, 0.1, 9.0, True, cast(Any, None), nothing, nothing)


LEAKAGE, SENSOR = hypothesis("leakage.internal", "flow"), hypothesis("sensor.gain", "sensor")


def change(*answers: Hypothesis, explained: bool = True) -> Change:
    """Of the best answer and its rivals."""
    best, *rivals = answers
    named = Named(best, tuple(rivals), best.place, explained, True, (0.03, 0.1, 0.03))
    return Change("run", 3.0, 3 * SECOND, 5 * SECOND, 8.0, named)


def twin_window(
    found: Change | None = None, note: str = "", start: int = 5 * SECOND, motion: np.ndarray = NO_MOTION
) -> TwinWindow:
    """Two seconds."""
    state = "paused" if note else "watching"
    value, deviation = np.array([1e-11]), np.array([1e-12])
    return TwinWindow("", 4.0, start, start + 2 * SECOND, state, note, value, deviation, deviation, 1.0, motion, found)


def idle_twin(context: Any) -> Any:
    """A node `twin` of one parameter that nothing comes in to; needs ROS."""
    from shake_ros.ros.frame import Frame
    from shake_ros.ros.twin_node import TwinNode

    remaps = [word for topic in ("joint_states", "imu", "valve_command") for word in ("-r", f"{topic}:=no/{topic}")]
    twin = TwinNode(Frame("twin", context, ["--ros-args", "-p", "table:=bergamo", *remaps]))
    twin.frame.diagnostics.inputs.clear()
    twin.twin = SimpleNamespace(names=("leakage.internal",), units=("m^3/(s*Pa)",))  # type: ignore[assignment]
    return twin
