"""The filter behind the accelerometer is told from a delay by what the free run of a table leaves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from as_fitted import as_fitted
from hidden_table import SAMPLE_TIME, TRUE, record
from scipy.signal import lsim

from shake_ros.fit.nuisances.sensor_filter import SensorFilter, behind_filter, better_filter, filter_of
from shake_ros.fit.nuisances.sensor_pair import ALIKE, timely
from shake_ros.fit.recording_problem import RecordingProblem
from shake_ros.fit.records import Record
from shake_ros.fit.start.unknown_model import UnknownModel
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.settings import load_table

SEED, SECONDS, CUTOFF = 7, 5.0, 50.0
NATURAL = 2.0 * np.pi * CUTOFF
DELAY = np.sqrt(2.0) / NATURAL  # of the filter, slow
TABLE = load_table("bergamo").with_values(TRUE)
QUICK = record(SEED, SECONDS, noisy=False).acceleration


def filtered() -> np.ndarray:
    time = np.arange(len(QUICK)) * SAMPLE_TIME
    response = [NATURAL**2], [1.0, np.sqrt(2.0) * NATURAL, NATURAL**2]
    return lsim(response, QUICK, time)[1]


def late(acceleration: np.ndarray, delay: float) -> Record:
    """A noisy recording whose accelerometer is late, with the delay taken out as before a fit."""
    made = record(SEED, SECONDS)
    noise = 0.02 * np.random.default_rng(SEED).standard_normal(len(acceleration))
    return timely(Record("late", SAMPLE_TIME, made.commands, made.position, acceleration + noise), delay)


def better(recorded: Record, table: TableParameters = TABLE) -> SensorFilter | None:
    problem = RecordingProblem([recorded])
    return better_filter(problem, as_fitted(table, problem))


def test_filter_is_found_and_the_recording_goes_back_behind_it() -> None:
    recorded = late(filtered(), DELAY)
    found = better(recorded)
    assert found is not None
    assert found.by_filter == found.delay
    assert found.delay == pytest.approx(DELAY, rel=0.02)
    whole = SensorFilter(DELAY, DELAY)
    back = whole.applied(recorded)
    assert back.cutoff == pytest.approx(CUTOFF)
    assert back.acceleration is not None
    assert recorded.whole.sum() == back.whole.sum() - 4 and back.whole[:-1].all()
    assert back.acceleration[500:-5] == pytest.approx(filtered()[500:-5], abs=0.12)
    assert whole.applied(back) is back
    assert better(back) is None


def test_delay_that_the_sensors_do_not_show_rightly_is_found() -> None:
    recorded = SensorFilter(0.8 * DELAY, 0.8 * DELAY).applied(late(filtered(), 0.8 * DELAY))
    found = better(recorded)
    assert found is not None
    assert found.delay == pytest.approx(DELAY, rel=0.05)
    assert found.cutoff == pytest.approx(CUTOFF, rel=0.3)


def test_delay_without_a_filter_stays_one() -> None:
    behind = round(DELAY / SAMPLE_TIME)
    recorded = late(np.concatenate([np.zeros(behind), QUICK[:-behind]]), behind * SAMPLE_TIME)
    assert better(recorded) is None
    found = better(SensorFilter(recorded.delay, recorded.delay).applied(recorded))
    assert found is not None
    assert found.by_filter == 0.0
    assert found.delay == pytest.approx(recorded.delay, rel=0.02)


def test_a_table_that_is_far_off_chooses_no_filter() -> None:
    other = TABLE.with_values({"valve.damping": 0.1, "friction.coulomb_level": 3000.0})
    assert better(late(filtered(), DELAY), other) is None


def test_recording_without_a_delay_has_no_filter() -> None:
    made = record(SEED, SECONDS)
    plain = Record("plain", SAMPLE_TIME, made.commands, made.position, made.acceleration)
    assert behind_filter([plain], ALIKE) is None
    assert better(plain) is None


def test_filter_whose_delay_a_clock_makes_up_for_is_found_for_a_table_of_which_little_is_known() -> None:
    aligned = replace(late(filtered(), DELAY), delay=0.0)  # by its own clock
    assert better(aligned) is None
    problem = RecordingProblem([aligned], UnknownModel(TABLE))
    found = better_filter(problem, as_fitted(TABLE, problem))
    assert found is not None
    assert found.delay == 0.0
    assert found.cutoff == pytest.approx(CUTOFF, rel=0.05)


def test_all_of_a_delay_counts_as_a_filter_at_first() -> None:
    begun = behind_filter([late(filtered(), DELAY)], ALIKE)
    assert begun == SensorFilter(DELAY, DELAY)
    assert begun.cutoff == pytest.approx(CUTOFF)


def test_filter_survives_being_applied() -> None:
    recorded = late(filtered(), DELAY)
    for by_filter in (0.0, 0.4 * DELAY, DELAY):
        there = filter_of(SensorFilter(DELAY, by_filter).applied(recorded))
        assert (there.delay, there.by_filter) == pytest.approx((DELAY, by_filter))


def test_noise_is_that_of_the_recording_before_it_was_moved() -> None:
    made = late(filtered(), 0.0)
    jumps = np.where(np.arange(len(QUICK)) % 40 < 20, 1.0, -1.0)  # as dry friction makes them
    raw = Record("jumps", SAMPLE_TIME, made.commands, made.position, made.acceleration + jumps)
    assert timely(raw, 0.5 * SAMPLE_TIME).acceleration_noise() == raw.acceleration_noise()
