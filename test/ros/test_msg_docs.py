"""The pages of the messages say what the code does."""

from __future__ import annotations

from pathlib import Path

import pytest

from shake_ros.ros.interface import SERVICES, TOPICS
from shake_ros.safety.causes import ACTIONS, CAUSES

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "msg_docs"


def type_name(kind: type) -> str:
    package, form, _ = kind.__module__.split(".")[:3]
    return f"{package}/{form}/{kind.__name__}"


@pytest.mark.parametrize("topic", TOPICS.values(), ids=lambda topic: topic.name)
def test_every_topic_has_a_page_with_its_type_and_all_headings(topic) -> None:
    page = (FOLDER / f"{topic.name.strip('/')}.md").read_text(encoding="utf-8")
    assert page.startswith(f"# `{topic.name}`\n")
    assert f"`{type_name(topic.type)}`" in page
    for heading in ("frame", "stamp", "rate", "quality of service", "written by", "read by"):
        assert f"\n| {heading} | " in page
    assert ("keep all" in page) == topic.sampled


def test_page_of_the_interlock_names_every_cause_action_and_service() -> None:
    page = (ROOT / "docs" / "reference" / "interlock.md").read_text(encoding="utf-8")
    for name in (*CAUSES, *ACTIONS, *SERVICES):
        assert name in page, name
    rows = [line.split("|")[1] for line in page.splitlines() if line.startswith("| `")]
    assert {name.strip(" `") for row in rows for name in row.split(",")} == {*CAUSES, *SERVICES}


def test_index_names_every_topic_and_service() -> None:
    index = (FOLDER / "README.md").read_text(encoding="utf-8")
    for topic in TOPICS.values():
        assert f"[`{topic.name}`]({topic.name.strip('/')}.md) | `{type_name(topic.type)}`" in index
    for service in SERVICES.values():
        assert f"| `{service.name}` | {type_name(service.type)} |" in index


def test_no_page_is_of_a_topic_that_is_gone() -> None:
    recorded_only = {"force", "pressure_load"}
    pages = {path.stem for path in FOLDER.glob("*.md")} - {"README"} - recorded_only
    assert pages == {name.strip("/") for name in TOPICS}
