"""Samples on one grid, buckets with minimum and maximum, restarts, gaps, and the model that follows."""

from __future__ import annotations

import numpy as np

from shake_ros.page.samples import HEADER, LONGEST_GAP, ROW, Prediction, SampleStore, amplitude_spectrum
from shake_ros.settings import load_table

MS = 1_000_000
START = 1_700_000_000_000 * MS


def store() -> SampleStore:
    return SampleStore(MS, Prediction(0.001, None))


def decoded(frame: bytes) -> tuple[dict[str, float], np.ndarray, np.ndarray]:
    level, epoch, n, curves, first, step = HEADER.unpack_from(frame)
    numbers = np.frombuffer(frame, np.float32, offset=HEADER.size)
    low = numbers[: curves * n].reshape(curves, n)
    high = numbers[curves * n :].reshape(curves, n) if level else low
    return {"level": level, "epoch": epoch, "first": first, "step": step}, low, high


def fill(into: SampleStore, first: int, count: int, values=0.0, offset: int = 0, topic: str = "joint_states") -> None:
    stamps = START + (first + np.arange(count)) * MS + offset
    into.add(topic, stamps, np.broadcast_to(np.asarray(values, dtype=float).reshape(-1, 1), (count, 1)))
    into.settle()


def test_spike_of_one_sample_is_seen_at_every_level() -> None:
    samples, acceleration = store(), np.zeros(10_000)
    acceleration[4321] = 77.0
    fill(samples, 0, 10_000, acceleration, topic="imu")
    for level in range(8):
        _, low, high = decoded(samples.frame(level, 0, 120.0)[0])
        row = ROW["acceleration"]
        assert np.nanmax(high[row]) == 77.0
        assert int(np.nanargmax(high[row])) == 4321 >> level
        assert np.nanmin(low[row]) == 0.0


def test_frames_follow_one_another_without_a_gap_or_a_double() -> None:
    samples, following, got = store(), 0, []
    for batch in range(40):
        fill(samples, 33 * batch, 33, np.arange(33 * batch, 33 * batch + 33))
        frame, following = samples.frame(2, following, 10.0)
        if frame:
            got.append(decoded(frame)[1][ROW["position"]])
    assert np.concatenate(got).tolist() == [4.0 * k for k in range(len(np.concatenate(got)))]
    assert len(np.concatenate(got)) > 300


def test_lost_samples_are_gaps_and_nothing_is_invented() -> None:
    samples = store()
    fill(samples, 0, 100, 1.0)
    fill(samples, 140, 100, 1.0)
    position = samples.newest("position", 10.0)
    assert np.isnan(position[100:140]).all()
    assert np.isfinite(position[:100]).all()


