"""What `lab` begins once all nodes run, with the resets that it may, and how long an orderly stop is waited for."""

from __future__ import annotations

import time
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest
from rclpy.task import Future

from shake_ros.ros import supervisor
from shake_ros.ros.graph_client import LiveGraph, Report
from shake_ros.ros.loop import ros_context
from shake_ros.ros.supervisor import begin, stop_in_order

DONE = SimpleNamespace(success=True, message="")
REFUSED = SimpleNamespace(success=False, message="hydraulic interlock: waiting for reset")
TIMEOUT = 0.3  # [s]


def answered(answer: Any) -> Future[Any]:
    future: Future[Any] = Future()
    future.set_result(answer)
    return future


class AtOnce:
    """A service that answers at once, as it is told, and keeps count."""

    def __init__(self, *answers: Any) -> None:
        self.answers, self.asked = list(answers), 0

    def service_is_ready(self) -> bool:
        return True

    def call_async(self, _request: Any) -> Future[Any]:
        self.asked += 1
        return answered(self.answers.pop(0))


class Generator:
    """Parameters of the reference generator; `values` are those that were set."""

    values: dict[str, Any]

    def __init__(self, *_: Any) -> None:
        Generator.values = {}

    def services_are_ready(self) -> bool:
        return True

    def set_parameters(self, parameters: list[Any]) -> Future[Any]:
        self.values.update({one.name: one.value for one in parameters})
        return answered(SimpleNamespace(results=[SimpleNamespace(successful=True, reason="")]))


@pytest.fixture
def live(ros_domain, monkeypatch) -> Any:
    monkeypatch.setattr(supervisor, "AsyncParameterClient", Generator)
    Generator()
    with ros_context([], domain_id=ros_domain) as context:
        live = LiveGraph(context, "/shake")
        yield live
        live.close()


def reported(live: LiveGraph, **values: str) -> None:
    """The table's next report."""
    live.reports["plant"] = Report("shake/plant", "plant", 0, "", values)


def give(live: LiveGraph, **services: Any) -> None:
    """Stand-ins for services."""
    for name in services:
        live.services[name].destroy()
    live.services |= services


def said(start: Iterator[str], steps: int = 6) -> list[str]:
    return [text for text in (next(start, "") for _ in range(steps)) if text]


def test_table_is_enabled_once_and_the_reference_plays_when_commands_act(live) -> None:
    enable, reset = AtOnce(DONE), AtOnce()
    give(live, enable=enable, reset=reset)
    start = begin(live, True, True)
    assert said(start) == []
    assert Generator.values == {}
    for _ in range(2):
        reported(live, passes="True", span="1.000")
        text = said(start)
    assert text == ["commands act"]
    assert Generator.values == {"play": True}
    assert (enable.asked, reset.asked) == (1, 0)


def test_what_the_start_itself_has_tripped_is_reset_once(live) -> None:
    reported(live, trips="sensor_missing:1 deadline_overruns:3")
    enable, reset = AtOnce(REFUSED, DONE), AtOnce(DONE)
    give(live, enable=enable, reset=reset)
    assert said(begin(live, True, False)) == [
        f"tripped while the nodes started: {REFUSED.message}",
        "reset, before any pressure",
    ]
    assert (enable.asked, reset.asked) == (2, 1)


@pytest.mark.parametrize(
    ("trips", "answers", "resets"),
    [("stop:1", [REFUSED], 0), ("sensor_missing:1 stop:1", [REFUSED], 0), ("link_loss:1", [REFUSED, REFUSED], 1)],
)
def test_anything_else_is_left_to_the_operator(live, trips, answers, resets) -> None:
    reported(live, trips=trips, passes="True", span="1.000")
    reset = AtOnce(DONE)
    give(live, enable=AtOnce(*answers), reset=reset)
    start = begin(live, True, True)
    assert said(start)[-1] == f"not enabled: {REFUSED.message}"
    assert said(start) == []
    assert reset.asked == resets
    assert Generator.values == {}


def test_nothing_is_asked_for_that_was_not_wanted(live) -> None:
    assert said(begin(live, False, False)) == []


@pytest.mark.parametrize(
    ("reports", "acts"),
    [
        ([("True", "0.400"), ("True", "0.900")], False),
        ([("True", "0.900"), ("True", "1.000"), ("True", "1.000")], True),
        ([("True", "0.300"), ("True", "0.300")], True),
        ([("True", "0.000"), ("True", "0.000")], False),
        ([("True", "1.000"), ("False", "1.000")], False),
        ([("", ""), ("", "")], False),
    ],
)
def test_commands_act_when_they_pass_and_their_gain_rises_no_more(live, reports, acts) -> None:
    give(live, enable=AtOnce(DONE))
    start = begin(live, True, False)
    text = said(start)
    for passes, span in reports:
        reported(live, passes=passes, span=span)
        text += said(start)
    assert text == ["commands act"] * acts


def test_what_the_interlock_acts_on_is_kept_with_its_words(live) -> None:
    trip = SimpleNamespace(name="shake/plant: interlock", message="velocity 2 beyond 1.5 m/s", values=[], level=b"\x02")
    note = SimpleNamespace(name="shake/plant: interlock", message="clock_jump", values=[], level=b"\x01")
    live._on_report(SimpleNamespace(status=[note, trip]))
    assert live.trips == ["velocity 2 beyond 1.5 m/s"]


class SlowTable:
    """In the place of graph and executor: takes a sample a look, and is off after so many of them."""

    def __init__(self, live: LiveGraph, samples: int, dies_at: int = -1) -> None:
        self.live, self.samples, self.dies_at, self.taken, self.looks = live, samples, dies_at, 0, 0
        self.asked: list[bool] = []
        reported(live, stage="run", cycles="0")
        live.spin = self.spin  # type: ignore[method-assign]
        give(live, enable=self)

    def service_is_ready(self) -> bool:
        return self.looks > 2  # not at once: discovery takes a while on a busy machine

    def call_async(self, request: Any) -> None:
        self.asked.append(request.data)

    def spin(self, seconds: float) -> None:
        time.sleep(seconds)
        self.looks += 1
        if self.asked and self.taken != self.dies_at:
            self.taken += 1
            reported(self.live, stage="off" if self.taken == self.samples else "run", cycles=str(self.taken))


def test_stop_in_lockstep_is_waited_for_as_long_as_the_table_goes_on(live, monkeypatch) -> None:
    monkeypatch.setattr(supervisor, "SLOW", TIMEOUT)
    table, words = SlowTable(live, samples=20), []
    assert stop_in_order(live, TIMEOUT, lambda: words.append("slow"))
    assert table.taken == 20
    assert table.asked == [False]  # a hold and the pressure off, asked for once
    assert words == ["slow"]


@pytest.mark.parametrize(("dies_at", "lockstep"), [(5, True), (-1, False)])
def test_table_that_stands_still_or_keeps_real_time_has_the_timeout_alone(live, dies_at, lockstep) -> None:
    table = SlowTable(live, 20, dies_at)
    assert not stop_in_order(live, TIMEOUT, (lambda: None) if lockstep else None)
    assert table.asked == [False]
