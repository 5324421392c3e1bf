"""What `lab` begins once all nodes run: enabled at the first answer, reset only of what a busy start has tripped."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from rclpy.task import Future

from shake_ros.ros.graph_client import LabWatch
from shake_ros.ros.loop import ros_context
from shake_ros.ros.supervisor import LabStart

DONE = SimpleNamespace(success=True, message="")
REFUSED = SimpleNamespace(success=False, message="hydraulic interlock: waiting for reset")


class Service:
    """A service that answers at once, as it is told, and keeps count."""

    def __init__(self, *answers: Any) -> None:
        self.answers, self.asked = list(answers), 0

    def service_is_ready(self) -> bool:
        return True

    def call_async(self, _request: Any) -> Future[Any]:
        self.asked += 1
        future: Future[Any] = Future()
        future.set_result(self.answers.pop(0))
        return future


class Generator:
    """Parameters of the reference generator; `values` are those that were set."""

    def __init__(self) -> None:
        self.values: dict[str, Any] = {}

    def services_are_ready(self) -> bool:
        return True

    def set_parameters(self, parameters: list[Any]) -> Future[Any]:
        self.values |= {one.name: one.value for one in parameters}
        future: Future[Any] = Future()
        future.set_result(SimpleNamespace(results=[SimpleNamespace(successful=True, reason="")]))
        return future


@pytest.fixture
def watch(ros_domain) -> Any:
    with ros_context([], domain_id=ros_domain) as context:
        watch = LabWatch(context, "/shake", False)
        yield watch
        watch.close()


def started(watch: LabWatch, enable: Service, reset: Service, play: bool = False) -> tuple[LabStart, Generator]:
    start, generator = LabStart(watch, True, play), Generator()
    for client in start._services.values():
        client.destroy()
    start._services = {"enable": enable, "reset": reset}
    start._generator = generator  # type: ignore[assignment]
    return start, generator


def said(start: LabStart, steps: int = 6) -> list[str]:
    return [text for text in (start.go_on() for _ in range(steps)) if text]


def test_table_is_enabled_once_and_the_reference_plays_when_commands_act(watch) -> None:
    enable, reset = Service(DONE), Service()
    start, generator = started(watch, enable, reset, play=True)
    assert said(start) == []
    assert generator.values == {}
    watch.acts = True
    assert said(start) == ["commands act"]
    assert generator.values == {"play": True}
    assert (enable.asked, reset.asked) == (1, 0)


def test_what_the_start_itself_has_tripped_is_reset_once(watch) -> None:
    watch.tripped = {"sensor_missing", "deadline_overruns"}
    enable, reset = Service(REFUSED, DONE), Service(DONE)
    start, _ = started(watch, enable, reset)
    assert said(start) == [f"tripped while the nodes started: {REFUSED.message}", "reset, before any pressure"]
    assert (enable.asked, reset.asked) == (2, 1)


@pytest.mark.parametrize(
    ("tripped", "answers", "resets"),
    [({"stop"}, [REFUSED], 0), ({"sensor_missing", "stop"}, [REFUSED], 0), ({"link_loss"}, [REFUSED, REFUSED], 1)],
)
def test_anything_else_is_left_to_the_operator(watch, tripped, answers, resets) -> None:
    watch.tripped = tripped
    enable, reset = Service(*answers), Service(DONE)
    start, generator = started(watch, enable, reset, play=True)
    assert said(start)[-1] == f"not enabled: {REFUSED.message}"
    watch.acts = True
    assert said(start) == []
    assert reset.asked == resets
    assert generator.values == {}


def test_nothing_is_asked_for_that_was_not_wanted(watch) -> None:
    start = LabStart(watch, False, False)
    watch.acts = True
    assert said(start) == []


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
def test_commands_act_when_they_pass_and_their_gain_rises_no_more(watch, reports, acts) -> None:
    for passes, span in reports:
        values = [SimpleNamespace(key="passes", value=passes), SimpleNamespace(key="span", value=span)]
        status = SimpleNamespace(name="shake/plant: plant", message="", values=values, level=b"\x00")
        watch._report(SimpleNamespace(status=[status]))
    assert watch.acts is acts


def test_what_the_interlock_acts_on_is_kept_with_its_words(watch) -> None:
    trip = SimpleNamespace(name="shake/plant: interlock", message="velocity 2 beyond 1.5 m/s", values=[], level=b"\x02")
    note = SimpleNamespace(name="shake/plant: interlock", message="clock_jump", values=[], level=b"\x01")
    watch._report(SimpleNamespace(status=[note, trip]))
    assert watch.trips == ["velocity 2 beyond 1.5 m/s"]
