"""Slow changes of a force-driven axis: each recording's own level of friction, offset and drift, beside one axis."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shake_ros.fit.axis_model import (
    AXIS,
    DRIFT,
    LEVEL,
    OFFSET,
    changed,
    force_error,
    forecast_errors,
    position_errors,
    with_slow_changes,
)
from shake_ros.fit.recording_problem import RecordingProblem
from shake_ros.fit.records import Record, windows
from shake_ros.physics.effects.unlisted import FORCE_OF_VELOCITY, FRICTION_OF_POSITION, NODES
from shake_ros.physics.plant.axis import AXIS_LAYOUT
from shake_ros.physics.plant.parameters import TableParameters

NUMBERS = {"mass": 95.0, "viscous": 200.0, "coulomb": 20.0, "offset": -1.0}
TRUE = AXIS_LAYOUT.table({"axis": NUMBERS}, "axis")
DT, LENGTH = 1e-3, 12000
TIME = DT * np.arange(LENGTH)
FORCE = 50.0 * np.sin(2.0 * np.pi * 0.35 * TIME) + 40.0 * np.sin(2.0 * np.pi * 1.1 * TIME)


def by_euler(level: float, offset: float, drift: float) -> np.ndarray:
    """Positions of an axis in small explicit steps, written here alone: sticks where dry friction can hold it."""
    x = v = 0.0
    positions, parts = np.empty(LENGTH), 10
    h = DT / parts
    for i, force in enumerate(FORCE):
        positions[i] = x
        net = force + 1.0 - offset - drift * (TIME[i] - 0.5 * (TIME[0] + TIME[-1]))
        for _ in range(parts):
            dry = 20.0 * level
            free = v + h * (net - 200.0 * level * v) / 95.0
            new = 0.0 if abs(free) <= h * dry / 95.0 else free - np.copysign(h * dry / 95.0, free)
            x, v = x + 0.5 * h * (v + new), new
    return positions


@pytest.fixture(scope="module")
def pair() -> tuple[Record, Record]:
    first, second = (Record(n, DT, FORCE, by_euler(*own)) for n, *own in (("a", 1, 0, 0.06), ("b", 1.04, 0.15, -0.05)))
    (learned,), (held,) = with_slow_changes([first], [second])
    return learned, held


def test_a_recording_tells_its_level_offset_and_drift(pair: tuple[Record, Record]) -> None:
    first, second = (AXIS.slow_change(TRUE, record) for record in pair)
    assert (first.level, first.offset) == (1.0, 0.0)
    assert first.drift == pytest.approx(0.06, abs=2e-3)
    assert second.level == pytest.approx(1.04, abs=1e-3)
    assert second.offset == pytest.approx(0.15, abs=0.01)
    assert second.drift == pytest.approx(-0.05, abs=2e-3)


def test_with_them_the_free_run_follows_and_from_the_force_alone_it_does_not(pair: tuple[Record, Record]) -> None:
    for record in pair:
        assert position_errors(TRUE, [record])[record.name] < 1e-4
        assert forecast_errors(TRUE, [record])[record.name] > 2e-3


def test_they_do_not_hide_another_mass(pair: tuple[Record, Record]) -> None:
    heavier = TRUE.with_values({"axis.mass": 105.0})
    for record in pair:
        assert position_errors(heavier, [record])[record.name] > 5e-4


def test_only_the_first_recording_learned_from_sets_the_level() -> None:
    record = Record("first", DT, FORCE, np.zeros(LENGTH))
    learned, held = with_slow_changes([record, replace(record, name="second")], [replace(record, name="held")])
    assert [r.own for r in learned] == [(DRIFT,), (DRIFT, LEVEL, OFFSET)]
    assert [r.own for r in held] == [(DRIFT, LEVEL, OFFSET)]


def test_neither_short_recordings_nor_pieces_have_any() -> None:
    record = Record("short", DT, FORCE[:9000], np.zeros(9000))
    (short,), _ = with_slow_changes([record], [])
    assert short.own == ()
    (long,), _ = with_slow_changes([Record("long", DT, FORCE, np.zeros(LENGTH))], [])
    assert all(piece.own == () for piece in windows([long], 5.0))


def test_the_level_scales_a_function_of_velocity_as_friction() -> None:
    linear = np.linspace(-0.5, 0.5, NODES)
    nodes = {f"effects.unlisted.node_{i:02d}": 100.0 * v for i, v in enumerate(linear)}
    kind = {"effects.unlisted.kind": FORCE_OF_VELOCITY, "effects.unlisted.low": -0.5, "effects.unlisted.high": 0.5}
    table = TRUE.with_values({"axis.viscous": 100.0, **kind, **nodes})
    record = Record("b", DT, FORCE, by_euler(1.04, 0.0, 0.0), own=(LEVEL,))
    assert AXIS.slow_change(table, record).level == pytest.approx(1.04, abs=2e-3)


def test_the_level_scales_what_a_second_quantity_changes_of_friction() -> None:
    table = TRUE.with_values({"effects.unlisted.kind": FRICTION_OF_POSITION, "effects.unlisted.above_3": 10.0})
    record = Record("b", DT, FORCE, np.zeros(LENGTH), own=(LEVEL,))
    (vector,), _ = changed(table.vector()[None, :], record, (LEVEL,), np.array([[0.1]]))
    assert vector[AXIS_LAYOUT.index["effects.unlisted.above_3"]] == pytest.approx(11.0)


def test_the_position_of_an_axis_is_fitted_with_its_velocity(pair: tuple[Record, Record]) -> None:
    learned, _ = pair
    problem = RecordingProblem([learned], AXIS)
    residuals = problem.residuals(TRUE.vector()[None, :])
    n = LENGTH - learned.start
    assert residuals.shape == (1, 2 * n) == (1, problem.count)
    assert len(problem.blocks()) == len(problem.times()) == 2 * n
    position = AXIS.run(TRUE, learned)[learned.start :, 0]
    wanted = problem.position_weights[0] * (position - learned.position[learned.start :])
    assert residuals[0, n:] == pytest.approx(wanted, abs=1e-9)


def staircase(held_at: float) -> TableParameters:
    """TRUE with steps of its friction that hold the velocity near some values, whatever the force."""
    v = np.linspace(-0.3, 0.3, NODES)
    nodes = {f"effects.unlisted.node_{i:02d}": float(held_at * (-1) ** i) for i in range(len(v))}
    kind = {"effects.unlisted.kind": FORCE_OF_VELOCITY, "effects.unlisted.low": v[0], "effects.unlisted.high": v[-1]}
    return TRUE.with_values({**kind, **nodes})


def test_the_force_along_the_measured_motion_contradicts_steps_of_friction(pair: tuple[Record, Record]) -> None:
    records = list(pair)
    assert force_error(TRUE, records) < 0.2 * force_error(staircase(15.0), records)
    assert AXIS.contradicted(TRUE, staircase(15.0), records)
    assert not AXIS.contradicted(TRUE.with_values({"axis.viscous": 150.0}), TRUE, records)
