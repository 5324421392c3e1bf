"""The band in which the command explains the response, on signals whose parts are known."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid
from scipy.signal import butter, lfilter, sosfilt

from shake_ros.fit.nuisances.explained_band import explained_band, limited
from shake_ros.fit.recording_problem import RecordingProblem
from shake_ros.fit.records import Record, windows
from shake_ros.settings import load_table

DT, SECONDS = 1.0 / 256.0, 60.0
BANDS = (2.2, 3.8), (8.0, 9.6)  # of equal width [Hz]
EDGE = 12.0  # of the command, and of what a table without noise does [Hz]


def coloured(seed: int, low: float, high: float) -> np.ndarray:
    """Random motion between two frequencies [Hz], of unit deviation."""
    white = np.random.default_rng(seed).standard_normal(round(SECONDS / DT))
    band = sosfilt(butter(6, [low, high], "bandpass", fs=1.0 / DT, output="sos"), white)
    return np.asarray(band / np.std(band))


def record(ringing: float, seed: int = 1, loud: slice = slice(None)) -> Record:
    """A table of first order behind its command, shaken beside it by an oil column that rings at 40 Hz [m/s²]."""
    command = np.zeros(round(SECONDS / DT))
    command[loud] = 0.1 * coloured(seed, 0.5, EDGE)[loud]
    velocity = lfilter([DT / 0.02], [1.0, DT / 0.02 - 1.0], command)
    ring = ringing * coloured(seed + 100, 38.0, 42.0)
    acceleration = (
        np.gradient(velocity, DT) + ring + 1e-3 * np.random.default_rng(seed + 200).standard_normal(len(ring))
    )
    velocity = velocity + cumulative_trapezoid(ring, dx=DT, initial=0.0)
    return Record(f"run{seed}", DT, command, cumulative_trapezoid(velocity, dx=DT, initial=0.0), acceleration)


def test_a_response_that_follows_its_command_keeps_its_whole_band() -> None:
    assert explained_band([record(0.0), record(0.0, 2)]) == math.inf


def test_what_rings_beside_the_command_is_left_out() -> None:
    assert EDGE < explained_band([record(4.0), record(4.0, 2)]) < 38.0


def test_a_disturbance_at_one_frequency_ends_no_band() -> None:
    disturbed = [
        replace(r, acceleration=r.acceleration + 2.0 * coloured(r.run + 7, 4.2, 4.9))
        for r in (record(4.0), replace(record(4.0, 2), run=1))
        if r.acceleration is not None
    ]
    assert len(disturbed) == 2
    assert EDGE < explained_band(disturbed) < 38.0


def test_a_clipped_response_keeps_its_whole_band() -> None:
    plain = record(0.0)
    assert plain.acceleration is not None
    clipped = np.clip(plain.acceleration, -0.5 * np.std(plain.acceleration), 0.5 * np.std(plain.acceleration))
    assert explained_band([Record("clipped", DT, plain.commands, plain.position, clipped)]) == math.inf


def test_recordings_without_acceleration_keep_their_whole_band() -> None:
    plain = record(4.0)
    assert explained_band([Record("position", DT, plain.commands, plain.position)]) == math.inf


def test_below_the_band_the_noise_is_what_no_filter_explains() -> None:
    calm = coloured(7, 2.0, 8.0)
    r = record(4.0)
    assert r.acceleration is not None
    shaken = Record("shaken", DT, r.commands, r.position, r.acceleration + 2.0 * calm)
    (found,) = limited([shaken], 20.0)
    assert found.acceleration_noise() == pytest.approx(2.0, rel=0.1)


def test_whitening_makes_the_noise_equal_at_all_frequencies_of_the_band_and_keeps_its_size() -> None:
    def size(values: np.ndarray, band: tuple[float, float]) -> float:
        return float(np.std(sosfilt(butter(6, band, "bandpass", fs=1.0 / DT, output="sos"), values)))

    def noise(seed: int) -> np.ndarray:
        return np.asarray(2.0 * coloured(seed, 2.0, 4.0) + 0.2 * coloured(seed + 1, 4.0, 16.0))

    r = record(4.0)
    assert r.acceleration is not None
    (found,) = limited([replace(r, acceleration=r.acceleration + noise(7))], 16.0)
    before = noise(9)[found.start :]
    white = found.whitened(before[None, :], 1)[0]
    assert size(before, BANDS[0]) > 10.0 * size(before, BANDS[1])
    assert size(white, BANDS[0]) == pytest.approx(size(white, BANDS[1]), rel=0.5)
    assert np.std(white) == pytest.approx(found.acceleration_noise(), rel=0.3)


def test_noise_that_is_louder_for_a_while_counts_as_much_there_as_elsewhere() -> None:
    loud, r = slice(round(20.0 / DT), round(40.0 / DT)), record(4.0)
    louder = np.ones(len(r.commands))
    louder[loud] = 5.0
    assert r.acceleration is not None
    (found,) = limited([replace(r, acceleration=r.acceleration + louder * coloured(7, 2.0, 16.0))], 16.0)
    white = np.zeros(len(louder))
    white[found.start :] = found.whitened((louder * coloured(9, 2.0, 16.0))[None, found.start :], 1)[0]
    within, before = np.std(white[loud]), np.std(white[found.start : round(18.0 / DT)])
    assert within == pytest.approx(before, rel=0.3)
    piece = found.part(slice(round(22.0 / DT), round(30.0 / DT)))
    of_piece = 5.0 * coloured(11, 2.0, 16.0)[None, loud][:, : len(piece.commands) - piece.start]
    assert np.std(piece.whitened(of_piece, 1)) == pytest.approx(within, rel=0.3)


def test_the_noise_of_a_recording_is_what_a_filter_of_others_leaves() -> None:
    first, second = (replace(record(4.0, seed), run=seed) for seed in (1, 2))
    second = replace(second, sample_time=(1.0 + 1e-6) * DT)  # a clock of its own
    twice_as_quick = replace(second, commands=0.5 * second.commands)
    ((alone,), (beside,), (other,)) = (
        limited([first], 16.0, learnt) for learnt in ((first,), (first, second), (first, twice_as_quick))
    )
    assert alone.velocity_noise() < beside.velocity_noise() < 0.3 * other.velocity_noise()
    assert other.velocity_noise() <= np.std(first.velocity)


def test_a_limited_problem_compares_as_many_samples_as_its_band_has() -> None:
    r = record(4.0)
    (found,) = limited([r], 16.0)
    problem = RecordingProblem([found])
    residuals = problem.residuals(load_table("bergamo").vector()[None])
    assert residuals.shape == (1, problem.count) == (1, len(problem.blocks())) == (1, len(problem.times()))
    assert 2 * 16.0 * SECONDS < problem.count / 2 < 4 * 16.0 * SECONDS


def test_pieces_of_a_limited_recording_are_its_loudest() -> None:
    (found,) = limited([record(4.0, loud=slice(round(20.0 / DT), round(30.0 / DT)))], 16.0)
    (piece,) = windows([found], 3.0, 3.0)
    assert 18.0 < piece.begin < 23.0


def test_a_limited_recording_that_is_short_stays_whole() -> None:
    found = limited([record(4.0)], 16.0)
    assert windows(found, 0.9 * SECONDS / 3.0, 3.0) == found


def test_a_short_response_that_follows_its_command_keeps_its_whole_band() -> None:
    plain = record(0.0)
    assert explained_band([plain.part(slice(0, round(3.0 / DT)))]) == math.inf


def test_a_recording_too_short_to_tell_keeps_its_whole_band_and_leaves_the_answer_to_longer_ones() -> None:
    shaken = record(4.0)
    short = shaken.part(slice(0, round(10.0 / DT)))
    assert explained_band([short]) == math.inf
    assert explained_band([short, shaken]) == explained_band([shaken]) < math.inf
