"""`NAME --help` of every node: all that it declares, writes, reads and answers to, and no trace of it elsewhere."""

from __future__ import annotations

import re

import pytest
from every_node import built
from rclpy.node import Node

from shake_ros import __main__ as entry
from shake_ros.entry_points import NODES
from shake_ros.ros.interface import SERVICES
from shake_ros.ros.loop import ros_context
from shake_ros.ros.parameters import OWN_OVERRIDES


@pytest.mark.parametrize("name", NODES)
def test_help_lists_what_the_node_itself_declares(ros_domain, tmp_path, capsys, monkeypatch, name) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    assert entry.main([name, "--help"]) == 0
    said = capsys.readouterr().out
    assert said.startswith(f"{name}: {NODES[name].line}\n")
    assert list(tmp_path.iterdir()) == []  # not even the recorder leaves anything
    with ros_context([], domain_id=ros_domain) as context:
        node = built(name, context, tmp_path)
        declared = [one for one in node.frame.node._parameters if not one.startswith(OWN_OVERRIDES)]
        written = {one.topic_name for one in node.frame.node.publishers}
        node.finish()
        node.frame.close()
    assert re.findall(r"^ [ *](\S+) = ", said, re.MULTILINE) == declared
    for topic in written - {"/parameter_events", "/rosout"} if name != "player" else ():
        assert re.search(rf"^  {topic.removeprefix('/shake/')} \[\w+/msg/\w+\]$", said, re.MULTILINE), topic


def test_help_has_unit_range_default_meaning_and_services(capsys, monkeypatch) -> None:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    assert entry.main(["hardware_bridge", "-h"]) == 0
    said = capsys.readouterr().out
    assert "\n *interlock.span = 1\n      master gain of the command [-] (0 … 1)\n" in said
    assert "\n  bridge = emulator\n      configuration in config/bridge, or a YAML file\n" in said
    for service in SERVICES:
        assert re.search(rf"^  {service} \[std_srvs/srv/\w+\]$", said, re.MULTILINE)


def test_help_is_no_second_commander(ros_domain, capsys, monkeypatch) -> None:
    """It is asked for while a table moves."""
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    seen: set[str] = set()
    with ros_context([], domain_id=ros_domain) as context:
        looking = Node("looking", context=context)
        print_help, create = entry.main, Node.create_publisher

        def created(node: Node, *arguments: object, **options: object) -> object:
            made = create(node, *arguments, **options)  # type: ignore[arg-type]
            seen.add(made.topic_name)
            assert looking.count_publishers("/shake/valve_command") == 0
            return made

        monkeypatch.setattr(Node, "create_publisher", created)
        assert print_help(["controller", "--help"]) == 0
        looking.destroy_node()
    assert "/_help/valve_command" in seen and "/shake/valve_command" not in seen
