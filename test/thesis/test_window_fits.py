"""The neural schedule of 6.3.5: what its window sees, and its two blind seconds."""

from __future__ import annotations

import numpy as np
import pytest

from shake_ros.fit.declared_model import FULL
from shake_ros.fit.free_parameters import FreeParameters, free_parameter
from shake_ros.fit.records import Record
from shake_ros.settings import load_table
from shake_ros.thesis.network import (
    HOP,
    WINDOW,
    Network,
    dominant,
    run_scheduled,
    schedule_of,
)

SMALL = (6, 6)  # hidden neurons


@pytest.mark.parametrize(("amplitude", "frequency"), [(0.1, 1.5), (0.45, 3.3), (0.9, 11.0)])
def test_the_window_gives_amplitude_and_frequency_of_a_sine(amplitude: float, frequency: float) -> None:
    u = amplitude * np.sin(2.0 * np.pi * frequency * np.arange(2000) * 1e-3 + 0.4)
    assert dominant(u, 1e-3) == pytest.approx((amplitude, frequency), rel=0.02)


def network(outputs: int = 2, seed: int = 1) -> Network:
    weights = np.random.default_rng(seed).standard_normal(Network.size(outputs, SMALL))
    return Network(weights, np.zeros(2), np.ones(2), np.full(outputs, 1.0), np.full(outputs, 0.1), SMALL)


def test_the_schedule_is_blind_for_the_first_window_and_sees_a_change_late() -> None:
    table = load_table("bergamo")
    names = {"friction.viscous": {"scale": 1.0}, "friction.coulomb_level": {"scale": 1.0}}
    free = FreeParameters(table, [free_parameter(n, c, "here") for n, c in names.items()])
    time = np.arange(8000) * 1e-3
    command = np.where(time < 4.0, 0.1, 0.2) * np.sin(4.0 * np.pi * time)
    rows, acting = schedule_of(network(), free, Record("run", 1e-3, command, 0.01 * command))
    assert set(acting[:2000]) == {0}
    assert rows[0] == pytest.approx([1.0, 1.0])
    settled = rows[acting[3900]]
    assert rows[acting[4050]] == pytest.approx(settled, rel=1e-2)  # just after the change: not yet seen
    last = rows[acting[round((4.0 + WINDOW + 2.0 * HOP) * 1000)]]
    assert last == pytest.approx(rows[-1], rel=1e-2)  # a window later: seen whole
    assert np.max(np.abs(last - settled)) > 1e-3


def test_a_schedule_that_never_changes_runs_as_the_table_itself() -> None:
    table = load_table("bergamo")
    free = FreeParameters(table, [free_parameter("friction.viscous", {"scale": 1.0}, "here")])
    command = 0.2 * np.sin(4.0 * np.pi * np.arange(2500) * 1e-3)
    record = Record("run", 1e-3, command, 0.01 * command, moved=False)
    constant = Network(np.zeros(Network.size(1)), np.zeros(2), np.ones(2), np.array([2.0]), np.ones(1))
    assert np.array_equal(run_scheduled(constant, free, record), FULL.run(free.table(np.array([2.0])), record))
