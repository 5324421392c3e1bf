"""Every node, built in this process with what it needs to start."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

from shake_ros.entry_points import NODES
from shake_ros.recordings.bags import BagWriter
from shake_ros.ros import interface
from shake_ros.ros.conversions import SECOND, codec
from shake_ros.ros.frame import Behaviour
from shake_ros.ros.loop import build_node


def small_recording(path: Path) -> Path:
    """One position."""
    writer = BagWriter(path, "", False)
    topic = writer.add_topic("/shake/joint_states", "sensor_msgs/msg/JointState", None)
    data = codec(interface.JOINT_STATES).encode(SECOND, (0.0,))
    assert isinstance(data, bytes)
    writer.write(topic, SECOND, data)
    writer.close()
    return path


def needed(name: str, folder: Path) -> list[str]:
    """ROS arguments without which a node does not start."""
    if name == "recorder":
        return ["-p", f"output:={folder / f'recorded_{len(list(folder.iterdir()))}'}"]
    if name == "page":
        return ["-p", "port:=0"]  # any
    if name == "player":
        path = folder / "to_play"
        return ["-p", f"input:={path if path.exists() else small_recording(path)}"]
    if name == "twin":
        return ["-p", "table:=bergamo"]
    return []


def built(name: str, context: Any, folder: Path, *arguments: str) -> Behaviour:
    """The node; what it needs comes first, so that `arguments` may say otherwise."""
    build = importlib.import_module(NODES[name].module).build
    return build_node(build, name, context, ["--ros-args", *needed(name, folder), *arguments])
