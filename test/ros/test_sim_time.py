"""`use_sim_time`: /clock drives what has no clock of its own."""

from __future__ import annotations

import time
from pathlib import Path

import pytest
from every_node import built
from rclpy.executors import SingleThreadedExecutor

from shake_ros.quantities import ShakeError
from shake_ros.ros import interface
from shake_ros.ros.conversions import SECOND, time_message
from shake_ros.ros.frame import Frame
from shake_ros.ros.loop import ros_context

MS = 1_000_000
START = 5 * SECOND


def clock(stamp: int) -> object:
    return interface.CLOCK.type(clock=time_message(stamp))


def test_reference_keeps_the_time_of_the_clock_whatever_its_rate(ros_domain, tmp_path) -> None:
    with ros_context([], domain_id=ros_domain) as context:
        node = built("reference_generator", context, tmp_path, "-p", "use_sim_time:=true", "-p", "reference:=none")
        ticks: list[tuple[int, int]] = []
        node.frame.follow_clock(lambda stamp, steps: ticks.append((stamp, steps)))
        heard = list(node.frame.node.subscriptions)[-1].callback
        for stamp in (START, START + 5 * MS, START + 5 * MS, START + 5 * MS + 400_000, START + 12 * MS + 700_000):
            heard(clock(stamp))
        assert ticks == [(START, 1), (START + 5 * MS, 5), (START + 12 * MS, 7)]
        heard(clock(START + MS))  # a recording begins again
        heard(clock(START + 3 * MS))
        assert ticks[3:] == [(START + MS, 1), (START + 3 * MS, 2)]
        node.frame.close()


def test_stamps_and_times_of_receipt_are_those_of_the_clock(ros_domain, tmp_path) -> None:
    with ros_context([], domain_id=ros_domain) as context:
        node = built("recorder", context, tmp_path, "-p", "use_sim_time:=true")
        writer = Frame("writer", context, ["--ros-args"]).writer(interface.CLOCK)
        executor = SingleThreadedExecutor(context=context)
        executor.add_node(node.frame.node)
        deadline = time.monotonic() + 30.0
        while node.frame.now() != START + 3 * MS:
            assert time.monotonic() < deadline
            writer.send(START + 3 * MS)
            executor.spin_once(timeout_sec=0.02)
        assert node.receipt(0) == START + 3 * MS  # type: ignore[attr-defined]
        executor.shutdown()
        node.finish()
        node.frame.close()


def test_a_real_table_keeps_its_own_time(ros_domain, tmp_path: Path) -> None:
    with ros_context([], domain_id=ros_domain) as context, pytest.raises(ShakeError, match="the time of its own"):
        built("hardware_bridge", context, tmp_path, "-p", "use_sim_time:=true")
