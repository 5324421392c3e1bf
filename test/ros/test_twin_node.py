"""The twin beside a recording that is played: the numbers of `follow`, its messages, its end."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from named_changes import LEAKAGE, SECOND, SENSOR, change, idle_twin, twin_window
from rclpy.node import Node

import shake_ros as sr
from benchmarks.discovery import hidden_tables as hidden
from shake_ros.page.library import Library
from shake_ros.page.samples import Prediction, SampleStore
from shake_ros.recordings.bags import write_table_recording
from shake_ros.ros import interface
from shake_ros.ros.frame import Frame
from shake_ros.ros.loop import ros_context
from shake_ros.ros.page_desk import PageDesk
from shake_ros.ros.twin_node import Instants
from shake_ros.settings import load_table, save_table
from shake_ros.twin.follow import follow
from shake_ros.twin.twin import INTERVAL

from .recording_processes import own_node, process, spin_until

TRUTH = hidden.declared_truth(71)
TABLE = load_table("bergamo").with_values({name: getattr(TRUTH, field) for name, field in hidden.DECLARED.items()})
SECONDS, FROZEN = 7.6, slice(6500, 7200)
SETTINGS = "{window: 1.0, reference: 5.0, false_alarms: 0.01, naming: 4.0, matters: 0.02, parameters: {%s}}"


def played(path: Path) -> Path:
    """A recording of seven windows; in the last the accelerometer is frozen."""
    rng = np.random.default_rng(5)
    made = hidden.record(TRUTH, hidden.multisine(SECONDS, 1, 0.5, 8.0, 0.2, rng), 1.0, rng, 20)
    made["acceleration"][FROZEN] = made["acceleration"][FROZEN.start]
    time = np.arange(len(made["command"])) * hidden.SAMPLE
    return write_table_recording(path, time, made["command"], made["position"], made["acceleration"])


class Ear:
    """Messages of one topic."""

    def __init__(self, node: Node, topic: interface.Topic) -> None:
        self.messages: list[Any] = []
        node.create_subscription(topic.type, topic.name, self.messages.append, interface.REALTIME_RECORDER_QOS)


def number(status: DiagnosticStatus, key: str) -> float:
    return float({item.key: item.value for item in status.values}[key])


def test_a_recording_that_is_played_gives_the_numbers_of_follow_and_the_twin_ends_with_it(ros_domain, tmp_path) -> None:
    bag, settings, table = played(tmp_path / "run"), tmp_path / "twin.yaml", tmp_path / "table.yaml"
    kinds = "bulk_modulus.modulus: {file: 0.1, walk: 0.1}, valve.flow_coefficient: {file: 0.05, walk: 0.01}"
    settings.write_text(SETTINGS % kinds, encoding="utf-8")
    save_table(table, TABLE, "of a test")
    found = follow(sr.read(bag), str(table), settings=str(settings), progress=False)
    predicted = np.concatenate([w.motion for w in found.latest])
    with own_node(ros_domain) as node:
        states, position, imu = (
            Ear(node, t) for t in (interface.TWIN, interface.PREDICTED_JOINT_STATES, interface.PREDICTED_IMU)
        )
        with process("twin", table=str(table), settings=str(settings)) as twin:
            waits = "joint_states:1 imu:1 valve_command:1"
            with process("player", input=str(bag), wait_for=waits, speed=0.5) as player:
                wanted = [len(found.windows), len(predicted), len(predicted)]
                ears = (states, position, imu)
                spin_until(node, lambda: [len(e.messages) for e in ears] == wanted, "windows and predictions", 240.0)
                assert player.wait(30) == 0
            assert twin.wait(60) == 0
    for message, window in zip(states.messages, found.windows, strict=True):
        table_status, *parameters = message.status
        assert {item.key: item.value for item in table_status.values}["state"] == window.state
        assert [number(s, "value") for s in parameters] == window.values.tolist()
        assert [number(s, "high") for s in parameters] == (window.values + INTERVAL * window.deviations).tolist()
    paused = states.messages[-1].status[0]
    assert (paused.level, found.windows[-1].state) == (DiagnosticStatus.WARN, "paused")
    assert "the acceleration stands still" in paused.message
    assert [m.position[0] for m in position.messages] == predicted[:, 0].tolist()
    assert [m.linear_acceleration.x for m in imu.messages] == predicted[:, 2].tolist()


def test_an_instant_that_lacks_a_topic_is_left_out_and_order_does_not_matter() -> None:
    instants = Instants()
    assert instants.add(1, 10, 0.1) == []
    assert instants.add(0, 10, 0.2) == []
    assert instants.add(2, 10, 0.3) == [(10, [0.2, 0.1, 0.3])]
    for place, stamp in ((0, 20), (1, 20), (0, 30), (1, 30)):
        assert instants.add(place, stamp, 1.0) == []
    assert instants.add(2, 30, 2.0) == [(30, [1.0, 1.0, 2.0])]


def test_light_changes_and_curves_reach_the_page(ros_domain, tmp_path) -> None:
    with ros_context([], domain_id=ros_domain) as context:
        frame, twin = Frame("page", context, ["--ros-args"]), idle_twin(context)
        desk = PageDesk(frame, SampleStore(frame.period, Prediction(frame.sample_time, None)), Library(tmp_path), None)

        def shown(**of_window: Any) -> tuple[int, str]:
            """Level and words of the light once the page has a window."""
            count = len(desk.twin()["time"])
            twin._publish(twin_window(**of_window))
            spin_until(frame.node, lambda: len(desk.twin()["time"]) > count, "the window")
            before = desk.status()["nodes"].get("twin", {}).get("heard", 0.0)
            twin.frame.diagnostics.publish()
            spin_until(frame.node, lambda: desk.status()["nodes"].get("twin", {}).get("heard", 0.0) > before, "light")
            node = desk.status()["nodes"]["twin"]
            return node["level"], node["message"]

        spin_until(frame.node, lambda: twin._publisher.get_subscription_count() > 0, "the page's subscription")
        assert shown()[0] == 0
        assert shown(note="no samples for 3.00 s") == (1, "paused: no samples for 3.00 s")
        level, words = shown(found=change(LEAKAGE))
        assert (level, words[:29]) == (1, "leakage.internal × 2.00 (1.84")
        later = replace(change(SENSOR, explained=False), since=4 * SECOND)
        assert shown(found=later)[0] == 2
        assert shown()[0] == 2  # the light stays
        assert [one["level"] for one in desk.twin()["changes"]] == [1, 2]
        assert desk.twin()["changes"][0]["since"] == 3.0
        (curve,) = desk.twin()["parameters"]
        assert curve["value"] == [0.6] * 5
        twin.frame.diagnostics.event("release", 0, "released to the loop: leakage.internal × 2", {})
        spin_until(frame.node, lambda: desk.status()["release"], "the release")
        assert desk.status()["release"] == "released to the loop: leakage.internal × 2"
        assert desk.status()["nodes"]["twin"]["part"] == "twin"  # an event is not the node's report
