"""Each recording of a table without a data sheet has a null shift of its own: free in a fit, the best one held out."""

from __future__ import annotations

import numpy as np
import pytest
from hidden_table import SAMPLE_TIME, TRUE, record

from shake_ros.declared import free_parameters, model_structure
from shake_ros.fit.declared_model import FULL
from shake_ros.fit.free_parameters import FreeParameters, null_shifts_of
from shake_ros.fit.least_squares import fit
from shake_ros.fit.nuisances.estimates import NuisanceEstimates, estimated_null_shifts, without_null_shifts
from shake_ros.fit.recording_problem import RecordingProblem
from shake_ros.fit.records import Record
from shake_ros.fit.start.unknown_model import UnknownModel
from shake_ros.fit.uncertainty import estimates, of_table
from shake_ros.settings import load_table

TABLE = load_table("bergamo").with_values(TRUE)
UNKNOWN = UnknownModel(TABLE)
TABLE_MASS = FULL.layout.index["body.table_mass"]
SHIFTS = (0.001, -0.002, 0.0015)  # of the valve's null in each recording; a command that makes up for it stands in it
OFFSET = "effects.valve_null_shift.offset"
GLOBAL = tuple(f for f in free_parameters(UnknownModel(TABLE, (OFFSET,))) if f.name == OFFSET)


def run(number: int) -> Record:
    made = record(6 + number, 6.0)
    commands = made.commands - SHIFTS[number]
    return Record(
        f"run{number}",
        *(SAMPLE_TIME, commands, made.position, made.acceleration),
        command_before=-SHIFTS[number],
        run=number,
    )


@pytest.fixture(scope="module")
def runs() -> list[Record]:
    return [run(number) for number in range(len(SHIFTS))]


def test_a_fit_finds_the_null_shift_of_each_recording(runs: list[Record]) -> None:
    learned, held = runs[:2], runs[2:]
    problem = RecordingProblem(learned, UNKNOWN)
    free = FreeParameters(TABLE, [*GLOBAL, *null_shifts_of(2, GLOBAL)])
    found = fit(problem, free, free.start(), evaluations=10)
    assert free.names == (OFFSET, "recording 1: null shift")
    assert found.table.value(OFFSET) == pytest.approx(SHIFTS[0], abs=2e-4)
    assert found.vector[-1] == pytest.approx(SHIFTS[1] - SHIFTS[0], abs=2e-4)
    assert found.cost < 2.0 * 0.5 * problem.noise_cost() * problem.count
    assert [e.name for e in estimates(found, problem.blocks())] == [OFFSET]  # the others are no numbers of the table

    alone = of_table(found)
    assert alone.free.names == (OFFSET,)
    whole, part = (np.linalg.inv(f.jacobian.T @ f.jacobian)[0, 0] for f in (found, alone))
    assert part == pytest.approx(whole, rel=1e-9)  # as uncertain as beside the null shifts of the others

    told = estimated_null_shifts(UNKNOWN, found, learned, held)
    assert told == {
        "run1": pytest.approx(SHIFTS[1] - SHIFTS[0], abs=2e-4),
        "run2": pytest.approx(SHIFTS[2] - SHIFTS[0], abs=2e-4),
    }
    after = [NuisanceEstimates(shifts=told).applied(r) for r in learned]
    same = without_null_shifts(found, learned, after)
    assert same.vector[-1] == pytest.approx(0.0, abs=1e-9)
    again = RecordingProblem(after, UNKNOWN).residuals(same.vector[None, :])[0]
    assert again == pytest.approx(found.residuals, abs=1e-2)


def test_a_recording_held_out_is_held_against_a_table_with_the_null_shift_that_leaves_least(runs: list[Record]) -> None:
    held = RecordingProblem(runs[2:], UNKNOWN)
    row = held.centred(TABLE.vector())
    assert row[len(TABLE.vector()) + 2] == pytest.approx(SHIFTS[2], abs=2e-4)
    plain, centred = (held.left_by_run(v)[2] for v in (TABLE.vector(), row))
    assert centred < 0.5 * plain
    assert held.errors(TABLE.vector())["run2"]["acceleration"] < 0.03


def test_where_the_tables_own_null_shift_is_known_every_recording_has_one() -> None:
    assert [f.name for f in null_shifts_of(2, ())] == ["recording 0: null shift", "recording 1: null shift"]


def test_a_declared_table_has_none(runs: list[Record]) -> None:
    problem = RecordingProblem(runs, FULL)
    assert problem.centred(TABLE.vector()) is not None
    assert np.array_equal(problem.centred(TABLE.vector()), TABLE.vector())
    assert not any("recording" in f.name for f in model_structure(TABLE).free)


def test_pieces_of_a_recording_share_its_null_shift(runs: list[Record]) -> None:
    both = [runs[1].part(slice(k, k + 2500)) for k in (0, 2500)]
    row = RecordingProblem(both, UNKNOWN).centred(TABLE.vector())
    assert row[len(TABLE.vector()) + 1] == pytest.approx(SHIFTS[1], abs=3e-4)


def test_the_null_shift_of_another_recording_changes_nothing_and_is_not_simulated(runs: list[Record]) -> None:
    rows = np.tile(np.concatenate([TABLE.vector(), np.zeros(3)]), (4, 1))
    rows[1, -1] = rows[2, -2] = 1e-3
    rows[3, TABLE_MASS] *= 1.1
    found = UNKNOWN.simulate(rows, runs[2])
    alone = [FULL.simulate(row[None, : len(TABLE.vector())], runs[2]) for row in (rows[0], rows[3])]
    for channel in range(2):
        assert np.array_equal(found[channel][2], found[channel][0])
        assert not np.allclose(found[channel][1], found[channel][0], rtol=1e-6)
        assert found[channel][0] == pytest.approx(alone[0][channel][0], abs=1e-9)
        assert found[channel][3] == pytest.approx(alone[1][channel][0], abs=1e-3 * np.std(alone[1][channel]))
