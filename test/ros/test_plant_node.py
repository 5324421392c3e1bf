"""The plant as a node: what its diagnostics say of the oil."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from shake_ros.ros.loop import build_node, ros_context
from shake_ros.ros.plant_node import Plant, build


@contextmanager
def plant(table: str, domain: int) -> Iterator[Plant]:
    """The node with a specimen so heavy that it empties a chamber when the valve shuts at speed."""
    values = {"lockstep": "true", "table": table, "enabled": "true", "body.specimen_mass": "3000.0"}
    arguments = ["--ros-args"]
    for name, value in values.items():
        arguments += ["-p", f"{name}:={value}"]
    with ros_context([], domain_id=domain) as context:
        node = build_node(build, "plant", context, arguments)
        assert isinstance(node, Plant)
        node.start()
        yield node
        node.frame.close()


def pressures(node: Plant) -> str:
    """What the node publishes of them once a second."""
    return {item.key: item.value for item in node.frame.diagnostics.status().values}["pressures"]


def shut_at_full_speed(node: Plant) -> None:
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
