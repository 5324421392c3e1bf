"""The filter behind the accelerometer is told from a delay by what the free run of a table leaves."""

from __future__ import annotations

import numpy as np
import pytest
from hidden_table import SAMPLE_TIME, TRUE, record
from scipy.signal import lsim

from shake_ros.core.identification.recordings import Record, RecordingProblem
from shake_ros.core.identification.sensor_pair import better_filter, through_filter, timely
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


def better(seen: Record) -> float | None:
    return better_filter(RecordingProblem([seen]), TABLE.vector())


def test_filter_is_found_and_the_recording_goes_back_behind_it() -> None:
    seen = late(filtered(), DELAY)
    assert better(seen) == 1.0
    back = through_filter(seen, 1.0)
    assert back.cutoff == pytest.approx(CUTOFF)
    assert back.acceleration is not None
    assert back.blind == 5
    assert back.acceleration[500:-5] == pytest.approx(filtered()[500:-5], abs=0.12)
    assert through_filter(back, 1.0) is back
    assert better(back) is None


def test_delay_without_a_filter_stays_one() -> None:
    behind = round(DELAY / SAMPLE_TIME)
    seen = late(np.concatenate([np.zeros(behind), QUICK[:-behind]]), behind * SAMPLE_TIME)
    assert better(seen) is None
    assert better(through_filter(seen, 1.0)) == 0.0


def test_a_table_that_is_far_off_chooses_no_filter() -> None:
    other = TABLE.with_values({"valve.flow_coefficient": 1.3 * TRUE["valve.flow_coefficient"]})
    assert better_filter(RecordingProblem([late(filtered(), DELAY)]), other.vector()) is None


def test_recording_without_a_delay_has_no_filter() -> None:
    made = record(SEED, SECONDS)
    assert better(Record("plain", SAMPLE_TIME, made.commands, made.position, made.acceleration)) is None
