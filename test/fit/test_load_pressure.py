"""The measured load pressure tells what the motion alone does not, whatever its offset.

A table that is heavier on a higher supply pressure, with all that goes with it, moves in the same way.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hidden_table import OWN, SAMPLE_TIME, SCALED, TRUE, record

from shake_ros.fit.declared_model import FULL
from shake_ros.fit.likelihood import Levels
from shake_ros.fit.model import TABLE, start_of
from shake_ros.fit.nuisances.explained_band import limited
from shake_ros.fit.prediction import Predictor
from shake_ros.fit.recording_problem import RecordingProblem
from shake_ros.fit.records import Record
from shake_ros.fit.segment import Segment
from shake_ros.fit.start.data_checks import usable_pressures
from shake_ros.fit.start.unknown_model import UnknownModel
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.settings import load_table

QUIET = Levels(force=1e-3, null_drift=1e-7, bias=1e-6, bias_drift=1e-7)
OFFSET = 3e5  # of the transducer [Pa]


@pytest.fixture(scope="module")
def recorded() -> Record:
    made = record(1, 4.0)
    return Record("run", SAMPLE_TIME, made.commands, made.position, made.acceleration, made.pressure + OFFSET)


@pytest.fixture(scope="module")
def table() -> TableParameters:
    values = TRUE | {"body.specimen_mass": 200.0, "friction.transition_velocity": OWN["sharp"]}
    return load_table("bergamo").with_values(values)


def heavier(table: TableParameters, factor: float) -> TableParameters:
    return table.with_values({name: factor**power * table.value(name) for name, power in SCALED.items()})


def likelihood(record: Record, table: TableParameters, scale: float = 1.0) -> float:
    model = start_of(table, ())
    vector = model.vectors(model.x)[0]
    vector[TABLE + 2] = scale
    return float(np.sum(Predictor([Segment.of(record)], QUIET).filtered(vector).log_likelihood()))


def test_the_pressure_tells_a_heavier_table_on_a_higher_pressure_which_its_motion_does_not(
    recorded: Record, table: TableParameters
) -> None:
    other = heavier(table, 1.1)
    alone = dataclasses.replace(recorded, pressure=None)
    assert abs(likelihood(alone, table) - likelihood(alone, other)) < 3.0
    assert likelihood(recorded, table) - likelihood(recorded, other) > 100.0
    motion, both = (
        [float(np.mean(RecordingProblem([r]).residuals(t.vector()[None, :]) ** 2)) for t in (table, other)]
        for r in (alone, recorded)
    )
    assert motion[1] == pytest.approx(motion[0], rel=0.02)
    assert both[1] > 2.0 * both[0]


def test_the_pressure_tells_it_too_where_the_table_is_compared_below_a_frequency_alone(
    recorded: Record, table: TableParameters
) -> None:
    vectors = np.array([t.vector() for t in (table, heavier(table, 1.3))])
    alone, both = (
        np.sum(RecordingProblem(limited([r], 30.0)).residuals(vectors) ** 2, axis=1)
        for r in (dataclasses.replace(recorded, pressure=None), recorded)
    )
    assert abs(alone[1] - alone[0]) < 3.0
    assert both[1] - both[0] > 30.0


def test_innovations_of_the_true_table_are_white_and_no_larger_than_the_filter_expects(
    recorded: Record, table: TableParameters
) -> None:
    vector = start_of(table, ()).vectors(np.zeros(0))[0]
    white = Predictor([Segment.of(recorded)], QUIET).filtered(vector).residuals(vector[None, :])[0].reshape(-1, 3)
    assert np.mean(white[:, 1] ** 2) == pytest.approx(1.0, abs=0.15)
    assert np.mean(white[:, 2] ** 2) < 1.1  # the class of the transducer is counted as noise beside its own
    assert abs(np.mean(white[1:, 2] * white[:-1, 2])) < 0.1 * np.mean(white[:, 2] ** 2)


def test_of_a_table_without_units_the_scale_of_its_pressures_is_free(recorded: Record, table: TableParameters) -> None:
    other = heavier(table, 0.5)
    assert likelihood(recorded, other, scale=2.0) == pytest.approx(likelihood(recorded, table), abs=3.0)
    declared, free = (
        [RecordingProblem([recorded], m).residuals(t.vector()[None, :]) for t in (table, other)]
        for m in (FULL, UnknownModel())
    )
    assert np.sum(declared[1] ** 2) > 5.0 * np.sum(declared[0] ** 2)
    assert np.sum(free[1] ** 2) == pytest.approx(np.sum(free[0] ** 2), rel=0.02)


@pytest.mark.parametrize(
    ("factor", "said"),
    [(-1.0, "pushes against the motion (chambers A and B exchanged?)"), (1e-5, "(another unit?)"), (1.0, "")],
)
def test_an_impossible_pressure_is_left_out_and_named(
    recorded: Record, table: TableParameters, factor: float, said: str
) -> None:
    assert recorded.pressure is not None
    (used,), lines = usable_pressures([dataclasses.replace(recorded, pressure=factor * recorded.pressure)], table)
    assert (used.pressure is None) == bool(said)
    assert "".join(lines).startswith("run: ") == bool(said)
    assert said in "".join(lines)
