"""Followed values released to observer and controller of a running graph, and taken back."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import pytest

from shake_ros.control.laws import CONTROLLERS
from shake_ros.control.observer import OBSERVERS
from shake_ros.ros.graph import Graph, NodeSpec
from shake_ros.ros.graph_client import LiveGraph
from shake_ros.ros.loop import ros_context
from shake_ros.settings import load_table, load_variant

pytestmark = pytest.mark.second_tier  # test/twin/test_release.py holds what is handed on
FLOW = "valve.flow_coefficient"
SHARE = 0.9  # of the file's flow coefficient that the table has
SETTINGS = """{window: 1.0, reference: 5.0, false_alarms: 0.01, naming: 4.0, matters: 0.02,
 parameters: {valve.flow_coefficient: {file: 0.1, walk: 0.01}, bulk_modulus.modulus: {file: 0.1, walk: 0.1}}}"""


def graph_of(tmp_path: Path, domain: int, model: str = "bergamo") -> Graph:
    """A table with less flow than in its file, under a loop that carries the file, and the twin beside it."""
    settings, law = tmp_path / "twin.yaml", tmp_path / "law.yaml"
    settings.write_text(SETTINGS, encoding="utf-8")
    _, parameters = load_variant("controller", "three_variable_tuned", CONTROLLERS)
    law.write_text(f"kind: three_variable\nmodel: {model}\n" + "".join(
        f"{name}: {getattr(parameters, name)}\n" for name in (
            "limit", "start_time", "model_bandwidth", "model_horizon", "filter_frequency", "filter_damping",
            "reference_displacement", "reference_velocity", "reference_acceleration", "feedback_displacement",
            "feedback_velocity", "feedback_acceleration")
    ), encoding="utf-8")  # fmt: skip
    flow = SHARE * load_table("bergamo").value(FLOW)
    return Graph(
        [
            NodeSpec("plant", {FLOW: flow, "enabled": True, "interlock.configuration": "simulation"}),
            NodeSpec("reference_generator", {"reference": "multisine", "repeat": True}),
            NodeSpec("observer", {"observer": "fused_accelerometer"}, reads=("imu",)),
            NodeSpec("controller", {"controller": str(law)}),
            NodeSpec("twin", {"table": "bergamo", "settings": str(settings), "release_time": 0.5}),
        ],
        domain_id=domain,
    )


def events(graph: Graph, live: LiveGraph, words: str, seconds: float = 100.0) -> None:
    """Wait until the twin says something."""
    end = time.monotonic() + seconds
    while words not in graph.output("twin"):
        assert time.monotonic() < end, graph.output("twin")[-3000:]
        graph.check()
        live.look(0.1)


@pytest.fixture
def own(ros_domain: int) -> Any:
    with ros_context([], domain_id=ros_domain) as context:
        live = LiveGraph(context, "/shake")
        yield live
        live.close()


def test_released_values_reach_the_loop_and_go_back_to_what_was_there(ros_domain, tmp_path, own) -> None:
    with graph_of(tmp_path, ros_domain) as graph:
        graph.wait_until_ready()
        own.until(lambda: {"twin", "observer", "controller"} <= {*own.reports}, 30.0)
        kinds = {
            "observer": (OBSERVERS, "fused_accelerometer"),
            "controller": (CONTROLLERS, str(tmp_path / "law.yaml")),
        }
        given = {node: load_variant(node, name, family)[1] for node, (family, name) in kinds.items()}
        before = {node: own.values(node, parameters) for node, parameters in given.items()}
        own.set("twin", {"release": True})
        events(graph, own, f"released to the loop: {FLOW} ×")
        (path, gain), law = own.get("controller", "model", "feedback_displacement"), before["controller"]
        deadline = time.monotonic() + 60.0
        while abs(gain * SHARE / law.feedback_displacement - 1.0) > 0.02:
            assert time.monotonic() < deadline, (gain, graph.output("twin")[-3000:])
            path, gain = own.get("controller", "model", "feedback_displacement")
            own.look(0.1)
        assert load_table(path).value(FLOW) == pytest.approx(SHARE * load_table("bergamo").value(FLOW), rel=0.03)
        assert load_table(own.get("observer", "model")[0]).value(FLOW) == pytest.approx(
            SHARE * load_table("bergamo").value(FLOW), rel=0.03
        )
        own.set("twin", {"release": False})
        events(graph, own, "taken back")
        assert {node: own.values(node, parameters) for node, parameters in given.items()} == before
        assert not Path(path).exists()


def test_a_loop_made_for_another_table_is_refused_in_one_line(ros_domain, tmp_path, own) -> None:
    with graph_of(tmp_path, ros_domain, "bergamo_measured") as graph:
        graph.wait_until_ready()
        own.until(lambda: "twin" in own.reports, 30.0)
        own.set("twin", {"release": True})
        events(graph, own, "not released: the controller carries another table than the twin's")
        assert own.get("controller", "model") == ["bergamo_measured"]
