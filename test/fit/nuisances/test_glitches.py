"""Glitches of a recorded command: found, told from corners, steps and noise, and from what the valve saw."""

from __future__ import annotations

import numpy as np
import pytest
from foreign_run import foreign_run

from shake_ros.fit.nuisances.glitches import glitches, unseen_glitches, without
from shake_ros.fit.nuisances.prepared import prepared
from shake_ros.fit.records import Record

AT = np.arange(37, 5900, 173)
SIGNS = np.random.default_rng(1).choice((-1.0, 1.0), len(AT))


def spiked(record: Record) -> Record:
    commands = record.commands.copy()
    commands[AT] += 3.0 * np.std(commands) * SIGNS
    return Record(record.name, record.sample_time, commands, record.position, record.acceleration)


@pytest.mark.parametrize("seed", [425, 422])
def test_spikes_at_the_beat_of_two_rates_are_found_and_taken_out(seed: int) -> None:
    clean = foreign_run(seed)
    (found,) = unseen_glitches([spiked(clean)])
    assert np.array_equal(np.concatenate(found), AT)
    data = prepared([spiked(clean)], [])
    assert data.nuisances[0].glitches == len(AT)
    assert np.max(np.abs(data.estimation[0].commands - prepared([clean], []).estimation[0].commands)) < 0.1
    assert "glitches removed" in data.glitches()


@pytest.mark.parametrize("seed", [425, 457, 404, 422])
def test_command_of_a_closed_loop_has_none(seed: int) -> None:
    run = foreign_run(seed)
    assert not glitches(run.commands, run.sample_time)


def test_spike_on_a_steep_slope_is_found() -> None:
    slope = np.abs((TIME * 3.0) % 2.0 - 1.0)
    slope[50:3900:100] += 0.01
    assert np.concatenate(glitches(slope, 0.002)).tolist() == list(range(50, 3900, 100))


TIME = np.arange(4000) / 500.0
WAVES = {
    "triangle": np.abs((TIME * 3.0) % 2.0 - 1.0),
    "square": np.sign(np.sin(20.0 * TIME)),
    "held": np.repeat(np.random.default_rng(2).standard_normal(400), 10),
    "white": np.random.default_rng(3).standard_normal(4000),
    "quake": np.exp(-TIME) * np.sin(150.0 * TIME),
    "quantised": np.round(np.sin(2.0 * TIME), 2),
    "pulses": np.convolve(np.tile(np.repeat([0.0, 1.0, 0.0, -1.0], 100), 10), np.hanning(19) / 9.0, "same"),
    "rounded triangle": np.convolve(np.abs((TIME * 3.0) % 2.0 - 1.0), np.hanning(9) / 4.0, "same"),
}


@pytest.mark.parametrize("name", WAVES)
def test_waves_without_spikes_have_none(name: str) -> None:
    assert not glitches(WAVES[name], 0.002)


def test_spikes_that_move_the_table_stay() -> None:
    command = np.random.default_rng(4).standard_normal(800).repeat(10)[:6000]
    command = np.convolve(command, np.hanning(40) / 20.0, "same")
    command[AT] += 20.0 * SIGNS
    position = np.cumsum(0.3 * command) * 0.002
    assert len(glitches(command, 0.002)) == len(AT)
    assert not unseen_glitches([Record("run", 0.002, command, position)])[0]


def test_bursts_of_jumps_and_ramps_are_taken_out_where_the_motion_ignores_them() -> None:
    drive = np.convolve(np.random.default_rng(5).standard_normal(20000), np.hanning(200) / 10.0, "same")[:8000]
    position = np.cumsum(0.3 * drive) * 0.005
    burst = np.zeros(8000)
    for at in range(60, 7900, 43):
        size = 0.2 * drive[at]
        burst[at : at + 8] = size * np.array([0.6, 0.45, 0.3, 0.15, 1.0, 0.75, 0.5, 0.25])
        burst[at + 12 : at + 16] = -size * np.array([1.0, 0.75, 0.5, 0.25])
    (found,) = unseen_glitches([Record("run", 0.005, drive + burst, position)])
    left = without(drive + burst, found) - drive
    assert np.std(left) < 0.2 * np.std(burst)
    assert max(len(each) for each in found) < 30
