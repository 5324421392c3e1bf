"""Parameter files as ROS users write them: shared by several nodes, without a namespace, or dumped from a node."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
import yaml
from every_node import built

from shake_ros.entry_points import NODES
from shake_ros.quantities import UnknownName
from shake_ros.ros.frame import Behaviour
from shake_ros.ros.loop import ros_context


@contextmanager
def made(name: str, domain: int, folder: Path, *arguments: str) -> Iterator[Behaviour]:
    with ros_context([], domain_id=domain) as context:
        node = built(name, context, folder, *arguments)
        yield node
        node.finish()
        node.frame.close()


def written(path: Path, content: dict[str, Any]) -> list[str]:
    path.write_text(yaml.dump(content))
    return ["--params-file", str(path)]


def values(node: Behaviour) -> dict[str, Any]:
    return {name: parameter.value for name, parameter in node.frame.node._parameters.items()}


def dumped(node: Behaviour) -> dict[str, Any]:
    """What `ros2 param dump` writes: a name is a leaf or a mapping, not both."""
    found: dict[str, Any] = {}
    for name, value in sorted(values(node).items()):
        *folders, leaf = name.split(".")
        place = found
        for folder in folders:
            place = place.setdefault(folder, {})
            assert isinstance(place, dict), f"{name}: {folder} is a value too"
        assert leaf not in place, f"{name} is a prefix too"
        place[leaf] = value
    return {node.frame.node.get_fully_qualified_name(): {"ros__parameters": found}}


@pytest.mark.parametrize("name", NODES)
def test_what_is_dumped_and_loaded_again_is_the_same(ros_domain, tmp_path, name) -> None:
    changes = {"plant": ["supply.supply_pressure:=1.8e7", "seed:=7"], "controller": ["controller:=pid", "limit:=0.5"]}
    given = [text for change in changes.get(name, []) for text in ("-p", change)]
    with made(name, ros_domain, tmp_path, *given) as node:
        before = values(node)
        arguments = written(tmp_path / "dumped.yaml", dumped(node))
        for change in changes.get(name, []):
            parameter, _, value = change.partition(":=")
            assert str(before[parameter]) in (value, str(float(value)) if value[0].isdigit() else value)
    for path in tmp_path.glob("recorded_*"):
        path.rename(tmp_path / "moved")
    with made(name, ros_domain, tmp_path, *arguments) as node:
        assert values(node) == before


def test_parameter_of_another_node_in_a_shared_file_is_left_alone_with_a_warning(ros_domain, tmp_path, capfd) -> None:
    arguments = written(tmp_path / "all.yaml", {"/**": {"ros__parameters": {"rate": 500.0, "periods": 3}}})
    with made("observer", ros_domain, tmp_path, *arguments) as node:
        assert node.frame.loop.rate == 500.0
    assert "the shared parameter 'periods' is not a parameter of this node" in capfd.readouterr().err


@pytest.mark.parametrize("addressed", ["/shake/observer", "/**/observer_of_none"])
def test_parameter_that_only_this_node_is_given_must_be_known(ros_domain, tmp_path, addressed) -> None:
    content = {addressed: {"ros__parameters": {"peroids": 3}}}
    arguments = written(tmp_path / "one.yaml", content)
    if "none" in addressed:
        with made("observer", ros_domain, tmp_path, *arguments):
            return
    with (
        pytest.raises(UnknownName, match="unknown parameter 'peroids'"),
        made("observer", ros_domain, tmp_path, *arguments),
    ):
        pass


def test_section_without_the_namespace_is_named_with_what_to_write(ros_domain, tmp_path, capfd) -> None:
    arguments = written(tmp_path / "bare.yaml", {"observer": {"ros__parameters": {"rate": 500.0}}})
    with made("observer", ros_domain, tmp_path, *arguments) as node:
        assert node.frame.loop.rate == 1000.0
    said = capfd.readouterr().err
    assert "bare.yaml: 'observer:' is /observer; for this node write '/shake/observer:'" in said
    with made("observer", ros_domain, tmp_path, *arguments, "-r", "__ns:=/") as node:
        assert node.frame.loop.rate == 500.0
    assert "for this node write" not in capfd.readouterr().err


def test_quality_of_service_is_what_the_overrides_ask_for(ros_domain, tmp_path) -> None:
    changed = ["-p", "qos_overrides./shake/estimate.publisher.depth:=5"]
    with made("observer", ros_domain, tmp_path, *changed) as node:
        offered = {p.topic_name: p.qos_profile.depth for p in node.frame.node.publishers}
    assert offered["/shake/estimate"] == 5 and offered["/diagnostics"] == 10
    with made("observer", ros_domain, tmp_path) as node:
        assert {p.topic_name: p.qos_profile.depth for p in node.frame.node.publishers}["/shake/estimate"] == 1000


def test_lockstep_stays_lossless_whatever_the_overrides_ask_for(ros_domain, tmp_path) -> None:
    changed = ["-p", "qos_overrides./shake/estimate.publisher.reliability:=best_effort", "-p", "lockstep:=true"]
    with (
        pytest.raises(ValueError, match="in lock-step estimate is reliable and keeps all"),
        made("observer", ros_domain, tmp_path, *changed),
    ):
        pass
