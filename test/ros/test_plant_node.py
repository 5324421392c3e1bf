"""The plant as a node: what its diagnostics say of the oil."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from shake_ros.ros.loop import build_node, ros_context
from shake_ros.ros.plant_node import PlantNode, build

HEAVY = {"lockstep": "true", "body.specimen_mass": "3000.0"}
REAL_TIME = {
    "lockstep": "false",
    "interlock.configuration": "bergamo",
    "interlock.low_pressure_time": "0.0",
    "interlock.high_pressure_time": "0.0",
    "interlock.span_time": "0.0",
}
MS = 1_000_000


@contextmanager
def plant(table: str, domain: int, changes: dict[str, str] = HEAVY) -> Iterator[PlantNode]:
    """The node; by default with a specimen so heavy that it empties a chamber when the valve shuts at speed."""
    values = {"table": table, "enabled": "true", **changes}
    arguments = ["--ros-args"]
    for name, value in values.items():
        arguments += ["-p", f"{name}:={value}"]
    with ros_context([], domain_id=domain) as context:
        node = build_node(build, "plant", context, arguments)
        assert isinstance(node, PlantNode)
        node.start()
        yield node
        node.frame.close()


def pressures(node: PlantNode) -> str:
    """What the node publishes of them once a second."""
    return {item.key: item.value for item in node.frame.diagnostics.status().values}["pressures"]


def shut_at_full_speed(node: PlantNode) -> None:
    for k in range(250):
        node._on_command(node._stamp, 1.0 if k < 150 else 0.0)
    assert node._machine.samples == 250


def test_diagnostics_say_where_the_oil_of_the_declared_table_bears_tension(ros_domain) -> None:
    with plant("bergamo", ros_domain) as node:
        assert pressures(node) == "as oil can have them"
        shut_at_full_speed(node)
        assert "below absolute zero for" in pressures(node)
        assert "the table has no cavitation" in pressures(node)


def test_diagnostics_find_nothing_where_a_void_opens_instead(ros_domain) -> None:
    with plant("bergamo_cavitation", ros_domain) as node:
        shut_at_full_speed(node)
        assert pressures(node) == "as oil can have them"


def test_reference_that_has_stopped_holds_the_program(ros_domain) -> None:
    with plant("bergamo", ros_domain, REAL_TIME) as node:
        lock = node.interlock.core
        node.interlock.observe(1000 * MS, 0.0, 0.0, 200e5)
        assert lock.leading is None  # none has come yet
        node.interlock._on_reference(1000 * MS, 0.0, 0.0, 0.0)
        for k in range(1000, 1060):
            node.interlock.observe(k * MS, 1e-5 * (k % 2), 0.01 * (k % 2), 200e5)
        assert lock.leading is not None
        assert (lock.leading.cause, lock.leading.action) == ("stale_reference", "program_hold")
        limit = lock.parameters.response("stale_reference").threshold
        assert lock.leading.time == 1001 * MS + round(limit * 1e9)


def test_after_a_pause_each_sample_is_judged_by_its_own_time(ros_domain) -> None:
    with plant("bergamo", ros_domain, REAL_TIME) as node:
        start = 1000 * MS
        node.tick(start, 1)
        for k in range(1, 200):
            node.interlock.command(start + (k - 1) * MS, 0.02)
            node.tick(start + k * MS, 1)
        last = start + 198 * MS
        node.tick(last + 501 * MS, 500)
        trips = {trip.cause: trip.time for trip in node.interlock.core.trips}
        limits = {name: node.interlock.core.parameters.response(name).threshold for name in trips}
        for name in ("stale_command", "command_lost"):
            assert trips[name] == last + round(limits[name] * 1e9) + MS
        assert node._machine.samples == 699


@pytest.mark.parametrize(("behind", "every", "share"), [(1, 2, 0.5), (1, 5, 0.2), (3, 1, 0.0)])
def test_commands_that_get_lost_hold_the_program_and_late_ones_do_not(ros_domain, behind, every, share) -> None:
    changes = {**REAL_TIME, "interlock.causes.link_loss.threshold": "0.3"}
    with plant("bergamo", ros_domain, changes) as node:
        start = 1000 * MS
        for k in range(600):
            node.tick(start + k * MS, 1)
            if k >= behind and (k % every or every == 1):
                node.interlock.command(start + (k - behind) * MS, 0.001)
        trips = [trip for trip in node.interlock.core.trips if trip.cause == "link_loss"]
        assert bool(trips) == (share > 0.3)
        if trips:
            assert trips[0].action == "program_hold"
            assert trips[0].value == pytest.approx(share, abs=0.02)
            assert trips[0].time - start <= 220 * MS


def test_messages_tell_the_variance_of_the_sensors_that_there_are(ros_domain) -> None:
    with plant("bergamo", ros_domain) as node:
        writers = node._sensors._writers
        sensors = node._live.value.sensors
        assert writers["acceleration"].codec.variance == sensors.acceleration_noise**2 > 0.0
        assert writers["pressure_supply"].codec.variance == sensors.pressure_noise**2 > 0.0
        assert writers["position"].codec.variance == 0.0  # JointState has no place for it
