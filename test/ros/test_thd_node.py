"""The live analyzer, fed with a wave whose harmonics are known."""

from __future__ import annotations

import math
from collections.abc import Iterator

import pytest

from shake_ros.ros.conversions import SECOND
from shake_ros.ros.loop import build_node, ros_context
from shake_ros.ros.thd_node import ThdAnalyzer, build

FREQUENCY = 2.5
AMPLITUDES = {1: 3.0, 2: 0.3, 3: 0.4}
PHASES = {1: 0.3, 2: -1.0, 3: 2.0}


def wave(t: float) -> float:
    return sum(a * math.sin(2.0 * math.pi * FREQUENCY * k * t + PHASES[k]) for k, a in AMPLITUDES.items())


class Heard:
    """Stands in for the two publishers."""

    def __init__(self) -> None:
        self.messages: list = []

    def publish(self, message) -> None:
        self.messages.append(message)


@pytest.fixture
def analyzer(ros_domain: int) -> Iterator[ThdAnalyzer]:
    arguments = ["--ros-args", "-p", "lockstep:=true", "-p", "capacity:=4.0", "-p", "periods:=5"]
    with ros_context([], domain_id=ros_domain) as context:
        node = build_node(build, "thd_analyzer", context, arguments)
        assert isinstance(node, ThdAnalyzer)
        node._thd, node._harmonics = Heard(), Heard()
        yield node
        node.frame.close()


def feed(analyzer: ThdAnalyzer, seconds: float) -> None:
    for k in range(round(seconds * 1000)):
        analyzer._on_acceleration(SECOND + k * 1_000_000, wave(k * 0.001))


def test_distortion_and_harmonics_of_a_known_wave(analyzer) -> None:
    feed(analyzer, 5.0)
    values = {item.key: item.value for item in analyzer._thd.messages[-1].status[0].values}
    assert float(values["thd_percent"]) == pytest.approx(100.0 * math.hypot(0.3, 0.4) / 3.0, rel=1e-6)
    assert float(values["fundamental_frequency_hz"]) == pytest.approx(FREQUENCY, rel=1e-6)
    assert float(values["periods"]) == pytest.approx(5.0, abs=0.01)
    message = analyzer._harmonics.messages[-1]
    rows = [message.data[i : i + 4] for i in range(0, len(message.data), 4)]
    assert message.layout.dim[0].size == len(rows) == 20
    assert message.layout.dim[1].label == "order, frequency [Hz], amplitude [m/s^2], phase [rad]"
    for k, amplitude in AMPLITUDES.items():
        assert rows[k - 1][0] == k
        assert rows[k - 1][1] == pytest.approx(k * FREQUENCY)
        assert rows[k - 1][2] == pytest.approx(amplitude, rel=1e-6)
    for k in (2, 3):
        relative = rows[k - 1][3] - k * rows[0][3] - (PHASES[k] - k * PHASES[1])
        assert math.remainder(relative, math.tau) == pytest.approx(0.0, abs=1e-6)
    assert all(row[2] < 1e-6 for row in rows[3:])


def test_stamp_is_that_of_the_newest_sample(analyzer) -> None:
    feed(analyzer, 4.0)
    stamp = analyzer._thd.messages[-1].header.stamp
    assert stamp.sec * SECOND + stamp.nanosec == SECOND + 3999 * 1_000_000
    assert analyzer._harmonics.messages[-1].layout.dim[2].label == "stamp 4.999000000 s"
    assert analyzer._thd.messages[-1].status[0].hardware_id == "shake/thd_analyzer"


def test_nothing_is_published_before_a_whole_window(analyzer) -> None:
    feed(analyzer, 3.9)
    assert not analyzer._thd.messages
    assert analyzer.frame.diagnostics.condition() == (1, "no whole window yet")


def test_samples_lost_under_load_are_bridged_and_a_long_gap_is_named(analyzer) -> None:
    for k in range(5000):
        if k % 7 and not 1000 < k % 1700 < 1060:
            analyzer._on_acceleration(SECOND + k * 1_000_000, wave(k * 0.001))
    values = {item.key: item.value for item in analyzer._thd.messages[-1].status[0].values}
    assert float(values["thd_percent"]) == pytest.approx(100.0 * math.hypot(0.3, 0.4) / 3.0, rel=1e-6)
    for k in range(6000, 7000):
        analyzer._on_acceleration(SECOND + k * 1_000_000, wave(k * 0.001))
    level, text = analyzer.frame.diagnostics.condition()
    assert level == 1
    assert text == "no whole window yet; restarted 1 times, the last time for 1000 consecutive samples lost"
