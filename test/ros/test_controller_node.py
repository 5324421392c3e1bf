"""The controller's node over DDS: another controller while it runs, without a bump; harmonics added to a reference."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
import yaml
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rcl_interfaces.srv import SetParameters
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter

from shake_ros.control.laws import CONTROLLERS
from shake_ros.control.laws.runner import Controller, switch
from shake_ros.physics.plant.table import Table
from shake_ros.quantities import ShakeError
from shake_ros.ros import interface
from shake_ros.ros.controller_node import ControllerNode, build
from shake_ros.ros.conversions import SECOND
from shake_ros.ros.diagnostics import ERROR
from shake_ros.ros.frame import Frame, Reader
from shake_ros.ros.loop import build_node, ros_context
from shake_ros.settings import config_folder, load_table, load_variant

DT = 0.001
TIMEOUT = 60.0
ARGUMENTS = ["--ros-args", "-p", "lockstep:=true"]


def motion(k: int) -> tuple[float, float, float]:
    phase = 4.0 * math.pi * k * DT
    return 0.02 * math.sin(phase), 0.08 * math.pi * math.cos(phase), -0.32 * math.pi**2 * math.sin(phase)


class Bench:
    """The node, and in the same process what feeds it, hears it and sets its parameters, each through DDS."""

    def __init__(self, context: Any) -> None:
        self.node = build_node(build, "controller", context, [*ARGUMENTS, "-p", "controller:=feedforward_pi_tuned"])
        assert isinstance(self.node, ControllerNode)
        self.driver = Frame("driver", context, ARGUMENTS)
        self.references = self.driver.writer(interface.REFERENCE)
        self.estimates = self.driver.writer(interface.ESTIMATE)
        self.accelerations = self.driver.writer(interface.IMU)
        self.commands: list[float] = []
        Reader(self.driver, interface.VALVE_COMMAND, lambda _stamp, u: self.commands.append(u))
        self.client = self.driver.node.create_client(SetParameters, "controller/set_parameters")
        self.executor = SingleThreadedExecutor(context=context)
        for one in (self.node.frame.node, self.driver.node):
            self.executor.add_node(one)
        writers = self.references, self.estimates, self.node._writer
        self.until(lambda: all(w.publisher.get_subscription_count() for w in writers))
        self.until(self.client.service_is_ready)

    def until(self, condition: Callable[[], bool]) -> None:
        deadline = time.monotonic() + TIMEOUT
        while not condition():
            assert time.monotonic() < deadline
            self.executor.spin_once(timeout_sec=0.02)

    def set(self, name: str, value: Any) -> tuple[bool, str]:
        request = SetParameters.Request(parameters=[Parameter(name, value=value).to_parameter_msg()])
        answer = self.client.call_async(request)
        self.until(answer.done)
        result = answer.result().results[0]
        return result.successful, result.reason

    def play(self, first: int, last: int, acceleration: bool = False) -> list[float]:
        """Samples first … last − 1 in lock-step; the commands."""
        heard = len(self.commands)
        for count, k in enumerate(range(first, last), heard + 1):
            stamp = SECOND + k * 1_000_000
            if acceleration:
                self.accelerations.send(stamp, motion(k)[2])
            self.references.send(stamp, *motion(k))
            self.estimates.send(stamp, *motion(k - 4))
            self.until(lambda count=count: len(self.commands) == count)
        return self.commands[heard:]

    def close(self) -> None:
        self.executor.shutdown()
        for frame in (self.node.frame, self.driver):
            frame.close()


@pytest.fixture
def bench(ros_domain: int) -> Iterator[Bench]:
    with ros_context([], domain_id=ros_domain) as context:
        made = Bench(context)
        yield made
        made.close()


def test_controller_changes_while_it_runs_without_a_bump_as_in_the_core(bench: Bench) -> None:
    names = ("feedforward_pi_tuned", "super_twisting_tuned", "three_variable")
    laws = [Controller(*load_variant("controller", n, CONTROLLERS), DT) for n in names]
    state, wanted, commands = laws[0].initial_state(), [], []
    for i, name in enumerate(names):
        if i > 0:
            assert bench.set("controller", name) == (True, "")
            state = switch(laws[i - 1], state, laws[i], wanted[-1], 0.2)
        commands += bench.play(150 * i, 150 * (i + 1))
        for k in range(150 * i, 150 * (i + 1)):
            state, u = laws[i].step(state, motion(k), motion(k - 4))
            wanted.append(u)
    assert commands == wanted  # to the bit
    for first in (150, 300):
        assert abs(commands[first] - commands[first - 1]) < 1e-9
        assert np.max(np.abs(np.diff(commands[first : first + 100]))) < 0.02
    assert bench.set("controller", "three_variabl")[0] is False
    assert bench.node._condition()[1] == "three_variable: running"


def test_cancellation_waits_for_the_acceleration_of_each_sample_and_ends_when_told(bench: Bench) -> None:
    bench.play(0, 3)
    assert bench.set("harmonic_cancellation", True) == (True, "")
    bench.play(3, 4)  # the change is taken over at this sample
    bench.until(lambda: bool(bench.accelerations.publisher.get_subscription_count()))
    bench.play(4, 20, acceleration=True)
    assert bench.node._harmonics._state is not None
    assert bench.set("harmonic_cancellation", False) == (True, "")
    bench.play(20, 21, acceleration=True)
    bench.play(21, 24)


def test_estimate_of_another_instant_than_the_controller_predicts_to_is_refused_at_the_start(bench: Bench) -> None:
    bench.estimates.codec.lead = 3_400_000
    with pytest.raises(ShakeError, match=r"the estimate is 3\.4 ms ahead .* takes it for 0 ms"):
        bench.play(0, 1)
    assert not bench.commands


def test_observer_that_changes_first_is_told_and_has_two_seconds_for_the_controller_to_follow(bench: Bench) -> None:
    bench.play(0, 2)
    bench.estimates.codec.lead = 3_400_000
    bench.play(2, 4)
    level, text = bench.node._condition()
    assert level == ERROR and "another instant" in text
    bench.estimates.codec.lead = 0
    bench.play(4, 5)
    assert bench.node._condition()[1] == "feedforward_pi: running"
    bench.node._apart = 2000
    bench.estimates.codec.lead = 3_400_000
    with pytest.raises(ShakeError, match="must both predict"):
        bench.play(5, 6)


def test_command_does_not_wind_up_while_the_interlock_lets_none_pass(ros_domain) -> None:
    """The table a millimetre off for ten seconds without pressure, then released."""

    def said(passes: bool, space: str = "shake") -> DiagnosticArray:
        values = [KeyValue(key="passes", value=str(passes))]
        return DiagnosticArray(status=[DiagnosticStatus(name=f"{space}/plant: plant", values=values)])

    with ros_context([], domain_id=ros_domain) as context:
        node = build_node(build, "controller", context, ["--ros-args", "-p", "controller:=super_twisting_tuned"])
        assert isinstance(node, ControllerNode)
        stamps = iter(range(SECOND, 100 * SECOND, 1_000_000))

        def commands(count: int) -> list[float]:
            found = []
            for _ in range(count):
                stamp = next(stamps)
                node._on_reference(stamp, 0.001, 0.0, 0.0)
                node._on_estimate(stamp, 0.0, 0.0, 0.0)
                found.append(node._u)
            return found

        assert abs(commands(10_000)[-1]) > 0.3  # what no interlock holds back winds up
        node._on_diagnostics(said(True, "other"))
        node._on_diagnostics(said(False))
        assert set(commands(10_000)) == {0.0}
        assert "at rest" in node._condition()[1]
        node._on_diagnostics(said(False, "other"))
        node._on_diagnostics(said(True))
        released = np.abs(commands(100))
        assert released[0] < 0.01 and released.max() < 0.2
        node.frame.close()


def test_feedforward_carries_the_load_that_is_followed_as_in_the_core(ros_domain, tmp_path) -> None:
    """A table with 500 kg instead of the 200 kg that are known, sample by sample in lock-step."""
    content = yaml.safe_load((config_folder() / "controller" / "super_twisting_tuned.yaml").read_text(encoding="utf-8"))
    law = tmp_path / "law.yaml"
    law.write_text(yaml.safe_dump(content | {"model": "bergamo"}), encoding="utf-8")
    heavy = Table(load_table("bergamo").with_values({"body.specimen_mass": 500.0}), DT, seed=4)
    given = ["-p", f"controller:={law}", "-p", "load:=default"]
    with ros_context([], domain_id=ros_domain) as context:
        node = build_node(build, "controller", context, [*ARGUMENTS, *given])
        assert isinstance(node, ControllerNode)
        state, rows = heavy.initial_state(), []
        for k in range(400):
            m, stamp = heavy.measure(state, k), SECOND + k * 1_000_000
            node._on_reference(stamp, *motion(k))
            node._on_estimate(stamp, m.truth_position, m.truth_velocity, m.truth_acceleration)
            node._load._on_position(stamp, m.position)
            assert len(rows) == node.frame.diagnostics.cycles  # it waits for the accelerometer
            node._load._on_acceleration(stamp, m.acceleration)
            rows.append((m.position, m.acceleration, node._u))
            state = heavy.advance(state, node._u)
        controller, followed = node._controller, node._load
        assert controller.virtual is not None and followed._tracker is not None
        reported, errors = followed._tracker.run(*np.array(rows).T)
        carried = controller.virtual.record[0]
        assert carried["body_specimen_mass"] == pytest.approx(reported[-1, 0] + reported[-1, 1], rel=1e-9)
        assert carried["body_specimen_mass"] > 202.0
        shown = {name: read() for name, read in node.frame.diagnostics.values.items()}
        assert shown["load_rigid_kg"] == f"{reported[-1, 0]:.3g} ± {errors[0]:.2g}"
        assert shown["load_believed"] is True
        node.frame.close()


def test_load_cannot_be_followed_by_a_controller_without_a_table(ros_domain) -> None:
    given = [*ARGUMENTS, "-p", "controller:=feedforward_pi_tuned", "-p", "load:=default"]
    with ros_context([], domain_id=ros_domain) as context, pytest.raises(ShakeError, match="has no table model"):
        build_node(build, "controller", context, given)
