"""The noise of an accelerometer comes down to what a fitted table shows of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hidden_table import ACCELERATION_NOISE, SAMPLE_TIME, TRUE, record

from shake_ros.core.identification.accelerometer import Accelerometer, residual_noise
from shake_ros.core.identification.recordings import Record, RecordingProblem, windows
from shake_ros.settings import load_table

EACH = 5  # samples of which one is kept: 200 Hz, where friction at reversals reaches up to the Nyquist frequency
TABLE = load_table("bergamo").with_values(TRUE)


def slowly(seed: int, noise: float) -> Record:
    """A recording at a fifth of the rate, its command held as long."""
    made = record(seed, 10.0, noisy=False)
    felt = made.acceleration[::EACH]
    felt = felt + noise * np.random.default_rng(seed).standard_normal(len(felt))
    commands = made.commands[: len(made.commands) // EACH * EACH].reshape(-1, EACH).mean(axis=1)
    n = min(len(commands), len(felt))
    return Record(f"run{seed}", EACH * SAMPLE_TIME, commands[:n], made.position[::EACH][:n], felt[:n])


@pytest.fixture(scope="module")
def quiet() -> Record:
    return slowly(5, 0.2 * ACCELERATION_NOISE)


def test_a_table_that_explains_the_jumps_shows_less_noise(quiet: Record) -> None:
    seen = Accelerometer().learned(RecordingProblem([quiet]), [], TABLE.vector())
    assert seen.noise["run5"] < 0.8 * quiet.acceleration_noise()
    assert seen.noise["run5"] > 0.2 * ACCELERATION_NOISE
    known = seen.seen(quiet)
    assert known.acceleration_noise() == seen.noise["run5"]
    assert RecordingProblem([known]).acceleration_weights[0] > RecordingProblem([quiet]).acceleration_weights[0]


def test_nothing_new_is_nothing(quiet: Record) -> None:
    first = Accelerometer().learned(RecordingProblem([quiet]), [], TABLE.vector())
    again = RecordingProblem([first.seen(quiet)])
    assert first.learned(again, [], TABLE.vector()) is first


def test_a_table_that_explains_nothing_shows_no_less(quiet: Record) -> None:
    still = TABLE.with_values({"valve.flow_coefficient": 1e-9})
    nothing = Accelerometer()
    assert nothing.learned(RecordingProblem([quiet]), [], still.vector()) is nothing


def test_pieces_of_a_recording_share_its_noise_and_others_have_their_own(quiet: Record) -> None:
    other = slowly(6, ACCELERATION_NOISE)
    pieces = windows([quiet, other], 10.0, 2.5)
    learned = Accelerometer().learned(RecordingProblem(pieces), [other], TABLE.vector())
    assert learned.noise["run5"] < 0.5 * other.acceleration_noise()
    seen = [learned.seen(r) for r in pieces if r.name == "run5"]
    assert len({r.acceleration_noise() for r in seen}) == 1


def test_recording_without_acceleration_is_left_alone(quiet: Record) -> None:
    bare = replace(quiet, acceleration=None)
    nothing = Accelerometer()
    assert nothing.learned(RecordingProblem([bare]), [], TABLE.vector()) is nothing


def test_a_lost_run_shows_nothing(quiet: Record) -> None:
    lost = TABLE.vector().copy()
    lost[TABLE.vector() != 0.0] = np.nan
    assert residual_noise(RecordingProblem([quiet]), lost) == np.inf
