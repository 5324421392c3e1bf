"""From slow to fast: where ringing makes a maze of a sum of squares, what lies below it leads to the solution."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from shake_ros.fit.free_parameters import FreeParameters, free_parameter
from shake_ros.fit.least_squares import Fit, fit, within_budget
from shake_ros.fit.recording_problem import RecordingProblem
from shake_ros.fit.records import Record
from shake_ros.fit.start import narrow_valleys
from shake_ros.fit.start.narrow_valleys import FRICTION, from_slow_to_fast
from shake_ros.physics.plant.parameters import INDEX
from shake_ros.physics.plant.simulation import run
from shake_ros.settings import load_table
from shake_ros.signals.velocity_filter import low_pass

GAP, ROD = "effects.coupling_backlash.gap", "effects.coupling_backlash.rod_mass"
TABLE = load_table("bergamo").with_values({GAP: 5e-5, ROD: 30.0})
SAMPLE = 1e-3
TIME = SAMPLE * np.arange(4000)
TRUE = {GAP: 1.3e-4, ROD: 45.0}


class Ringing:
    """A slow motion as large as the gap, and ringing whose phase turns eight times with it."""

    def __init__(self, band: float = np.inf) -> None:
        self.band = band
        self.difference = None if band == np.inf else 5e-2

    def below(self, band: float, _difference: float) -> Ringing:
        return Ringing(band)

    def motion(self, gap: Any, rod: Any) -> np.ndarray:
        ringing = np.sin(2.0 * np.pi * (90.0 * TIME + 8.0 * gap / 1e-4))
        ringing = ringing + np.sin(2.0 * np.pi * (150.0 * TIME + 0.7 * rod / 30.0))
        return np.asarray(gap / 1e-4 * np.sin(2.0 * np.pi * 2.0 * TIME) + 0.5 * ringing)

    def residuals(self, vectors: np.ndarray) -> np.ndarray:
        left = self.motion(vectors[:, [INDEX[GAP]]], vectors[:, [INDEX[ROD]]]) - self.motion(*TRUE.values())
        return left if self.band == np.inf else low_pass(left, SAMPLE, self.band)


def free_ones() -> FreeParameters:
    given = {GAP: {"scale": 1e-4, "low": 1e-6}, ROD: {"scale": 10.0, "low": 5.0, "high": 150.0}}
    return FreeParameters(TABLE, [free_parameter(n, c, "here") for n, c in given.items()])


def test_a_ringing_maze_is_left_by_its_slow_part() -> None:
    problem: Any = Ringing()
    free = free_ones()
    lost = fit(problem, free, free.start(), evaluations=60, tolerance=1e-6)
    assert abs(lost.table.value(GAP) - TRUE[GAP]) > 0.1 * TRUE[GAP]
    found = free.table(from_slow_to_fast(problem, free, free.start(), [ROD, GAP]))
    assert found.value(GAP) == pytest.approx(TRUE[GAP], rel=2e-3)
    assert found.value(ROD) == pytest.approx(TRUE[ROD], rel=0.02)


def test_the_slow_part_leaves_the_rod_s_mass_where_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    problem: Any = Ringing()
    free = free_ones()
    moved = list[tuple[str, ...]]()

    def short(band_limited: Any, free: FreeParameters, x: np.ndarray, **options: Any) -> Fit:
        moved.append(free.names)
        return fit(band_limited, free, x, **options)

    monkeypatch.setattr(narrow_valleys, "fit", short)
    from_slow_to_fast(problem, free, free.start(), [ROD, GAP])
    assert moved == [(GAP,), (GAP, ROD), (GAP, ROD)]


def test_when_the_time_is_over_the_start_is_taken_as_it_is() -> None:
    free = free_ones()
    problem: Any = Ringing()
    with within_budget(lambda: True):
        found = from_slow_to_fast(problem, free, free.start(), [ROD, GAP])
    assert found.tolist() == free.start().tolist()


class Stribeck:
    """Friction of a slow and a fast part, whose rise a fit has bent to one that reaches far."""

    speed = np.linspace(1e-3, 0.3, 200)

    def below(self, _band: float, _difference: float) -> Stribeck:
        return self

    def residuals(self, vectors: np.ndarray) -> np.ndarray:
        level, rise, decay = (vectors[:, [INDEX[name]]] for name in FRICTION)
        force = level + rise * np.exp(-decay * self.speed)
        # a slow decay leaves what no slope tells of
        return np.asarray(force - 450.0 - 220.0 * np.exp(-45.0 * self.speed)) + 80.0 * np.cos(40.0 * self.speed) * (
            decay < 25.0
        )


def test_friction_is_split_anew() -> None:
    scales = dict(zip(FRICTION, (20.0, 20.0, 5.0), strict=True))
    free = FreeParameters(TABLE, [free_parameter(name, {"scale": scale}, "here") for name, scale in scales.items()])
    problem: Any = Stribeck()
    bent = free.x_of(dict(zip(FRICTION, (60.0, 600.0, 4.0), strict=True)))
    stuck = fit(problem, free, bent, evaluations=40, tolerance=1e-6)
    assert stuck.cost > 1e3
    found = free.table(from_slow_to_fast(problem, free, bent, []))
    assert [found.value(name) for name in FRICTION] == pytest.approx([450.0, 220.0, 45.0], rel=0.02)


def test_residuals_below_a_band_are_those_of_each_signal_through_the_low_pass() -> None:
    commands = 0.02 * np.sin(2.0 * np.pi * 3.0 * TIME[:1500])
    table = load_table("bergamo")
    out = run(table, commands, SAMPLE)
    noise = np.random.default_rng(1).standard_normal((2, len(commands)))
    record = Record("run", SAMPLE, commands, out[:, 0] + 1e-6 * noise[0], out[:, 2] + 0.05 * noise[1])
    problem = RecordingProblem([record])
    rows = np.array([table.vector(), table.with_values({"friction.viscous": 900.0}).vector()])
    whole, slow = problem.residuals(rows), problem.below(40.0, 0.05).residuals(rows)
    count = whole.shape[1] // 2
    for part in (slice(0, count), slice(count, None)):
        assert slow[:, part] == pytest.approx(low_pass(whole[:, part], SAMPLE, 40.0))
    assert problem.below(500.0, 0.05).residuals(rows) == pytest.approx(whole)
