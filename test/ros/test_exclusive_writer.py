"""A second graph on the same topics is refused, node by node, before it says anything."""

from __future__ import annotations

import os

import pytest
from every_node import built
from node_process import NodeProcess

from shake_ros.entry_points import NODES
from shake_ros.quantities import ShakeError
from shake_ros.ros.loop import ros_context

WRITERS = {
    "plant": "joint_states",
    "hardware_bridge": "joint_states",
    "reference_generator": "reference",
    "observer": "estimate",
    "controller": "valve_command",
    "thd_analyzer": "thd",
    "player": "joint_states",
}


@pytest.mark.parametrize("name", NODES)
def test_second_node_of_a_name_or_on_a_topic_is_refused_until_the_first_has_ended(ros_domain, tmp_path, name) -> None:
    with ros_context([], domain_id=ros_domain) as context:
        first = built(name, context, tmp_path)
        with pytest.raises(ShakeError, match=f"node /shake/{name} runs already, by process {os.getpid()}: another"):
            built(name, context, tmp_path)
        if name in WRITERS:
            full = f"/shake/{WRITERS[name]}"
            with pytest.raises(ShakeError, match=f"topic {full} is published already, by process {os.getpid()}"):
                built(name, context, tmp_path, "-r", "__node:=second")
        other = built(name, context, tmp_path, "-r", "__ns:=/other", *(["-r", "/shake/joint_states:=/free"]))
        first.finish()
        first.frame.close()
        again = built(name, context, tmp_path)
        for one in (other, again):
            one.finish()
            one.frame.close()


def test_second_graph_ends_with_one_line_and_a_node_that_was_killed_starts_again_at_once(ros_domain, tmp_path) -> None:
    first = NodeProcess(ros_domain, tmp_path, "thd_analyzer")
    first.wait_for("running")
    second = NodeProcess(ros_domain, tmp_path / "..", "thd_analyzer")
    assert second.process.wait(30.0) == 2
    assert second.said().strip().splitlines() == [
        f"shake_ros thd_analyzer: node /shake/thd_analyzer runs already, by process {first.process.pid}: another graph "
        "of these names? End it, or give this one a namespace: --ros-args -r __ns:=/other"
    ]
    first.process.kill()
    first.process.wait()
    again = NodeProcess(ros_domain, tmp_path, "thd_analyzer")
    again.wait_for("running")
    assert again.end() == 0
