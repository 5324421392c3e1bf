"""Records: integration, baseline, synthetic accelerogram, fit into an envelope."""

from __future__ import annotations

import numpy as np
import pytest

from shake_ros.control.reference.baseline import correct_baseline, filtered, integrate, resample
from shake_ros.control.reference.motion import EarthquakeRecord
from shake_ros.control.reference.motion import envelope as table_envelope
from shake_ros.control.reference.recorded import EarthquakeParameters, envelope, ground_filter
from shake_ros.quantities import ShakeError
from shake_ros.recordings.reference_file import build_program, load_reference
from shake_ros.settings import load_table


@pytest.fixture
def parameters() -> EarthquakeParameters:
    found = load_reference("earthquake").parameters
    assert isinstance(found, EarthquakeParameters)
    return found


@pytest.fixture
def record() -> EarthquakeRecord:
    time = np.arange(2001) * 0.01
    noise = np.random.RandomState(2).standard_normal(2001)
    return EarthquakeRecord(time, 0.7 * noise * np.exp(-(((time - 8.0) / 4.0) ** 2)) + 0.05)


def test_integration_is_exact_for_a_linear_acceleration() -> None:
    time = np.arange(11) * 0.3
    velocity, displacement = integrate(2.0 + 3.0 * time, 0.3)
    assert np.allclose(velocity, 2.0 * time + 1.5 * time**2)
    assert np.allclose(displacement, time**2 + 0.5 * time**3)


def test_resampling_is_exact_between_the_samples_of_the_record() -> None:
    rows = resample(2.0 + 3.0 * np.arange(11) * 0.3, 0.3, 0.07)
    time = np.minimum(np.arange(len(rows)) * 0.07, 3.0)
    expected = np.column_stack((time**2 + 0.5 * time**3, 2.0 * time + 1.5 * time**2, 2.0 + 3.0 * time))
    assert np.allclose(rows, expected)
    assert time[-1] == 3.0


@pytest.mark.parametrize("high_pass", [0.0, 0.1, 0.5])
def test_corrected_record_ends_at_rest_in_the_middle(record: EarthquakeRecord, high_pass: float) -> None:
    corrected = correct_baseline(record.acceleration, 0.01, high_pass, 15.0, 2.0)
    velocity, displacement = integrate(corrected, 0.01)
    assert abs(velocity[-1]) < 1e-12
    assert abs(displacement[-1]) < 1e-12
    assert corrected[0] == pytest.approx(0.0, abs=1e-12)
    assert corrected[-1] == pytest.approx(0.0, abs=1e-12)
    assert corrected.size == record.time.size + 400


def test_offset_and_drift_of_the_recorder_do_not_reach_the_table(record: EarthquakeRecord) -> None:
    drifted = record.acceleration + 0.02 * record.time
    clean, dirty = (correct_baseline(a, 0.01, 0.3, 0.0, 2.0) for a in (record.acceleration, drifted))
    shift = np.max(np.abs(integrate(clean, 0.01)[1] - integrate(dirty, 0.01)[1]))
    raw_shift = np.max(np.abs(integrate(record.acceleration, 0.01)[1] - integrate(drifted, 0.01)[1]))
    assert raw_shift > 20.0
    assert shift < 0.02


def test_correction_leaves_the_band_of_the_record_alone(record: EarthquakeRecord) -> None:
    wave = np.sin(2.0 * np.pi * 3.0 * record.time) * np.sin(np.pi * record.time / 20.0) ** 2
    corrected = correct_baseline(wave, 0.01, 0.3, 20.0, 2.0)
    assert np.max(np.abs(corrected[200:-200] - wave)) < 2e-3


def test_correction_does_not_touch_its_input(record: EarthquakeRecord) -> None:
    before = record.acceleration.copy()
    correct_baseline(record.acceleration, 0.01, 0.3, 20.0, 2.0)
    assert np.array_equal(record.acceleration, before)


def test_an_empty_band_is_refused() -> None:
    with pytest.raises(ShakeError, match="leaves nothing below"):
        filtered(np.zeros(100), 0.01, 5.0, 4.0)
    with pytest.raises(ShakeError, match="leaves nothing below"):
        filtered(np.zeros(100), 0.01, 60.0, 0.0)
    with pytest.raises(ShakeError, match="too low for a time step"):
        correct_baseline(np.ones(100), 0.01, 1e-9, 0.0, 1.0)


def test_ground_filter_passes_its_corner_as_kanai_and_tajimi_write_it() -> None:
    gain = np.abs(ground_filter(np.array([0.0, 2.0, 1e5]), (2.0, 0.5), (0.01, 0.7)))
    assert gain[0] == 0.0
    assert gain[1] == pytest.approx(np.sqrt(1.0 + 1.0), rel=1e-3)  # |1 + 2iξ| / |2iξ| with ξ = 1/2
    assert gain[2] < 1e-4


