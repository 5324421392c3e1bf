"""ROS parameters are made from the dataclasses, and changed only within what those allow."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import pytest
from rclpy.node import Node
from rclpy.parameter import Parameter

from shake_ros.control.laws import CONTROLLERS
from shake_ros.control.observer import OBSERVERS
from shake_ros.entry_points import NODES
from shake_ros.quantities import Parameters, ShakeError, UnknownName, choice, quantity
from shake_ros.realtime import RealtimeParameters
from shake_ros.recordings.reference_file import load_reference
from shake_ros.ros.controller_node import ControllerNodeParameters
from shake_ros.ros.frame import LoopParameters
from shake_ros.ros.loop import ros_context
from shake_ros.ros.observer_node import ObserverNodeParameters
from shake_ros.ros.parameters import NodeParameters, flatten, replaced
from shake_ros.ros.plant_node import PlantParameters
from shake_ros.ros.reference_node import ReferenceNodeParameters
from shake_ros.settings import config_folder, load_table, load_variant


@dataclass(frozen=True)
class Inner(Parameters):
    width: float = quantity("m", "width of the gap", low=0.0, live=True)


@dataclass(frozen=True)
class Outer(Parameters):
    gain: float = quantity("1/m", "gain of the loop", low=-10.0, high=10.0, live=True)
    count: int = quantity("-", "how many", low=1, high=5)
    law: str = choice("which law", ("one", "other"), live=True)
    active: bool = quantity("", "whether it acts", live=True)
    inner: Inner = None  # type: ignore[assignment]


VALUE = Outer(gain=2.0, count=3, law="one", active=True, inner=Inner(width=0.1))


@pytest.fixture
def make(ros_domain: int) -> Iterator:
    """Makes a node with ROS arguments; returns it with its parameter sets."""
    with ros_context([], domain_id=ros_domain) as context:
        nodes = []

        def node(*arguments: str) -> tuple[Node, NodeParameters]:
            given = ["--ros-args", *arguments] if arguments else []
            nodes.append(Node("sample", context=context, cli_args=given, use_global_arguments=False))
            return nodes[-1], NodeParameters(nodes[-1])

        yield node
        for one in nodes:
            one.destroy_node()


def set_parameter(node: Node, name: str, value: object) -> tuple[bool, str]:
    result = node.set_parameters([Parameter(name, value=value)])[0]
    return result.successful, result.reason


def test_descriptor_holds_meaning_unit_range_and_whether_it_is_live(make) -> None:
    node, parameters = make()
    parameters.declare(VALUE, "loop.")
    gain = node.describe_parameter("loop.gain")
    assert gain.description == "gain of the loop [1/m]"
    assert (gain.floating_point_range[0].from_value, gain.floating_point_range[0].to_value) == (-10.0, 10.0)
    assert not gain.read_only
    count = node.describe_parameter("loop.count")
    assert count.read_only and count.integer_range[0].to_value == 5
    assert node.describe_parameter("loop.law").additional_constraints == "one of one, other"
    assert node.get_parameter("loop.inner.width").value == 0.1


def test_override_at_the_start_replaces_the_configured_value(make) -> None:
    _, parameters = make("-p", "gain:=-4", "-p", "inner.width:=0.25", "-p", "law:=other")
    value = parameters.declare(VALUE).value
    assert (value.gain, value.inner.width, value.law, value.count) == (-4.0, 0.25, "other", 3)


@pytest.mark.parametrize(
    ("override", "reason"),
    [
        ("gain:=11.0", "gain = 11.0 is outside -10 … 10 1/m"),
        ("count:=0", "count = 0 is outside 1 … 5"),
        ("law:=third", "unknown law 'third'.*known: one, other"),
        ("gain:=much", "gain = 'much' is not of type float"),
        ("gain:=.nan", "gain = nan is"),
        ("active:=1", "active = 1 is not of type bool"),
    ],
)
def test_wrong_override_is_an_error_that_names_it(make, override, reason) -> None:
    _, parameters = make("-p", override)
    with pytest.raises(ShakeError, match=reason):
        parameters.declare(VALUE)


def test_override_that_no_set_declares_is_an_error_with_the_nearest_name(make) -> None:
    _, parameters = make("-p", "gian:=1.0")
    parameters.declare(VALUE)
    with pytest.raises(UnknownName, match=r"unknown parameter 'gian' \(did you mean 'gain'\?\); known: active, count"):
        parameters.check_overrides()


def test_live_change_waits_until_the_node_takes_it(make) -> None:
    node, parameters = make()
    live = parameters.declare(VALUE)
    used = live.take()
    assert set_parameter(node, "gain", 5.0) == (True, "")
    assert used.gain == 2.0 and live.changed
    assert live.take().gain == 5.0 and not live.changed


@pytest.mark.parametrize(("value", "taken"), [(3, 3.0), ("2.5e0", 2.5), ("-4", -4.0), ("1e1", 10.0)])
def test_number_of_another_type_is_taken_for_the_double_that_is_meant(make, value, taken) -> None:
    node, parameters = make("-p", f"inner.width:='{abs(float(value))}'")
    live = parameters.declare(VALUE)
    assert live.value.inner.width == abs(float(value))
    assert set_parameter(node, "gain", value) == (True, "")
    assert live.take().gain == taken and node.get_parameter("gain").value == taken


@pytest.mark.parametrize(
    ("name", "value", "reason"),
    [
        ("gain", "20", "out of range"),
        ("law", 3.0, "Wrong parameter type"),
        ("gain", 20.0, "out of range"),
        ("count", 4, "read-only"),
        ("law", "third", "unknown law 'third'"),
        ("gain", "text", "Wrong parameter type"),
        ("gain", float("nan"), "nan"),
    ],
)
def test_wrong_live_change_is_refused_with_the_reason(make, name, value, reason) -> None:
    node, parameters = make()
    live = parameters.declare(VALUE)
    successful, text = set_parameter(node, name, value)
    assert not successful and reason in text
    assert not live.changed and live.value == VALUE


def test_change_that_the_node_cannot_use_is_refused_with_its_reason(make) -> None:
    def accept(value: Outer) -> None:
        if value.gain * value.inner.width > 1.0:
            raise ShakeError("gain times width exceeds 1")

    node, parameters = make()
    live = parameters.declare(VALUE, accept=accept)
    assert set_parameter(node, "inner.width", 0.9) == (False, "gain times width exceeds 1")
    assert live.value == VALUE


def test_changes_set_together_are_all_taken_or_none(make) -> None:
    node, parameters = make()
    first, second = parameters.declare(VALUE), parameters.declare(Inner(width=0.5), "second.")
    result = node.set_parameters_atomically([Parameter("second.width", value=0.7), Parameter("law", value="third")])
    assert not result.successful
    assert not first.changed and not second.changed


def test_replaced_reaches_nested_sets_and_keeps_the_rest() -> None:
    assert replaced(VALUE, {"inner.width": 0.3}) == Outer(2.0, 3, "one", True, Inner(width=0.3))


def configured(kind: str) -> list[str]:
    names = {path.stem for path in (config_folder() / kind).glob("*.yaml")}
    return sorted(names - {"unknown"} if kind == "table" else names)  # a fit makes a table of that one


def load(kind: str, name: str) -> Parameters:
    """The parameters of a configuration, whose names become ROS parameters beside the node's own."""
    if kind == "table":
        return load_table(name)
    if kind == "reference":
        return load_reference(name).parameters
    return load_variant(kind, name, {"controller": CONTROLLERS, "observer": OBSERVERS}[kind])[1]


OWN = {
    "table": PlantParameters,
    "controller": ControllerNodeParameters,
    "observer": ObserverNodeParameters,
    "reference": ReferenceNodeParameters,
}
COMMON = {
    *flatten(LoopParameters(False, 1000.0, "", "")),
    *flatten(RealtimeParameters(False, 1, -1, True, True, True), "realtime."),
}


@pytest.mark.parametrize(("kind", "name"), [(kind, name) for kind in OWN for name in configured(kind)])
def test_no_configuration_has_a_name_that_the_node_uses_itself(kind, name) -> None:
    names = set(flatten(load(kind, name)))
    assert names
    assert not names & {*OWN[kind].__dataclass_fields__, *COMMON}


def test_every_node_configuration_is_read_by_a_node() -> None:
    assert {path.stem for path in (config_folder() / "node").glob("*.yaml")} <= {"common", *NODES}
