"""The test for a change on windows whose evidence is drawn from a known distribution."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from named_changes import LEAKAGE, change

from shake_ros.fit.records import Record
from shake_ros.twin.change import NormalSquare, alarm, threshold, windows_since
from shake_ros.twin.evidence import KnownState, WindowEvidence

P, WALK, EXACT = 3, np.full(3, 1e-6), np.zeros(3)
NORMAL = NormalSquare(0.0, 0.1, 9)
NONE = Record("none", 1e-3, np.zeros(64), np.zeros(64))


def windows(count: int, jump: np.ndarray, since: int, seed: int) -> list[tuple[KnownState, WindowEvidence]]:
    """Windows whose parameters are zero, and `jump` from number `since` on; zero was known well before."""
    rng = np.random.default_rng(seed)
    known, found = KnownState(np.zeros(P), 1e-4 * np.eye(P)), []
    for k in range(count):
        rows = rng.normal(size=(40, P))
        information = rows.T @ rows
        truth = jump if k >= since else np.zeros(P)
        vector = information @ truth + rows.T @ rng.normal(size=40)
        found.append((known, WindowEvidence(NONE, information, vector, 1.0, 40, np.zeros((0, 5)))))
    return found


def alarms(history: list[tuple[KnownState, WindowEvidence]], limit: float) -> list[int]:
    return [k for k in range(1, len(history) + 1) if alarm(history[:k], WALK, 1.0, NORMAL, limit, P, EXACT)]


def test_a_table_without_change_raises_no_more_alarms_than_were_allowed() -> None:
    limit = threshold(20.0, 2.0, P + 1)  # twenty an hour
    hours = [windows(90, np.zeros(P), 90, seed) for seed in range(20)]  # of 90 windows, an hour in all
    assert sum(bool(alarms(history, limit)) for history in hours) <= 20 + 2 * np.sqrt(20)


def test_a_jump_is_noticed_at_once_and_its_instant_is_found() -> None:
    history = windows(24, np.array([0.0, 1.5, 0.0]), 20, 1)
    limit = threshold(0.01, 2.0, P + 1)
    assert alarms(history, limit)[0] == 21
    found = alarm(history, WALK, 1.0, NORMAL, limit, P, EXACT)
    assert found is not None
    assert found.parameter == 1
    assert windows_since(history, found, 1.0, np.full(P, 10.0)) == 4


def test_what_no_parameter_explains_is_noticed_by_the_innovations() -> None:
    history = windows(10, np.zeros(P), 10, 2)
    grown = [(k, WindowEvidence(NONE, w.information, w.vector, 4.0, 40, w.motion)) for k, w in history]
    found = alarm(grown, WALK, 1.0, NORMAL, threshold(0.01, 2.0, P + 1), P, EXACT)
    assert found is not None
    assert found.parameter == -1


def test_a_change_that_does_not_matter_is_no_alarm_however_well_it_is_known() -> None:
    history = windows(24, np.array([0.0, 1.5, 0.0]), 20, 1)
    limit = threshold(0.01, 2.0, P + 1)
    assert alarm(history, WALK, 1.0, NORMAL, limit, P, np.array([0.0, (1.2 / limit) ** 2, 0.0])) is not None
    assert alarm(history, WALK, 1.0, NORMAL, limit, P, np.array([0.0, (2.0 / limit) ** 2, 0.0])) is None


def test_the_share_of_a_change_is_what_its_name_explains_or_what_was_not_there_before() -> None:
    found = replace(change(LEAKAGE).named, error=(0.04, 0.05, 0.03))
    assert found.share == pytest.approx(0.04)
    unnamed = replace(found, explained=False)
    assert unnamed.share == pytest.approx(0.03)
    assert replace(unnamed, changed=False).share == 0.0


def test_an_interval_holds_every_answer_as_likely_as_it_is() -> None:
    def at(x: float, evidence: float) -> Any:
        model = cast("Any", SimpleNamespace(x=np.array([x])))
        return replace(LEAKAGE, model=model, covariance=np.array([[0.01]]), evidence=evidence)

    named = change(at(0.0, 9.0), at(1.0, 9.0)).named
    assert named.covariance(1)[0, 0] == pytest.approx(0.01 + 0.5)
    assert replace(named, rivals=()).covariance(1)[0, 0] == pytest.approx(0.01)
    assert replace(named, rivals=(at(1.0, -30.0),)).covariance(1)[0, 0] == pytest.approx(0.01)
