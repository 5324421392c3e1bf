"""Changes in words: which ask for action before the next test, and what is to be done."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import pytest
from named_changes import LEAKAGE, SENSOR, change, hypothesis

from shake_ros.declared import effect_candidates
from shake_ros.twin.follow import Following
from shake_ros.twin.naming import PLACES
from shake_ros.twin.page import ACTIONS, _lead, action_text, asks_for_action, change_text

SPECIMEN = hypothesis("specimen.frequency", "structure")


@pytest.mark.parametrize(
    ("answers", "action"),
    [((LEAKAGE,), False), ((SENSOR,), True), ((SENSOR, SPECIMEN), True), ((SENSOR, LEAKAGE), False)],
)
def test_a_fault_asks_for_action_and_wear_does_not_nor_what_may_be_wear(answers, action) -> None:
    assert asks_for_action(change(*answers)) is action


def test_what_nothing_explains_asks_for_action_at_its_place() -> None:
    found = change(LEAKAGE, explained=False)
    assert asks_for_action(found)
    assert "look at the flow" in action_text(found)
    assert "with it" not in change_text(found)


def test_each_answer_that_is_possible_has_its_action_once() -> None:
    found = change(SENSOR, LEAKAGE, hypothesis("sensor.bias", "sensor"))
    assert action_text(found) == f"{ACTIONS['sensor']}; {ACTIONS['flow']}"


def test_every_place_that_a_change_may_have_has_an_action() -> None:
    assert {c.place for c in effect_candidates()} | set(PLACES.values()) <= set(ACTIONS)


def test_the_page_leads_with_how_many_changes_have_which_cause() -> None:
    several = [change(LEAKAGE), change(SENSOR, LEAKAGE), change(SENSOR, SPECIMEN)]
    found = cast(Following, SimpleNamespace(changes=several))
    assert _lead(found) == (
        "3 changes have been noticed since the reference: 1 with an established cause, 2 with several possible causes."
    )
    found = cast(Following, SimpleNamespace(changes=[change(LEAKAGE, explained=False)]))
    assert _lead(found) == "1 change has been noticed since the reference: 1 with no known cause."
