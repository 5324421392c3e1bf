"""The reference's node: everything about the program is live, and no change makes a jump."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from rclpy.parameter import Parameter

from shake_ros.ros.conversions import SECOND
from shake_ros.ros.loop import build_node, ros_context
from shake_ros.ros.reference_node import ReferenceGenerator, build

DT = 0.001


class Player:
    """The node in lock-step, fed with one measurement after the other."""

    def __init__(self, node: ReferenceGenerator) -> None:
        self.node = node
        self.k = 0
        self.sent: list[tuple[float, ...]] = []
        node._writer.send = lambda _, *values: self.sent.append(values)  # type: ignore[method-assign]

    def play(self, seconds: float) -> np.ndarray:
        """The samples of that time, (n, 3)."""
        first = len(self.sent)
        for _ in range(round(seconds / DT)):
            self.node._on_measured(SECOND + round(self.k * DT * SECOND), 0.0)
            self.k += 1
        return np.array(self.sent[first:])

    def set(self, **values: Any) -> None:
        for name, value in values.items():
            result = self.node.frame.node.set_parameters([Parameter(name.replace("__", "."), value=value)])[0]
            assert result.successful, result.reason

    def smooth(self) -> None:
        """Position, velocity and acceleration belong together all the time."""
        x, v, a = np.array(self.sent).T
        assert np.abs(np.diff(x) / DT - 0.5 * (v[1:] + v[:-1])).max() < 2e-3
        assert np.abs(np.diff(x)).max() < 1.5e-3
        assert np.isfinite(a).all()


@pytest.fixture
def player(ros_domain) -> Iterator[Player]:
    arguments = ["--ros-args", "-p", "lockstep:=true", "-p", "reference:=sine_20mm_2hz", "-p", "duration:=4.0"]
    with ros_context([], domain_id=ros_domain) as context:
        node = build_node(build, "reference_generator", context, arguments)
        assert isinstance(node, ReferenceGenerator)
        yield Player(node)
        node.frame.close()


def test_amplitude_and_frequency_change_while_it_plays(player) -> None:
    player.play(1.5)
    player.set(amplitude=0.03)
    assert np.abs(player.play(1.4)[-400:, 0]).max() == pytest.approx(0.03, rel=1e-3)
    player.set(frequency=4.0)
    rows = player.play(2.5)[-600:]
    assert np.count_nonzero(np.diff(np.sign(rows[:, 0]))) in (4, 5)  # 4 Hz over 0.6 s
    player.smooth()


def test_another_reference_comes_with_its_parameters_and_the_old_ones_go(player) -> None:
    node = player.node.frame.node
    player.play(1.0)
    player.set(reference="pulse")
    assert not node.has_parameter("frequency") and node.has_parameter("hold_time")
    described = node.describe_parameter("hold_time")
    assert described.description == "time at full height [s]" and not described.read_only
    player.play(3.0)
    player.set(hold_time=0.1, shaping__change_time=0.5)
    player.play(3.0)
    assert player.node._program.kind == "pulse"
    player.smooth()
    refused = node.set_parameters([Parameter("reference", value="puls")])[0]
    assert not refused.successful and "did you mean 'pulse'?" in refused.reason
    assert player.node._program.kind == "pulse"


def test_it_comes_to_rest_in_the_middle_and_plays_from_the_beginning_when_told(player) -> None:
    whole = player.play(1.13)
    player.set(play=False)
    rest = player.play(3.0)
    assert np.array_equal(rest[-500:], np.zeros((500, 3)))
    assert player.node._condition()[1].startswith("at rest")
    player.set(amplitude=0.01)  # takes effect with the next start
    assert np.array_equal(player.play(0.5), np.zeros((500, 3)))
    player.set(play=True)
    again = player.play(1.13)
    assert again[:, 0] == pytest.approx(0.5 * whole[:, 0], abs=1e-9)
    player.smooth()


def test_it_plays_again_when_told_once_more_after_its_end(player) -> None:
    player.set(reference="pulse", hold_time=0.1)
    player.play(0.1)
    player.set(play=False)
    player.play(3.0)
    player.set(play=True)
    first = player.play(7.0)
    assert player.node._condition()[1] == "pulse: ended"
    player.set(play=True)
    again = player.play(7.0)
    assert np.abs(first[:, 0]).max() > 1e-3
    assert np.abs(again[:, 0]).max() == pytest.approx(np.abs(first[:, 0]).max(), rel=1e-9)
    player.set(repeat=False)
    player.set(play=True)
    player.smooth()


def test_it_repeats_as_it_was_from_the_moment_it_is_told(player) -> None:
    once = player.play(5.0)
    player.set(repeat=True)
    again = player.play(4.0)
    assert np.abs(again[1:] - once[: len(again) - 1]).max() < 1e-6  # from the next sample on
    player.play(4.0)
    player.set(repeat=False)
    assert np.abs(player.play(9.0)[-100:]).max() < 1e-6
    player.smooth()


def test_a_set_that_is_going_to_be_exchanged_is_not_changed_in_the_same_breath(player) -> None:
    both = [Parameter("reference", value="pulse"), Parameter("amplitude", value=0.01)]
    result = player.node.frame.node.set_parameters_atomically(both)
    assert not result.successful and result.reason == "set reference first: it exchanges these parameters"
    player.play(0.1)
    assert player.node._program.kind == "sine"
