"""Normal motion trips nothing: an earthquake at full scale and a large sine under the real table's interlock."""

from __future__ import annotations

import pytest
from stepped_loop import simulate_closed_loop

from shake_ros.control.laws import CONTROLLERS
from shake_ros.control.laws.runner import Controller
from shake_ros.control.observer import OBSERVERS
from shake_ros.control.observer.runner import Observer
from shake_ros.physics.plant.table import Table
from shake_ros.recordings.reference_file import build_program
from shake_ros.safety.causes import RUN
from shake_ros.safety.interlock import Interlock
from shake_ros.settings import load_interlock, load_table, load_variant

MS = 1_000_000
SAMPLE_TIME = 0.001
START = 4000  # samples until the table runs
LENGTH = 6000


@pytest.mark.parametrize("reference", ["earthquake", "sine_50mm_1hz"])
def test_normal_motion_trips_nothing(reference) -> None:
    run = simulate_closed_loop(
        Table(load_table("bergamo"), SAMPLE_TIME, 1),
        Observer(*load_variant("observer", "sliding_mode", OBSERVERS), SAMPLE_TIME),
        Controller(*load_variant("controller", "super_twisting", CONTROLLERS), SAMPLE_TIME),
        build_program(reference, SAMPLE_TIME),
        LENGTH,
    )
    lock = Interlock(load_interlock("bergamo"), enabled=True)
    for k in range(START):
        lock.command(k * MS, 0.0)
        lock.act(k * MS)
    assert lock.stage == RUN
    for k in range(LENGTH):
        now = (START + k) * MS
        lock.observe(now, run.measured[k, 0], run.measured[k, 1], run.measured[k, 4], run.reference[k, 0])
        lock.command(now, run.command[k])
        assert lock.act(now) == run.command[k]
    assert not lock.trips
    assert max(abs(run.truth[:, 0])) > 0.03