def test_topic_whose_stamps_lie_between_two_samples_keeps_its_offset() -> None:
    samples = store()
    for batch in range(30):
        fill(samples, 33 * batch, 33, 2.0)
        fill(samples, 33 * batch, 33, 5.0, offset=MS // 2 + 1, topic="valve_command")
    assert np.isfinite(samples.newest("valve_command", 0.9)).all()


def test_stamps_that_begin_anew_begin_another_epoch() -> None:
    samples = store()
    fill(samples, 60_000, 100, 1.0)
    before = samples.epoch
    fill(samples, 0, 100, 3.0)
    assert samples.epoch == before + 1
    assert np.nanmax(samples.newest("position", 10.0)) == 3.0


def test_ring_keeps_the_newest_minutes_whatever_has_gone_before() -> None:
    samples = store()
    for batch in range(160):
        fill(samples, 1000 * batch, 1000, float(batch))
    _, low, _ = decoded(samples.frame(7, 0, 120.0)[0])
    position = low[ROW["position"]]
    assert np.isfinite(position).all()
    assert position[-1] == 159.0
    assert 35.0 <= position[0] <= 41.0


def test_tracking_error_is_reference_minus_position() -> None:
    samples = store()
    stamps = START + np.arange(200) * MS
    samples.add("reference", stamps, np.tile([0.02, 0.0, 0.0], (200, 1)))
    fill(samples, 0, 200, 0.015)
    assert np.allclose(samples.newest("tracking_error", 1.0), 0.005, atol=1e-7)


def test_model_follows_the_command_as_its_own_simulation_does_and_survives_a_gap() -> None:
    table = load_table("bergamo")
    time = np.arange(1500) * 0.001
    command = (0.1 * np.sin(2 * np.pi * 2 * time)).astype(np.float32)
    from shake_ros.physics.plant.simulation import run

    truth = run(table, command.astype(float), 0.001)
    follows = Prediction(0.001, table)
    supply = np.full(1500, table.supply.supply_pressure, dtype=np.float32)
    velocity, _ = follows.advance(command, truth[:, 0].astype(np.float32), supply)
    known = np.isfinite(velocity)
    assert known.sum() > 1100
    assert np.abs(velocity[known] - truth[known, 1]).max() < 0.02 * np.abs(truth[:, 1]).max()
    command[700:710] = np.nan
    again, _ = Prediction(0.001, table).advance(command, truth[:, 0].astype(np.float32), supply)
    assert np.isfinite(again[900:]).all()
    command[700 : 700 + LONGEST_GAP + 5] = np.nan
    behind, _ = Prediction(0.001, table).advance(command, truth[:, 0].astype(np.float32), supply)
    assert np.isnan(behind[760:900]).all()


def test_spectrum_shows_the_amplitude_of_a_sine() -> None:
    frequency, amplitude = amplitude_spectrum(3.0 * np.sin(2 * np.pi * 7.3 * np.arange(8192) * 0.001), 0.001)
    assert abs(amplitude.max() - 3.0) < 0.02
    assert abs(frequency[np.argmax(amplitude)] - 7.3) < 0.5


def test_computed_curves_wait_for_a_late_topic_but_not_for_one_that_has_stopped() -> None:
    samples = store()
    fill(samples, 0, 100, 0.5, topic="reference")
    fill(samples, 0, 400, 0.3)
    assert samples.settled == 100
    fill(samples, 100, 300, 0.5, topic="reference")
    assert samples.settled == 400
    np.testing.assert_allclose(samples.newest("tracking_error", 0.3), 0.2, rtol=1e-6)
    fill(samples, 400, 400, 0.3)
    assert samples.settled == 400
    fill(samples, 800, 200, 0.3)  # now the reference is 0.6 s behind
    assert samples.settled == 1000
    assert np.isnan(samples.newest("tracking_error", 0.6)).all()


def test_twins_prediction_comes_seconds_late_and_is_shown_where_it_belongs() -> None:
    samples = store()
    for batch in range(80):
        fill(samples, 100 * batch, 100, topic="imu")
    before = samples.frame(3, 0, 120.0)
    fill(samples, 1000, 1000, 5.0, topic="predicted_imu")
    assert (samples.settled, samples.later) == (8000, 2000)
    frame, following = samples.frame(3, 0, 120.0)
    assert following == before[1]
    shown = decoded(frame)[1][ROW["twin_acceleration"]]
    assert np.flatnonzero(np.isfinite(shown)).tolist() == list(range(125, 250))
    assert np.nanmin(shown) == 5.0


def test_prediction_of_an_earlier_run_of_the_table_is_left_out() -> None:
    samples = store()
    fill(samples, 0, 100, 5.0, topic="predicted_imu")  # before all else
    fill(samples, 60_000, 100)
    fill(samples, 0, 100)  # the table has begun anew
    epoch = samples.epoch
    fill(samples, 60_000, 100, 5.0, topic="predicted_imu")
    assert (samples.epoch, samples.later, samples.settled) == (epoch, 0, 100)
    assert np.isnan(samples.newest("twin_acceleration", 1.0)).all()
