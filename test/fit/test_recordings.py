"""Signals of a recording as a fit sees them: filters, noise, pieces, weights, errors."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from closed_loops import declared_fit, recording
from hidden_table import ACCELERATION_NOISE, POSITION_NOISE, POSITION_STEP, SAMPLE_TIME, Hidden, record

from shake_ros.fit.declared_model import FULL
from shake_ros.fit.recording_problem import BLOCK, BLOCKS, RecordingProblem
from shake_ros.fit.records import SETTLE, Record, relative_error, windows
from shake_ros.physics.plant.simulation import run
from shake_ros.physics.plant.states import FILM
from shake_ros.settings import load_table
from shake_ros.signals.velocity_filter import derivative, filtered_velocity, integrated, low_pass

TIME = np.arange(5000) * 0.001
SENSOR = math.hypot(POSITION_NOISE, POSITION_STEP / math.sqrt(12.0))


def still(name: str, seconds: float, sample_time: float = 0.001) -> Record:
    n = round(seconds / sample_time)
    ramp = np.arange(n) * sample_time
    return Record(name, sample_time, ramp, ramp, ramp)


@pytest.mark.parametrize("frequency", [1.0, 5.0, 15.0])
def test_low_pass_shifts_no_phase_and_keeps_the_operating_band(frequency: float) -> None:
    wave = np.sin(2.0 * np.pi * frequency * TIME)
    assert np.max(np.abs(low_pass(wave, 0.001) - wave)[500:-500]) < 0.01


def test_low_pass_takes_out_what_lies_an_octave_and_a_half_above_its_bandwidth() -> None:
    wave = np.sin(2.0 * np.pi * 120.0 * TIME)
    assert np.max(np.abs(low_pass(wave, 0.001))[500:-500]) < 2e-4


def test_low_pass_of_a_pulse_is_symmetric_about_it() -> None:
    pulse = np.zeros(4001)
    pulse[2000] = 1.0
    answer = low_pass(pulse, 0.001)
    assert np.argmax(answer) == 2000
    assert answer[1500:2000] == pytest.approx(answer[2001:2501][::-1], abs=1e-12)


def test_low_pass_works_along_the_last_axis() -> None:
    rows = np.random.default_rng(0).standard_normal((3, 2000))
    assert low_pass(rows, 0.001)[1] == pytest.approx(low_pass(rows[1], 0.001))


def test_recordings_of_100_hz_keep_what_a_table_does() -> None:
    slow = np.sin(2.0 * np.pi * 15.0 * 0.01 * np.arange(500))
    assert low_pass(slow, 0.01)[50:-50] == pytest.approx(slow[50:-50], abs=1e-3)


@pytest.mark.parametrize("rate", [100.0, 204.8, 1000.0])
@pytest.mark.parametrize("frequency", [3.0, 20.0])
def test_derivative_of_a_measured_sine_is_its_filtered_velocity_at_any_rate(rate: float, frequency: float) -> None:
    time, omega = np.arange(0.0, 6.0, 1.0 / rate), 2.0 * np.pi * frequency
    found = derivative(0.05 * np.sin(omega * time), 1.0 / rate)
    inner = slice(len(time) // 4, -len(time) // 4)
    wanted = low_pass(0.05 * omega * np.cos(omega * time), 1.0 / rate)
    assert found[inner] == pytest.approx(wanted[inner], abs=2e-3 * 0.05 * omega)


def test_noise_of_a_position_does_not_run_away_at_the_ends_of_the_velocity() -> None:
    ends = [derivative(np.random.default_rng(k).standard_normal(3000), 0.001)[[0, -1]] for k in range(40)]
    inner = derivative(np.random.default_rng(99).standard_normal(3000), 0.001)[500:-500]
    assert np.sqrt(np.mean(np.square(ends))) < 6.0 * np.std(inner)


@pytest.mark.parametrize("hidden", [Hidden(), Hidden(dead_band=0.02)])
def test_sensor_noise_of_a_table_that_sticks_and_slips_is_found(hidden: Hidden) -> None:
    made = record(1, 6.0, hidden)
    found = Record("r", SAMPLE_TIME, made.commands, made.position, made.acceleration)
    assert found.position_noise() == pytest.approx(SENSOR, rel=0.1)
    assert found.acceleration_noise() == pytest.approx(ACCELERATION_NOISE, rel=0.3)


def test_velocity_noise_is_the_scatter_that_passes_the_filter() -> None:
    noise = 1e-5 * np.random.default_rng(5).standard_normal(20000)
    record_ = Record("r", 0.001, noise, noise)
    assert record_.velocity_noise() == pytest.approx(float(np.std(record_.velocity[1000:-1000])), rel=0.1)


def test_relative_error_of_a_scaled_signal_is_the_scale() -> None:
    wave = np.sin(2.0 * np.pi * 2.0 * TIME)
    assert relative_error(wave, 0.9 * wave) == pytest.approx(0.1)
    assert relative_error(wave + 7.0, np.full_like(wave, 7.0)) == pytest.approx(1.0, rel=1e-3)


def test_short_recordings_are_looked_at_whole() -> None:
    records = [still("a", 6.0), still("b", 9.0)]
    assert windows(records, 15.0) is records


def test_pieces_of_long_recordings_have_the_asked_length_and_reach_both_ends() -> None:
    records = [still("a", 40.0), still("b", 20.0)]
    pieces = windows(records, 15.0, 2.5)
    assert [p.name for p in pieces] == ["a"] * 4 + ["b"] * 2
    assert sum(len(p.commands) for p in pieces) * 0.001 == pytest.approx(15.0)
    assert pieces[0].commands[0] == 0.0
    assert pieces[3].commands[-1] == records[0].commands[-1]
    assert pieces[5].position[-1] == records[1].position[-1]


def test_pieces_of_a_recording_without_accelerometer_have_none() -> None:
    whole = still("a", 40.0)
    without = Record("a", 0.001, whole.commands, whole.position)
    assert all(p.acceleration is None for p in windows([without], 10.0))


def test_compared_part_starts_after_the_pressures_have_settled() -> None:
    assert still("a", 10.0).start * 0.001 == pytest.approx(SETTLE)
    assert still("a", 1.0).start == 250


def test_a_recording_that_begins_in_the_midst_of_ringing_runs_as_it_was() -> None:
    """Soft oil at low pressure: from chambers at half the supply the table would stick to the end."""
    table = load_table("bergamo_measured")
    blow = 1.0 + 20.0 * np.exp(-(((np.arange(9000) - 2000) / 500.0) ** 2))  # moves the pressures
    command = 0.03 * blow * np.sin(2.0 * math.pi * 6.0 * np.arange(9000) * 1e-3)
    out, later = run(table, command, 1e-3), slice(5000, None)
    given = (1e-3, command[later], out[later, 0], out[later, 2])
    begun, blind = (Record("cut", *given, command_before=command[4999], moved=moved) for moved in (True, False))
    error, without = (RecordingProblem([r]).errors(table.vector())["cut"]["acceleration"] for r in (begun, blind))
    assert error < 0.01
    assert without > 0.5


def test_what_begins_in_motion_leaves_no_more_than_noise_behind_a_slow_filter() -> None:
    """Noise of the sensors, and a filter that is late by a good part of a period of the oil column."""
    table, time, rng = load_table("bergamo_measured"), np.arange(6000) * 1e-3, np.random.default_rng(1)
    command = 0.1 * np.sin(2.0 * math.pi * 1.3 * time) + 0.1 * np.sin(2.0 * math.pi * 7.0 * time)
    out, later = run(table, command, 1e-3, cutoff=50.0), slice(3000, None)
    position = out[later, 0] + 3e-6 * rng.standard_normal(3000)
    cut = Record("cut", 1e-3, command[later], position, out[later, 2] + 0.02 * rng.standard_normal(3000), cutoff=50.0)
    problem = RecordingProblem([cut])
    left = problem.residuals(table.vector()[None, :])[0]
    first = (problem.times() < SETTLE + 0.2) & (problem.times() > 0.0)
    assert np.mean(left[first] ** 2) < 1.3 * problem.noise_cost()


def test_a_piece_begins_with_the_specimen_swaying_as_it_was() -> None:
    values = {"mass": 300.0, "frequency": 7.5, "damping": 0.005}
    table = load_table("bergamo").with_values({f"effects.specimen_resonance.{n}": v for n, v in values.items()})
    time, rng = np.arange(8000) * 1e-3, np.random.default_rng(1)
    command = 0.05 * np.sin(2.0 * math.pi * 7.3 * time) * (time < 4.0)
    out = run(table, command, 1e-3)
    noise = rng.standard_normal((2, 8000))
    whole = Record("whole", 1e-3, command, out[:, 0] + 3e-6 * noise[0], out[:, 2] + 0.02 * noise[1])
    piece = whole.part(slice(3000, None))
    problems = [RecordingProblem([r]) for r in (piece, *(replace(piece, past=np.zeros(k)) for k in (0, 1)))]
    of = [np.mean(p.residuals(table.vector()[None, :]) ** 2) / p.noise_cost() for p in problems]
    with_past, unknown, without = of  # and as if nothing had moved before
    assert max(with_past, unknown) < 2.0 < 100.0 < without


def test_right_model_leaves_the_weighted_residuals_of_the_noise() -> None:
    declared, problem = declared_fit("nothing")
    mean_square = float(np.mean(declared.residuals**2))
    assert mean_square == pytest.approx(problem.noise_cost(), rel=0.35)


def test_velocity_and_acceleration_of_one_instant_share_a_block_of_time() -> None:
    problem = RecordingProblem([recording("nothing", 1, "a"), recording("nothing", 2, "b")])
    blocks = problem.blocks()
    n = len(problem.records[0].commands) - problem.records[0].start
    assert blocks.shape == (4 * n,)
    assert np.array_equal(blocks[:n], blocks[n : 2 * n])
    sizes = np.bincount(blocks)
    assert len(sizes) >= BLOCKS
    assert np.max(sizes) <= 2 * round(BLOCK / SAMPLE_TIME)
    assert set(sizes[: len(sizes) // 2 - 1]) == {np.max(sizes)}
    assert not set(blocks[: 2 * n]) & set(blocks[2 * n :])


def test_recording_without_a_position_is_fitted_on_its_acceleration() -> None:
    declared, _ = declared_fit("nothing")
    whole = recording("nothing", 2, "b")
    assert whole.acceleration is not None
    position = integrated(whole.acceleration, whole.commands, SAMPLE_TIME)
    given = "b", SAMPLE_TIME, whole.commands, position, whole.acceleration
    problem = RecordingProblem([Record(*given, position_measured=False)])
    residuals = problem.residuals(declared.free.vectors(declared.x))[0]
    assert len(residuals) == len(whole.commands) - whole.start == len(problem.blocks()) == problem.count
    errors = problem.errors(declared.vector)["b"]
    assert set(errors) == set(problem.noise()) == {"acceleration"}
    assert errors["acceleration"] < 0.03


def test_recording_without_accelerometer_is_fitted_on_its_velocity() -> None:
    declared, _ = declared_fit("nothing")
    whole = recording("nothing", 2, "b")
    problem = RecordingProblem([Record("b", SAMPLE_TIME, whole.commands, whole.position)])
    vector = declared.free.vectors(declared.x)
    errors = problem.errors(vector[0])
    assert set(errors["b"]) == {"velocity"}
    assert errors["b"]["velocity"] < 0.01
    assert set(problem.noise()) == {"velocity"}
    assert problem.residuals(vector).shape == (1, len(whole.commands) - problem.records[0].start)


def test_segments_of_one_recording_give_one_error() -> None:
    declared, _ = declared_fit("nothing")
    whole = recording("nothing", 2, "b")
    assert whole.acceleration is not None
    halves = [
        Record("b", SAMPLE_TIME, whole.commands[s], whole.position[s], whole.acceleration[s])
        for s in (slice(0, 2000), slice(2000, None))
    ]
    errors = RecordingProblem(halves).errors(declared.free.vectors(declared.x)[0])
    assert list(errors) == ["b"]
    assert errors["b"]["acceleration"] < 0.03


def test_a_simulated_velocity_is_filtered_as_a_measured_one_to_its_very_ends() -> None:
    time, omega = np.arange(3000) * 1e-3, 2.0 * np.pi * 2.3
    position, velocity = 0.1 * np.sin(omega * time + 0.4) / omega, 0.1 * np.cos(omega * time + 0.4)
    shown = derivative(position, 1e-3)
    assert filtered_velocity(velocity, 1e-3) == pytest.approx(shown, abs=1e-5)
    assert np.abs(low_pass(velocity, 1e-3) - shown)[-1] > 1e-3  # in motion at its end
    rows = np.stack([velocity, 2.0 * velocity])
    assert filtered_velocity(rows, 1e-3)[1] == pytest.approx(2.0 * filtered_velocity(velocity, 1e-3))


def test_a_run_changes_as_smoothly_as_the_parameter_that_is_changed() -> None:
    made = record(3, 10.0, noisy=False)
    every = slice(None, None, 5)  # 200 Hz: several steps of the integrator between two samples
    slow = Record("slow", 5 * SAMPLE_TIME, made.commands[every], made.position[every], made.acceleration[every])
    problem, table = RecordingProblem([slow]), load_table("bergamo").with_values({"valve.hysteresis": 1e-3})
    name, changes = "valve.natural_frequency", (0.0, 1e-4, 1e-2)  # relative
    tables = [table.with_values({name: (1.0 + c) * table.value(name)}) for c in changes]
    at, near, far = problem.residuals(np.array([t.vector() for t in tables]))
    rates = (near - at) / changes[1], (far - at) / changes[2]
    assert np.linalg.norm(rates[0] - rates[1]) < 0.2 * np.linalg.norm(rates[1])


def test_a_part_of_a_recording_begins_with_the_film_of_friction_that_its_past_has_left() -> None:
    film = {"relief": 0.9, "full_film_velocity": 0.15, "time_constant": 2.0}
    table = load_table("bergamo").with_values({f"effects.film_friction.{n}": v for n, v in film.items()})
    command = 0.3 * np.sin(2.0 * np.pi * 1.5 * TIME)
    whole = Record("run", 0.001, command, run(table, command, 0.001)[:, 0])
    part = whole.part(slice(1000, 5000)).part(slice(1500, 4000))  # parts of parts have all of the past
    assert len(part.past) == 2500
    assert np.std(part.past - whole.velocity[:2500]) < 0.01 * np.std(whole.velocity)
    (begun,) = FULL.begun(table.vector()[None, :], part)
    steady = np.minimum((np.abs(whole.velocity[:2500]) / film["full_film_velocity"]) ** (2.0 / 3.0), 1.0)
    left = np.exp(-np.arange(2500, 0, -1) * 0.001 / film["time_constant"])  # of what each sample adds
    assert begun[FILM] == pytest.approx(
        np.sum(steady * left) * (1.0 - np.exp(-0.001 / film["time_constant"])), rel=0.01
    )
    alone = replace(part, past=np.zeros(0))  # a recording that begins in a motion like what it shows
    assert FULL.begun(table.vector()[None, :], alone)[0, FILM] == pytest.approx(begun[FILM], rel=0.3)
    assert FULL.begun(table.vector()[None, :], whole)[0, FILM] == 0.0  # and one that begins at rest
    true, kept, lost = (r[-2000:, 2] for r in (
        run(table, command, 0.001), FULL.run(table, part), FULL.run(table, replace(part, past=np.zeros(1)))
    ))  # fmt: skip
    assert np.std(kept - true) < 0.2 * np.std(lost - true)


@pytest.mark.parametrize("frequency", [2.5, 9.0])
def test_a_recording_that_begins_in_motion_begins_with_its_specimen_swaying(frequency: float) -> None:
    swaying = {"mass": 150.0, "frequency": frequency, "damping": 0.01}
    table = load_table("bergamo").with_values({f"effects.specimen_resonance.{n}": v for n, v in swaying.items()})
    command, rng = 0.2 * np.sin(2.0 * np.pi * (frequency - 0.3) * TIME), np.random.default_rng(0)
    true = run(table, command, 0.001)
    position = true[:, 0] + POSITION_NOISE * rng.standard_normal(len(command))
    felt = true[:, 2] + ACCELERATION_NOISE * rng.standard_normal(len(command))
    late, compared = slice(2130, None), slice(round(SETTLE / 0.001), None)
    alone = Record("late", 0.001, command[late], position[late], felt[late])
    still = replace(alone, past=np.zeros(1))  # as if nothing had moved before
    shown, lost = ((FULL.run(table, r)[:, 2] - true[late, 2])[compared] for r in (alone, still))
    assert np.std(shown) < 2.0 * ACCELERATION_NOISE
    assert np.std(shown) < 0.1 * np.std(lost)
