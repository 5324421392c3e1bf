"""The observer's node over DDS: another observer while it runs, without a bump, or a refusal with its reason."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from rcl_interfaces.srv import SetParameters
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from stepped_loop import simulate_closed_loop

from shake_ros.control.closed_loop import ClosedLoop
from shake_ros.control.laws import CONTROLLERS
from shake_ros.control.laws.runner import Controller
from shake_ros.control.observer import OBSERVERS
from shake_ros.control.observer.runner import Observer
from shake_ros.physics.plant.table import Table
from shake_ros.recordings.reference_file import build_program
from shake_ros.ros import interface
from shake_ros.ros.conversions import SECOND
from shake_ros.ros.diagnostics import OK, WARN
from shake_ros.ros.frame import Frame, Reader
from shake_ros.ros.loop import build_node, ros_context
from shake_ros.ros.observer_node import ObserverNode, build
from shake_ros.settings import load_table, load_variant

DT = 0.001
FIRST, SAMPLES = 2000, 900
TIMEOUT = 60.0
ARGUMENTS = ["--ros-args", "-p", "lockstep:=true"]


@pytest.fixture(scope="module")
def motion() -> ClosedLoop:
    """A sine of 20 mm and 2 Hz as the table plays it under a feedforward PI law."""
    kind, parameters = load_variant("controller", "feedforward_pi_tuned", CONTROLLERS)
    table, law = Table(load_table("bergamo"), DT, seed=2), Controller(kind, parameters, DT)
    return simulate_closed_loop(table, None, law, build_program("sine_20mm_2hz", DT), FIRST + SAMPLES)


class Bench:
    """The node, and in the same process what feeds it, hears it and sets its parameters, each through DDS."""

    def __init__(self, domain: int, context: Any, observer: str = "linear_bergamo", sensors: Any = ()) -> None:
        self.node = build_node(build, "observer", context, [*ARGUMENTS, "-p", f"observer:={observer}"])
        assert isinstance(self.node, ObserverNode)
        self.driver = Frame("driver", context, ARGUMENTS)
        self.positions = self.driver.writer(interface.JOINT_STATES)
        self.commands = self.driver.writer(interface.VALVE_COMMAND)
        self.sensors = [self.driver.writer(topic) for topic in sensors]  # of the columns of `measured` from 1 on
        self.estimates: list[tuple[float, ...]] = []
        Reader(self.driver, interface.ESTIMATE, lambda _stamp, *values: self.estimates.append(values))
        self.client = self.driver.node.create_client(SetParameters, "observer/set_parameters")
        self.executor = SingleThreadedExecutor(context=context)
        for one in (self.node.frame.node, self.driver.node):
            self.executor.add_node(one)
        writers, readers = (self.positions, self.commands, *self.sensors), (self.node._writer,)
        self.until(lambda: all(w.publisher.get_subscription_count() for w in (*writers, *readers)))
        self.until(self.client.service_is_ready)

    def until(self, condition: Callable[[], bool]) -> None:
        deadline = time.monotonic() + TIMEOUT
        while not condition():
            assert time.monotonic() < deadline
            self.executor.spin_once(timeout_sec=0.02)

    def name(self, observer: str) -> tuple[bool, str]:
        """Set the parameter `observer` by its service."""
        return self.set("observer", observer)

    def set(self, name: str, value: Any) -> tuple[bool, str]:
        request = SetParameters.Request(parameters=[Parameter(name, value=value).to_parameter_msg()])
        answer = self.client.call_async(request)
        self.until(answer.done)
        result = answer.result().results[0]
        return result.successful, result.reason

    def play(self, run: ClosedLoop, first: int, last: int, silent: int = -1) -> np.ndarray:
        """Samples first … last − 1 in lock-step, one sensor silent if wanted; the estimates, (n, 3)."""
        heard = len(self.estimates)
        for count, k in enumerate(range(first, last), heard + 1):
            stamp = SECOND + k * 1_000_000
            self.positions.send(stamp, run.measured[k, 0])
            for column, writer in enumerate(self.sensors, 1):
                if column != silent:
                    writer.send(stamp, run.measured[k, column])
            self.until(lambda count=count: len(self.estimates) == count)
            self.commands.send(stamp, run.command[k])
        return np.array(self.estimates[heard:])

    def close(self) -> None:
        self.executor.shutdown()
        for frame in (self.node.frame, self.driver):
            frame.close()


@pytest.fixture
def bench(ros_domain: int) -> Iterator[Bench]:
    with ros_context([], domain_id=ros_domain) as context:
        made = Bench(ros_domain, context)
        yield made
        made.close()


def test_observer_changes_while_it_runs_without_a_bump(bench: Bench, motion: ClosedLoop) -> None:
    k = FIRST
    before = bench.play(motion, k, k := k + 400)
    for name in ("model_sliding_mode", "robust_exact_differentiator", "sliding_mode_tuned", "model"):
        assert bench.name(name) == (True, "")
        after = bench.play(motion, k, k + 60)
        truth = motion.truth[k - 1 : k + 1]
        jump = np.abs((after[0] - before[-1]) - (truth[1] - truth[0]))
        assert bench.node._condition()[1].startswith(name.removesuffix("_tuned"))
        assert np.all(jump < [1e-4, 0.01, 1.0]), name  # of 20 mm, 0.25 m/s and 3 m/s²
        before, k = after, k + 60


def test_observer_that_is_not_known_is_refused_with_the_known_ones_and_nothing_changes(
    bench: Bench, motion: ClosedLoop
) -> None:
    bench.play(motion, FIRST, FIRST + 5)
    successful, reason = bench.name("modl")
    assert not successful
    assert "unknown observer 'modl' (did you mean 'model'?)" in reason
    bench.play(motion, FIRST + 5, FIRST + 10)
    assert bench.node._condition()[1].startswith("linear")


def test_gains_are_those_of_the_observer_in_use_and_change_it_while_it_runs(bench: Bench, motion: ClosedLoop) -> None:
    node = bench.node.frame.node
    before = bench.play(motion, FIRST, FIRST + 400)
    assert node.has_parameter("jerk_noise") and not node.has_parameter("lambda1")
    assert bench.name("sliding_mode") == (True, "")
    assert not node.has_parameter("jerk_noise") and not node.describe_parameter("lambda1").read_only
    before = bench.play(motion, FIRST + 400, FIRST + 500)
    assert bench.set("boundary1", "2e-3") == (True, "")  # a text, as `ros2 param set` sends it
    assert node.get_parameter("boundary1").value == 2e-3
    after = bench.play(motion, FIRST + 500, FIRST + 560)
    truth = motion.truth[FIRST + 499 : FIRST + 501]
    assert np.all(np.abs((after[0] - before[-1]) - (truth[1] - truth[0])) < [1e-4, 0.01, 1.0])
    assert bench.node._observer.parameters.boundary1 == 2e-3
    successful, reason = bench.set("boundary1", -1.0)
    assert not successful and "boundary1" in reason


@pytest.fixture
def fused(ros_domain: int) -> Iterator[Bench]:
    topics = (interface.IMU, interface.PRESSURE_A, interface.PRESSURE_B)
    with ros_context([], domain_id=ros_domain) as context:
        made = Bench(ros_domain, context, "fused", topics)
        yield made
        made.close()


def test_observer_takes_every_sensor_and_goes_on_without_one_that_falls_silent(
    fused: Bench, motion: ClosedLoop
) -> None:
    k = FIRST
    before = fused.play(motion, k, k := k + 100)
    assert fused.node._condition()[1].startswith("fused: running, with imu pressure_a pressure_b")
    fused.play(motion, k, k := k + 60, silent=1)
    level, said = fused.node._condition()
    assert level == WARN
    assert "with pressure_a pressure_b, without imu" in said
    after = fused.play(motion, k, k := k + 100)
    assert fused.node._condition()[0] == OK

    kind, parameters = load_variant("observer", "fused", OBSERVERS)
    same = Observer(kind, parameters, DT, load_table("bergamo"))
    part = slice(FIRST, k)
    others = motion.measured[part, 1:4].copy()
    others[100:160, 0] = np.nan
    expected = same.run(motion.measured[part, 0], motion.command[part], others)
    np.testing.assert_allclose(before, expected[:100], atol=1e-12)
    np.testing.assert_allclose(after, expected[160:], atol=1e-9)


def test_sensor_that_says_no_number_is_left_out_for_as_long(fused: Bench, motion: ClosedLoop) -> None:
    broken = dataclasses.replace(motion, measured=motion.measured.copy())
    broken.measured[FIRST + 20 : FIRST + 30, 2] = np.nan
    fused.play(broken, FIRST, FIRST + 25)
    assert "without pressure_a" in fused.node._condition()[1]
    fused.play(broken, FIRST + 25, FIRST + 40)
    assert fused.node._condition()[0] == OK
