"""Single messages, made by the type store alone, for recordings that our own writer would refuse to make."""

from __future__ import annotations

from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_typestore

STORE = get_typestore(Stores.ROS2_KILTED)
JOINT_STATE = "sensor_msgs/msg/JointState"


def header(stamp: int, frame: str = "table") -> Any:
    """A std_msgs/Header stamped in nanoseconds."""
    time = STORE.types["builtin_interfaces/msg/Time"](sec=stamp // 10**9, nanosec=stamp % 10**9)
    return STORE.types["std_msgs/msg/Header"](stamp=time, frame_id=frame)


def joint_state(stamp: int, positions: dict[str, float], frame: str = "table", little_endian: bool = True) -> bytes:
    """A serialised sensor_msgs/JointState."""
    empty = np.zeros(0)
    message = STORE.types[JOINT_STATE](
        header=header(stamp, frame),
        name=list(positions),
        position=np.array(list(positions.values()), dtype=np.float64),
        velocity=empty,
        effort=empty,
    )
    return bytes(STORE.serialize_cdr(message, JOINT_STATE, little_endian=little_endian))