def test_envelope_peaks_at_one_where_it_should_and_ends_at_its_level() -> None:
    time = np.linspace(0.0, 10.0, 10001)
    found = envelope(time, 10.0, 0.25, 0.05)
    assert found[0] == 0.0
    assert np.max(found) == pytest.approx(1.0)
    assert time[np.argmax(found)] == pytest.approx(2.5, abs=0.002)
    assert found[-1] == pytest.approx(0.05)


def test_synthetic_record_follows_its_seed_and_its_peak(parameters: EarthquakeParameters) -> None:
    quake = parameters.replace(synthetic_peak=2.5)
    first, again, other = (quake.replace(synthetic_seed=seed).synthetic_record() for seed in (1, 1, 2))
    assert np.array_equal(first.acceleration, again.acceleration)
    assert not np.allclose(first.acceleration, other.acceleration)
    assert np.max(np.abs(first.acceleration)) == pytest.approx(2.5)


def test_synthetic_record_has_its_energy_around_the_ground_frequency(parameters: EarthquakeParameters) -> None:
    powers = np.zeros(2001)
    asked = parameters.replace(
        synthetic_duration=40.0, synthetic_time_step=0.01, ground_frequency=4.0, ground_damping=0.3, rock_frequency=0.4
    )
    for seed in range(30):
        acceleration = asked.replace(synthetic_seed=seed).synthetic_record().acceleration
        powers += np.abs(np.fft.rfft(acceleration[:4000])) ** 2
    frequency = np.arange(2001) / 40.0
    assert 3.0 < frequency[np.argmax(np.convolve(powers, np.ones(40), "same"))] < 4.5


def test_default_earthquake_suits_the_table() -> None:
    program = build_program("earthquake", 0.001)
    position, velocity, acceleration = np.max(np.abs(program.states), axis=0)
    assert 10.0 <= (program.length - 1) * 0.001 <= 12.0
    assert 0.03 < position <= 0.05
    assert 0.2 < velocity <= 0.3
    assert 2.5 < acceleration <= 3.0 + 1e-9


@pytest.mark.parametrize(
    ("limit", "value", "column"),
    [("position_limit", 0.01, 0), ("velocity_limit", 0.05, 1), ("acceleration_limit", 0.5, 2)],
)
def test_record_is_scaled_until_each_limit_holds(
    parameters: EarthquakeParameters, record: EarthquakeRecord, limit: str, value: float, column: int
) -> None:
    free = parameters.replace(position_limit=10.0, velocity_limit=100.0, acceleration_limit=1000.0, scale=3.0)
    states, notes = free.replace(**{limit: value}).motion(0.01, record)
    assert np.max(np.abs(states[:, column])) == pytest.approx(value)
    assert notes["limited_by"] == limit
    assert notes["factor"] < 3.0
    assert free.motion(0.01, record).notes == pytest.approx(
        {"factor": 3.0, "limited_by": "", "time_scale": 1.0, "source": "synthetic, seed 5"}
    )


def test_half_the_time_scale_needs_a_quarter_of_the_displacement(parameters: EarthquakeParameters) -> None:
    free = parameters.replace(position_limit=10.0, velocity_limit=100.0, acceleration_limit=1000.0, low_pass=0.0)
    record = parameters.synthetic_record()
    slow = free.replace(high_pass=0.5, pad_time=2.0).fit(record)
    fast = free.replace(high_pass=1.0, pad_time=1.0, time_scale=0.5).fit(record)
    assert np.allclose(slow.acceleration, fast.acceleration, atol=1e-9)
    displacements = [np.max(np.abs(integrate(f.acceleration, f.time_step)[1])) for f in (slow, fast)]
    assert displacements[1] == pytest.approx(0.25 * displacements[0])


def test_records_that_cannot_be_used_are_refused(parameters: EarthquakeParameters, record: EarthquakeRecord) -> None:
    bad = record.acceleration.copy()
    bad[7] = np.nan
    with pytest.raises(ShakeError, match="not finite"):
        parameters.fit(EarthquakeRecord(record.time, bad))
    with pytest.raises(ShakeError, match="not uniform"):
        parameters.fit(EarthquakeRecord(record.time**2, record.acceleration))
    with pytest.raises(ShakeError, match="at least 8 samples"):
        parameters.fit(EarthquakeRecord(record.time[:3], record.acceleration[:3]))
    with pytest.raises(ShakeError, match="was named but not given"):
        parameters.replace(record="a.csv").motion(0.001)


def test_envelope_of_the_table_is_that_of_its_catalogue() -> None:
    bounds = table_envelope(load_table("bergamo"))
    assert bounds.position == pytest.approx(0.130)
    assert bounds.velocity == pytest.approx(0.61, abs=0.01)
    assert bounds.acceleration == pytest.approx(9.4562e-4 * 205e5 / 650.0, rel=1e-3)
