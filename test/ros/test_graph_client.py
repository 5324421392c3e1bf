"""How long an orderly stop is waited for."""

from __future__ import annotations

import time
from typing import Any

import pytest

from shake_ros.ros.graph_client import LabWatch
from shake_ros.ros.loop import ros_context

TIMEOUT = 0.3  # [s]


class SlowTable:
    """In the place of graph and executor: takes a sample a look, and is off after so many of them."""

    def __init__(self, watch: LabWatch, samples: int, dies_at: int = -1) -> None:
        self.watch, self.samples, self.dies_at, self.taken, self.looks = watch, samples, dies_at, 0, 0
        self.asked: list[bool] = []
        watch.stage = "run"
        watch.spin = self.spin  # type: ignore[method-assign]
        watch._enable.destroy()
        watch._enable = self

    def service_is_ready(self) -> bool:
        return self.looks > 2  # not at once: discovery takes a while on a busy machine

    def call_async(self, request: Any) -> None:
        self.asked.append(request.data)

    def spin(self, seconds: float) -> None:
        time.sleep(seconds)
        self.looks += 1
        if self.asked and self.taken != self.dies_at:
            self.taken += 1
            self.watch.cycles = str(self.taken)
            self.watch.stage = "off" if self.taken == self.samples else "run"


@pytest.fixture
def watch(ros_domain) -> Any:
    with ros_context([], domain_id=ros_domain) as context:
        watch = LabWatch(context, "/shake", True)
        yield watch
        watch.close()


def test_stop_in_lockstep_is_waited_for_as_long_as_the_table_goes_on(watch, monkeypatch) -> None:
    monkeypatch.setattr("shake_ros.ros.graph_client.SLOW", TIMEOUT)
    table, said = SlowTable(watch, samples=20), []
    assert watch.stop_in_order(TIMEOUT, lambda: said.append("slow"))
    assert table.taken == 20
    assert table.asked == [False]  # a hold and the pressure off, asked for once
    assert said == ["slow"]


@pytest.mark.parametrize(("dies_at", "lockstep"), [(5, True), (-1, False)])
def test_table_that_stands_still_or_keeps_real_time_has_the_timeout_alone(watch, dies_at, lockstep) -> None:
    table = SlowTable(watch, 20, dies_at)
    assert not watch.stop_in_order(TIMEOUT, (lambda: None) if lockstep else None)
    assert table.asked == [False]
