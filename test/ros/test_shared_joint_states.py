"""A topic that other robots write on as well, over DDS: no node takes their joints for the table's."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from rclpy.executors import SingleThreadedExecutor
from sensor_msgs.msg import JointState

from shake_ros.page.samples import ROW, Prediction, SampleStore
from shake_ros.ros import interface, observer_node, reference_node
from shake_ros.ros.conversions import SECOND, time_message
from shake_ros.ros.frame import Frame, Reader
from shake_ros.ros.loop import build_node, ros_context
from shake_ros.ros.page_node import SampleTap

COUNT, PERIOD, TIMEOUT = 60, 1_000_000, 60.0
ARGUMENTS = ["--ros-args", "-p", "lockstep:=true"]
STRANGERS = (
    (["crane"], [0.7]),
    (["arm_1", "arm_2"], [0.7, -0.7]),
    ([], [0.7]),
    (["crane", "table"], [0.7, None]),  # the table's own value behind another joint's
)


class Cell:
    """Observer, reference generator and the page's samples on a topic with a stranger, in one process."""

    def __init__(self, context: Any) -> None:
        self.nodes = [
            build_node(observer_node.build, "observer", context, [*ARGUMENTS, "-p", "observer:=linear_bergamo"]),
            build_node(reference_node.build, "reference_generator", context, ARGUMENTS),
        ]
        self.driver = Frame("driver", context, ARGUMENTS)
        qos = interface.JOINT_STATES.qos(True)
        self.stranger = self.driver.node.create_publisher(JointState, "joint_states", qos)
        self.positions = self.driver.writer(interface.JOINT_STATES)
        self.commands = self.driver.writer(interface.VALVE_COMMAND)
        self.came: dict[str, list[tuple[int, tuple[float, ...]]]] = {"estimate": [], "reference": []}
        for topic in (interface.ESTIMATE, interface.REFERENCE):
            Reader(self.driver, topic, lambda stamp, *v, name=topic.name: self.came[name].append((stamp, v)))
        self.store = SampleStore(PERIOD, Prediction(PERIOD / SECOND, None))
        self.tap = SampleTap(context, interface.NAMESPACE, self.store)
        self.executor = SingleThreadedExecutor(context=context)
        for node in (*(n.frame.node for n in self.nodes), self.driver.node):
            self.executor.add_node(node)
        writers = (
            self.stranger,
            self.positions.publisher,
            self.commands.publisher,
            *(n._writer.publisher for n in self.nodes),
        )
        self.until(lambda: all(w.get_subscription_count() >= n for w, n in zip(writers, (3, 3, 2, 1, 1), strict=True)))

    def until(self, condition: Callable[[], bool]) -> None:
        deadline = time.monotonic() + TIMEOUT
        while not condition():
            assert time.monotonic() < deadline
            self.executor.spin_once(timeout_sec=0.02)

    def play(self, strange: bool) -> None:
        """COUNT positions of 10 mm, each with a stranger's message before it, at the half period and at its stamp."""
        for k in range(COUNT):
            stamp = SECOND + k * PERIOD
            names, values = STRANGERS[k % len(STRANGERS)]
            own = None in values
            message = JointState(name=names, position=[0.01 if v is None else v for v in values])
            message.header.stamp = time_message(stamp if own or k % 2 else stamp - PERIOD // 2)
            if strange:
                self.stranger.publish(message)
            if not (strange and own):
                self.positions.send(stamp, 0.01)
            self.until(lambda k=k: all(len(rows) == k + 1 for rows in self.came.values()))
            self.commands.send(stamp, 0.0)
            self.tap.take()

    def close(self) -> None:
        self.tap.close()
        self.executor.shutdown()
        for frame in (*(n.frame for n in self.nodes), self.driver):
            frame.close()


@pytest.fixture
def cell(ros_domain: int) -> Iterator[Callable[[], Cell]]:
    cells: list[Cell] = []
    with ros_context([], domain_id=ros_domain) as context:

        def made() -> Cell:
            cells.append(Cell(context))
            return cells[-1]

        yield made
        for one in cells:
            one.close()


def test_joints_of_other_robots_are_never_the_tables_position(cell: Callable[[], Cell]) -> None:
    shared = cell()
    shared.play(strange=True)
    for name, rows in shared.came.items():
        assert [stamp for stamp, _ in rows] == [SECOND + k * PERIOD for k in range(COUNT)], name
    estimates = np.array([values for _, values in shared.came["estimate"]])
    assert np.abs(estimates[:, 0] - 0.01).max() < 1e-3  # 0.7 m of the stranger would show at once
    received = shared.nodes[0].frame.diagnostics.inputs["joint_states"]
    assert (received.received, received.others, received.refused, received.doubled) == (COUNT, COUNT * 3 // 4, 0, 0)
    shown = shared.store._rings[ROW["position"]]
    np.testing.assert_allclose(shown[np.isfinite(shown)], 0.01, rtol=1e-6)
    assert np.isfinite(shown).any()
