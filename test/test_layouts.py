"""The layouts for PlotJuggler and Foxglove: formed as these write them, and every path in them exists."""

from __future__ import annotations

import json
import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy")

from shake_ros.recordings.bags import write_table_recording
from shake_ros.recordings.bags.bag import Bag
from shake_ros.ros import interface
from shake_ros.ros.interface import NAMESPACE, interface_class

FOLDER = Path(__file__).resolve().parent.parent / "config" / "layouts"
JOINTS = {
    "joint_states": interface.TABLE_JOINT,
    "predicted_joint_states": interface.TABLE_JOINT,
    "valve_command": interface.VALVE_JOINT,
}
STEP = re.compile(r"(\w+)(\[\d+\])?")


def plotjuggler() -> ElementTree.Element:
    return ElementTree.parse(FOLDER / "plotjuggler.xml").getroot()


def foxglove() -> dict[str, Any]:
    content: dict[str, Any] = json.loads((FOLDER / "foxglove.json").read_text(encoding="utf-8"))
    return content


def curves() -> list[str]:
    return [str(curve.get("name")) for curve in plotjuggler().iter("curve")]


def paths() -> list[str]:
    panels = foxglove()["configById"].values()
    return [path["value"] for panel in panels for path in panel.get("paths", [])]


def leads_to_a_number(kind: Any, steps: list[str]) -> bool:
    """Whether a chain of fields, with [i] behind arrays and only there, ends at a number of a message class."""
    for place, step in enumerate(steps):
        found = STEP.fullmatch(step)
        if not found:
            return False
        types = kind.get_fields_and_field_types()
        name, index = found.groups()
        if name not in types:
            return False
        array = re.fullmatch(r"sequence<(.+?)(?:, \d+)?>|(.+)\[\d+\]", types[name])
        if bool(array) != bool(index):
            return False
        inner = (array.group(1) or array.group(2)) if array else types[name]
        if place == len(steps) - 1:
            return inner in ("double", "float") or "int" in inner
        kind = interface_class(inner.replace("/", "/msg/"))
    return False


def of_plotjuggler(path: str) -> tuple[str, list[str]]:
    """Topic and fields of a curve; PlotJuggler names a joint's values by the joint."""
    topic, *fields = path.removeprefix(f"{NAMESPACE}/").split("/")
    if topic in JOINTS:
        joint, field = fields
        assert joint == JOINTS[topic], path
        return topic, [f"{field}[0]"]
    return topic, fields


def of_foxglove(path: str) -> tuple[str, list[str]]:
    topic, *fields = path.removeprefix(f"{NAMESPACE}/").split(".")
    return topic, fields


def test_every_path_is_a_number_of_a_topic_of_the_interface() -> None:
    named = [*map(of_plotjuggler, curves()), *map(of_foxglove, paths())]
    assert len(named) >= 24
    for topic, fields in named:
        assert leads_to_a_number(interface.TOPICS[topic].type, fields), (topic, fields)
    for topic, path in (("imu", "linear_acceleration.w"), ("joint_states", "position"), ("reference", "points")):
        assert not leads_to_a_number(interface.TOPICS[topic].type, path.split("."))


def test_both_layouts_show_the_same_and_all_that_is_measured() -> None:
    shown = [{topic for topic, _ in map(*pair)} for pair in ((of_plotjuggler, curves()), (of_foxglove, paths()))]
    assert shown[0] == shown[1]
    sampled = {name for name, topic in interface.TOPICS.items() if topic.sampled}
    assert shown[0] == sampled


def test_the_paths_are_those_of_a_recording_too(tmp_path: Path) -> None:
    time = np.arange(200) * 0.001
    rest = np.zeros((200, 3))
    pressures = {f"pressure_{name}": time for name in ("a", "b", "supply")}
    motions = dict.fromkeys(("reference", "estimate", "truth"), rest)
    bag = write_table_recording(tmp_path / "run", time, time, time, time, **pressures, **motions)
    with Bag(bag) as opened:
        held = {topic.name: topic.type for topic in opened.topics.values()}
    assert len(held) == 9
    for name, kind in held.items():
        topic = name.rpartition("/")[2]
        assert name.startswith(f"{NAMESPACE}/")
        assert interface_class(kind) is interface.TOPICS[topic].type
        assert any(path.startswith(f"{name}/") for path in curves()), name


def test_plotjuggler_layout_is_formed_as_plotjuggler_writes_it() -> None:
    root = plotjuggler()
    assert root.tag == "root"
    (widget,) = root.findall("tabbed_widget")
    assert (widget.get("name"), widget.get("parent")) == ("Main Window", "main_window")
    assert root.find("use_relative_time_offset") is not None
    for tab in widget.findall("Tab"):
        assert tab.get("tab_name")
        assert int(str(tab.get("containers"))) == len(tab.findall("Container"))
    splitters = list(root.iter("DockSplitter"))
    assert splitters
    for splitter in splitters:
        sizes = [float(size) for size in str(splitter.get("sizes")).split(";")]
        assert int(str(splitter.get("count"))) == len(sizes) == len(list(splitter))
        assert sum(sizes) == pytest.approx(1.0, abs=1e-4)
        assert splitter.get("orientation") in ("-", "|")
    for area in root.iter("DockArea"):
        (plot,) = area.findall("plot")
        assert (plot.get("mode"), plot.get("style")) == ("TimeSeries", "Lines")
        assert {child.tag for child in plot} == {"range", "limitY", "curve"}
        assert all(re.fullmatch("#[0-9a-f]{6}", str(curve.get("color"))) for curve in plot.iter("curve"))


def test_foxglove_layout_is_formed_as_foxglove_writes_it() -> None:
    content = foxglove()
    assert set(content) == {"configById", "globalVariables", "userNodes", "playbackConfig", "layout"}

    def leaves(node: Any) -> list[str]:
        if isinstance(node, str):
            return [node]
        assert set(node) == {"direction", "first", "second", "splitPercentage"}
        assert node["direction"] in ("row", "column") and 0 < node["splitPercentage"] < 100
        return leaves(node["first"]) + leaves(node["second"])

    assert sorted(leaves(content["layout"])) == sorted(content["configById"])
    for name, panel in content["configById"].items():
        assert re.fullmatch(r"(Plot|DiagnosticSummary)!\w+", name)
        for path in panel.get("paths", []):
            assert path["enabled"] is True and path["timestampMethod"] == "headerStamp"
        assert panel.get("topicToRender", "/diagnostics") in interface.TOPICS
