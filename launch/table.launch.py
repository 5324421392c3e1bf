"""`ros2 launch shake_ros table.launch.py`: table, observer, controller and reference in real time.

    ros2 launch shake_ros table.launch.py reference:=sine_20mm_2hz record:=run1
    ros2 launch shake_ros table.launch.py bridge:=emulator        # a real table, or its emulator, in the plant's place

Nothing needs it: each node runs by `ros2 run shake_ros NAME` as well.
"""

from __future__ import annotations

from pathlib import Path

from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition, UnlessCondition
from launch.substitutions import LaunchConfiguration, PythonExpression
from launch_ros.actions import Node

from launch import LaunchDescription

ARGUMENTS = {
    "namespace": ("shake", "of all nodes"),
    "table": ("bergamo", "configuration of the simulated table"),
    "bridge": ("", "configuration of a real table; empty: the simulated one"),
    "reference": ("earthquake", "configuration of the reference"),
    "observer": ("sliding_mode", "configuration of the observer"),
    "controller": ("super_twisting", "configuration of the controller"),
    "record": ("", "folder of a recording; empty: none"),
    "view": ("false", "true: robot_state_publisher beside it, for RViz and Foxglove"),
}


def node(executable: str, parameters: dict[str, str], condition: object = None) -> Node:
    """One node; its parameters name arguments of this file."""
    given = {name: LaunchConfiguration(argument) for name, argument in parameters.items()}
    return Node(
        package="shake_ros",
        executable=executable,
        namespace=LaunchConfiguration("namespace"),
        parameters=[given],
        condition=condition,
        output="screen",
        sigterm_timeout="30",  # [s]; a busy machine takes its time to leave the graph, and a recording is to be closed
    )


def empty(argument: str) -> PythonExpression:
    """Whether an argument is."""
    return PythonExpression(["'", LaunchConfiguration(argument), "' == ''"])


def view() -> Node:
    """What turns `joint_states` into transforms, where ROS 2 has it installed."""
    description = Path(__file__).resolve().parents[1] / "config" / "description" / "shaking_table.urdf"
    return Node(
        package="robot_state_publisher",
        executable="robot_state_publisher",
        namespace=LaunchConfiguration("namespace"),
        parameters=[{"robot_description": description.read_text(encoding="utf-8")}],
        condition=IfCondition(LaunchConfiguration("view")),
        output="screen",
    )


def generate_launch_description() -> LaunchDescription:
    """The graph."""
    arguments = [
        DeclareLaunchArgument(name, default_value=value, description=meaning)
        for name, (value, meaning) in ARGUMENTS.items()
    ]
    return LaunchDescription(
        [
            *arguments,
            node("plant", {"table": "table"}, IfCondition(empty("bridge"))),
            node("hardware_bridge", {"bridge": "bridge"}, UnlessCondition(empty("bridge"))),
            node("reference_generator", {"reference": "reference"}),
            node("observer", {"observer": "observer"}),
            node("controller", {"controller": "controller"}),
            node("thd_analyzer", {}),
            node("recorder", {"output": "record"}, UnlessCondition(empty("record"))),
            view(),
        ]
    )
