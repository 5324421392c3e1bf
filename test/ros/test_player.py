"""The player over DDS: what was recorded comes again, in its rhythm, faster or slower, in part or in a loop."""

from __future__ import annotations

import time

import numpy as np
import pytest
from machine_time import on_a_machine_that_keeps_time
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu, JointState

from shake_ros.quantities import ShakeError
from shake_ros.recordings.bags import write_table_recording
from shake_ros.ros import interface, player_node
from shake_ros.ros.loop import build_node, ros_context

from .recording_processes import own_node, process, spin_until

COUNT = 101  # samples every 10 ms: one second


@pytest.fixture
def bag(tmp_path):
    k = np.arange(COUNT)
    return write_table_recording(tmp_path / "bag", 0.01 * k, 0.001 * k, 0.01 * k, -0.1 * k)


class Ear:
    """Messages of one topic with the times at which they came."""

    def __init__(self, node, kind, topic):
        self.messages, self.times = [], []
        node.create_subscription(kind, topic, self._hear, interface.REALTIME_QOS)

    def _hear(self, message):
        self.messages.append(message)
        self.times.append(time.monotonic())

    @property
    def positions(self):
        return np.array([message.position[0] for message in self.messages])


def play(node, bag, until, **options):
    """Run the player beside the node until the condition holds and the player has ended by itself."""
    waits = options.pop("waits", "joint_states:1")
    with process("player", input=str(bag), wait_for=waits, **options) as player:
        spin_until(node, until, "messages of the player")
        if not options.get("loop"):
            assert player.wait(20) == 0


@pytest.mark.second_tier
@on_a_machine_that_keeps_time
def test_every_message_comes_again_in_its_rhythm(ros_domain, bag):
    with own_node(ros_domain) as node:
        ear = Ear(node, JointState, "joint_states")
        play(node, bag, lambda: len(ear.messages) >= COUNT)
    assert np.array_equal(ear.positions, 0.01 * np.arange(COUNT))
    stamps = [message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec for message in ear.messages]
    assert np.allclose(stamps, 1.0 + 0.01 * np.arange(COUNT))
    assert 0.85 < ear.times[-1] - ear.times[0] < 1.5


@pytest.mark.second_tier
@on_a_machine_that_keeps_time
def test_speed_offset_topic_and_clock_are_options(ros_domain, bag):
    with own_node(ros_domain) as node:
        imu, state = Ear(node, Imu, "imu"), Ear(node, JointState, "joint_states")
        clock = Ear(node, Clock, "/clock")
        options = {"speed": 0.5, "start_offset": 0.5, "topics": "imu", "clock_rate": 100.0, "waits": "imu:1 /clock:1"}
        play(node, bag, lambda: len(imu.messages) >= 51, **options)
    assert [message.linear_acceleration.x for message in imu.messages] == list(-0.1 * np.arange(50, COUNT))
    assert 0.85 < imu.times[-1] - imu.times[0] < 1.6
    assert state.messages == []
    times = [message.clock.sec + 1e-9 * message.clock.nanosec for message in clock.messages]
    assert len(times) > 40
    assert np.allclose(np.diff(times), 0.01)
    assert times[-1] <= 2.0 + 1e-9


def test_a_loop_starts_again_until_it_is_stopped(ros_domain, bag):
    with own_node(ros_domain) as node:
        ear = Ear(node, JointState, "joint_states")
        play(node, bag, lambda: len(ear.messages) > 2.5 * COUNT, speed=10.0, loop=True)
    expected = np.tile(0.01 * np.arange(COUNT), 3)
    assert np.array_equal(ear.positions, expected[: len(ear.positions)])


def test_topics_can_be_remapped(ros_domain, bag):
    with own_node(ros_domain) as node:
        ear = Ear(node, JointState, "/again/joint_states")
        remaps = ("/shake/joint_states:=/again/joint_states",)
        play(node, bag, lambda: len(ear.messages) >= 10, remaps=remaps, waits="", loop=True)


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ("", "parameter input"),
        ("input:={bag} topics:=gyro", "unknown topic 'gyro'.*known: /shake/imu"),
        ("input:={bag}_gone", "no such recording"),
        ("input:={bag} speed:=0.0", "speed"),
    ],
)
def test_what_cannot_be_played_is_one_line(ros_domain, bag, parameters, words):
    arguments = ["--ros-args"]
    for one in parameters.format(bag=bag).split():
        arguments += ["-p", one]
    with ros_context([], domain_id=ros_domain) as context, pytest.raises(ShakeError, match=words):
        build_node(player_node.build, "player", context, arguments)
