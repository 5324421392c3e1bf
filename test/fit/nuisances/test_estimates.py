"""The noise of an accelerometer comes down to what a fitted table shows of it; null shifts are read off the table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from as_fitted import as_fitted
from hidden_table import ACCELERATION_NOISE, SAMPLE_TIME, TRUE, record

from shake_ros.fit.declared_model import FULL, DeclaredModel
from shake_ros.fit.nuisances.estimates import NuisanceEstimates, residual_noise
from shake_ros.fit.recording_problem import RecordingProblem
from shake_ros.fit.records import Record, windows
from shake_ros.fit.start.unknown_model import UnknownModel
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.settings import load_table

EACH = 5  # samples of which one is kept: 200 Hz, where friction at reversals reaches up to the Nyquist frequency
TABLE = load_table("bergamo").with_values(TRUE)
UNKNOWN = UnknownModel(TABLE)


def slowly(seed: int, noise: float) -> Record:
    """A recording at a fifth of the rate, its command held as long."""
    made = record(seed, 10.0, noisy=False)
    felt = made.acceleration[::EACH]
    felt = felt + noise * np.random.default_rng(seed).standard_normal(len(felt))
    commands = made.commands[: len(made.commands) // EACH * EACH].reshape(-1, EACH).mean(axis=1)
    n = min(len(commands), len(felt))
    return Record(f"run{seed}", EACH * SAMPLE_TIME, commands[:n], made.position[::EACH][:n], felt[:n])


def estimates(
    known: NuisanceEstimates,
    records: list[Record],
    others: Sequence[Record] = (),
    table: TableParameters = TABLE,
    model: DeclaredModel = FULL,
) -> NuisanceEstimates:
    problem = RecordingProblem(records, model)
    return known.updated(problem, others, as_fitted(table, problem))


@pytest.fixture(scope="module")
def quiet() -> Record:
    return slowly(5, 0.2 * ACCELERATION_NOISE)


def test_a_table_that_explains_the_jumps_shows_less_noise(quiet: Record) -> None:
    updated = estimates(NuisanceEstimates(), [quiet])
    assert updated.noise["run5"] < 0.8 * quiet.acceleration_noise()
    assert updated.noise["run5"] > 0.2 * ACCELERATION_NOISE
    known = updated.applied(quiet)
    assert known.acceleration_noise() == updated.noise["run5"]
    assert RecordingProblem([known]).acceleration_weights[0] > RecordingProblem([quiet]).acceleration_weights[0]


def test_nothing_new_is_nothing(quiet: Record) -> None:
    first = estimates(NuisanceEstimates(), [quiet])
    assert estimates(first, [first.applied(quiet)]) is first


def test_a_table_that_explains_nothing_shows_no_less(quiet: Record) -> None:
    still = TABLE.with_values({"valve.flow_coefficient": 1e-9})
    nothing = NuisanceEstimates()
    assert estimates(nothing, [quiet], table=still) is nothing


def test_pieces_of_a_recording_share_its_noise_and_others_have_their_own(quiet: Record) -> None:
    other = slowly(6, ACCELERATION_NOISE)
    pieces = windows([quiet, other], 10.0, 2.5)
    updated = estimates(NuisanceEstimates(), pieces, [other])
    assert updated.noise["run5"] < 0.5 * other.acceleration_noise()
    assert len({updated.applied(r).acceleration_noise() for r in pieces if r.name == "run5"}) == 1


def test_recording_without_acceleration_is_left_alone(quiet: Record) -> None:
    bare = replace(quiet, acceleration=None)
    nothing = NuisanceEstimates()
    assert estimates(nothing, [bare]) is nothing


def test_a_lost_run_shows_nothing(quiet: Record) -> None:
    lost = TABLE.vector().copy()
    lost[TABLE.vector() != 0.0] = np.nan
    assert residual_noise(RecordingProblem([quiet]), lost) == np.inf


def shifted(by: float) -> Record:
    made = record(6, 10.0)
    commands = made.commands + by
    return Record("run6", SAMPLE_TIME, commands, made.position, made.acceleration, command_before=by)


def test_null_shift_is_that_at_which_the_table_has_the_measured_mean_velocity() -> None:
    moved = shifted(0.01)
    known = estimates(NuisanceEstimates(), [moved], model=UNKNOWN)
    assert known.shifts["run6"] == pytest.approx(-0.01, rel=0.03)
    updated = known.applied(moved)
    assert updated.commands == pytest.approx(shifted(0.0).commands, abs=3e-4)
    assert updated.command_before == pytest.approx(0.0, abs=3e-4)
    assert known.applied(updated) is updated
    assert estimates(known, [updated], model=UNKNOWN).shifts == known.shifts


def test_a_declared_table_has_no_null_shifts_of_single_runs() -> None:
    assert estimates(NuisanceEstimates(), [shifted(0.01)]).shifts == {}
