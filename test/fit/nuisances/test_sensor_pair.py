"""What shows between position and acceleration, on signals made through frequency responses written here once more."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, freqs

from shake_ros.fit.nuisances.sensor_pair import SensorPair, base_between, between_sensors, pressed_in_time, sensor_pair
from shake_ros.fit.records import Record
from shake_ros.quantities import ShakeError

SAMPLE_TIME, COUNT = 0.002, 15000
OMEGA = 2.0 * np.pi * np.fft.rfftfreq(COUNT, SAMPLE_TIME)
Response = Callable[[np.ndarray], np.ndarray]


def record(*responses: Response) -> Record:
    """A motion up to 40 Hz whose acceleration passes through responses; both sensors have noise."""
    rng = np.random.default_rng(3)
    motion = np.fft.rfft(rng.standard_normal(COUNT)) * (OMEGA > 3.0) * (OMEGA < 250.0) / np.maximum(OMEGA, 3.0) ** 2
    through = np.prod([response(OMEGA) for response in responses], axis=0) if responses else 1.0
    position = np.fft.irfft(motion, COUNT) + 1e-6 * rng.standard_normal(COUNT)
    acceleration = np.fft.irfft(-(OMEGA**2) * motion * through, COUNT) + 0.01 * rng.standard_normal(COUNT)
    return Record("made", SAMPLE_TIME, np.zeros(COUNT), position, acceleration)


def told_by(*responses: Response) -> SensorPair:
    """What the sensors of such a motion tell."""
    return sensor_pair([record(*responses)])


def test_sensors_that_agree_tell_of_nothing() -> None:
    found = told_by()
    assert (found.lag, found.position_lag, found.base) == (0.0, 0.0, None)
    assert found.delay == pytest.approx(0.0, abs=2e-5)
    assert found.scale_error == pytest.approx(0.0, abs=0.003)


def late(omega: np.ndarray) -> np.ndarray:
    return np.asarray(np.exp(-1j * omega * 0.0025))


@pytest.mark.parametrize(("lag", "position_lag"), [(0.004, 0.0), (0.0, 0.012), (0.003, 0.088), (0.006, 0.02)])
def test_slow_sensors_are_told_from_a_filter_that_is_late(lag: float, position_lag: float) -> None:
    found = told_by(late, lambda omega: (1.0 + 1j * omega * position_lag) / (1.0 + 1j * omega * lag))
    assert found.lag == pytest.approx(lag, rel=0.1)
    assert found.position_lag == pytest.approx(position_lag, rel=0.1)
    assert found.delay == pytest.approx(0.0025, abs=5e-4)
    assert found.base is None


def test_acceleration_that_is_early_tells_of_no_lag() -> None:
    found = told_by(lambda omega: np.exp(1j * omega * 0.004))
    assert (found.lag, found.position_lag, found.base) == (0.0, 0.0, None)
    assert found.delay == pytest.approx(-0.004, abs=1e-4)


def test_noise_of_the_position_makes_no_gain_of_a_short_recording_smaller() -> None:
    """Few windows, of which many lines are coherent by chance."""
    count, dt, gains = 1200, 0.005, []
    omega = 2.0 * np.pi * np.fft.rfftfreq(count, dt)
    spectrum = 30.0 * (omega > 6.0) * (omega < 250.0) / np.maximum(omega, 6.0) ** 3
    for seed in range(20):
        rng = np.random.default_rng(seed)
        motion = spectrum * np.fft.rfft(rng.standard_normal(count))
        position = np.fft.irfft(motion, count) + 1e-5 * rng.standard_normal(count)
        felt = np.fft.irfft(-(omega**2) * motion, count) + 0.01 * rng.standard_normal(count)
        lines, values, _ = between_sensors([Record("short", dt, np.zeros(count), position, felt)])
        gains += values.real[lines > 50.0].tolist()
    assert len(gains) > 200
    assert np.mean(gains) == pytest.approx(1.0, abs=0.015)


@pytest.mark.parametrize("cutoff", [25.0, 40.0])
def test_filter_within_the_lines_is_no_lag(cutoff: float) -> None:
    natural = 2.0 * np.pi * cutoff
    found = told_by(lambda omega: natural**2 / (natural**2 - omega**2 + 1j * np.sqrt(2.0) * natural * omega))
    assert (found.lag, found.position_lag, found.base) == (0.0, 0.0, None)
    assert found.delay == pytest.approx(np.sqrt(2.0) / natural, rel=0.03)
    assert found.scale_error == pytest.approx(0.0, abs=0.003)


def test_scale_of_the_accelerometer() -> None:
    assert told_by(lambda omega: 1.06 + 0.0 * omega).scale_error == pytest.approx(0.06, abs=0.003)


def test_acceleration_with_its_sign_turned_is_refused() -> None:
    with pytest.raises(ShakeError, match=r"made: the acceleration is -0\.98. times .* with the scale -1"):
        told_by(lambda omega: -0.987 + 0.0 * omega)


def test_transducer_slower_than_all_lines_hides_the_scale() -> None:
    found = told_by(lambda omega: 1.0 + 0.088j * omega)
    assert found.position_lag == pytest.approx(0.088, rel=0.03)
    assert found.scale_error is None


MASS, STIFFNESS, DAMPING, FREQUENCY = 800.0, 4e7, 0.04, 18.0  # of a table, and of the base below it [Hz]


def receding(omega: np.ndarray) -> np.ndarray:
    """Absolute acceleration per acceleration to a base that is a mass on its spring."""
    base = STIFFNESS / (2.0 * np.pi * FREQUENCY) ** 2
    dynamic = STIFFNESS - base * omega**2 + 2j * DAMPING * np.sqrt(STIFFNESS * base) * omega
    return np.asarray(1.0 / (1.0 - omega**2 * MASS / dynamic))


@pytest.mark.parametrize(("lag", "position_lag"), [(0.0, 0.0), (0.005, 0.0), (0.0, 0.03)])
def test_base_that_gives_way_beside_slow_sensors(lag: float, position_lag: float) -> None:
    found = told_by(receding, late, lambda omega: (1.0 + 1j * omega * position_lag) / (1.0 + 1j * omega * lag))
    assert found.lag == pytest.approx(lag, rel=0.1)
    assert found.position_lag == pytest.approx(position_lag, rel=0.1)
    assert found.base is not None
    assert found.base.compliance_mass == pytest.approx(MASS / STIFFNESS, rel=0.03)
    assert found.base.frequency == pytest.approx(FREQUENCY, rel=0.005)
    assert found.base.damping == pytest.approx(DAMPING, rel=0.15)


def test_base_that_hardly_shows_is_one_to_try() -> None:
    natural = 2.0 * np.pi * 15.0

    def stiff(omega: np.ndarray) -> np.ndarray:
        swinging = natural**2 - omega**2 + 0.1j * natural * omega
        return np.asarray(1.0 / (1.0 - omega**2 * 2e-7 * natural**2 / swinging))

    assert told_by(stiff).base is None
    found = base_between([record(stiff)])
    assert found is not None
    assert found.frequency == pytest.approx(15.0, rel=0.05)
    assert found.compliance_mass == pytest.approx(2e-7, rel=0.3)


def test_position_alone_tells_of_nothing() -> None:
    record = Record("alone", SAMPLE_TIME, np.zeros(COUNT), np.sin(OMEGA[1] * np.arange(COUNT) * SAMPLE_TIME))
    assert sensor_pair([record]) == SensorPair()


def through(order: int, cutoff: float) -> Response:
    """A Butterworth filter."""
    return lambda omega: freqs(*butter(order, 2.0 * np.pi * cutoff, analog=True), omega)[1]


def test_a_steep_filter_above_the_lines_is_mostly_a_dead_time() -> None:
    found = told_by(through(6, 60.0))
    assert (found.lag, found.position_lag, found.base) == (0.0, 0.0, None)
    assert found.filter_share < 0.8
    assert told_by(through(2, 25.0)).filter_share == 1.0


def test_all_of_a_delay_counts_as_a_filter_where_the_gain_does_not_tell() -> None:
    assert told_by(through(2, 300.0)).filter_share == 1.0


@pytest.mark.parametrize("late", [0.0, 0.008])
def test_the_force_on_a_table_under_a_specimen_is_in_time_with_the_position_or_as_late_as_the_accelerometer(
    late: float,
) -> None:
    made = record()
    swing = 2.0 * np.pi * 7.5
    specimen = 0.4 + 0.6 * swing**2 / (swing**2 - OMEGA**2 + 0.04j * swing * OMEGA)
    force = np.fft.irfft(-(OMEGA**2) * np.fft.rfft(made.position) * (OMEGA < 250.0) * specimen, COUNT)
    felt = force + 0.3 * np.std(force) * np.sign(made.velocity)
    pressed = replace(made, pressure=np.roll(felt, round(late / SAMPLE_TIME)))
    assert pressed_in_time([pressed], 0.008) == (late == 0.0)
    assert not pressed_in_time([made], 0.008)
