"""Wrong or useless recordings are found before anything is fitted to them."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hidden_table import SAMPLE_TIME, record

from shake_ros.fit.nuisances.prepared import prepared
from shake_ros.fit.records import Record
from shake_ros.fit.start.data_checks import data_checks
from shake_ros.quantities import ShakeError


@cache
def good(seed: int = 1, **own: float) -> Record:
    made = record(seed, 12.0, **own)
    return Record(f"run{seed}", SAMPLE_TIME, made.commands, made.position, made.acceleration)


def said(*records: Record) -> str:
    (line,) = data_checks(records)
    return line


def test_good_recordings_pass_the_data_checks() -> None:
    assert data_checks([good(1), good(2)]) == []


def test_recordings_in_millimetres_are_refused_before_a_fit() -> None:
    run = good()
    assert run.acceleration is not None
    wrong = replace(run, position=1e3 * run.position, acceleration=1e3 * run.acceleration)
    with pytest.raises(ShakeError, match=r"^run1: the position travels .* m, farther than any table: in millimetres"):
        prepared([wrong], [good(2)])


def sine(frequency: float, rate: float, resolution: float) -> Record:
    w, time = 2.0 * np.pi * frequency, np.arange(int(20.0 * rate)) / rate
    position = 0.02 * np.sin(w * time)
    position = np.round(position / resolution) * resolution if resolution else position
    return Record("sine", 1.0 / rate, np.cos(w * time), position, -0.02 * w**2 * np.sin(w * time))


@pytest.mark.parametrize("resolution", [0.0, 1e-6])
@pytest.mark.parametrize("rate", [200.0, 500.0, 1000.0])
@pytest.mark.parametrize("frequency", [0.5, 1.0, 2.03, 5.0, 10.0])
def test_a_clean_sine_has_consistent_units(frequency: float, rate: float, resolution: float) -> None:
    assert not [line for line in data_checks([sine(frequency, rate, resolution)]) if "second derivative" in line]


def test_delay_of_a_filter_is_no_other_unit() -> None:
    late = good()
    assert late.acceleration is not None
    samples = round(9e-3 / SAMPLE_TIME)
    felt = np.concatenate([np.zeros(samples), late.acceleration[:-samples]])
    assert data_checks([replace(late, acceleration=felt)]) == []


@pytest.mark.parametrize(
    ("change", "hint"),
    [
        ({"position": 1e3}, "position in millimetres"),
        ({"acceleration": 1.0 / 9.80665}, "acceleration in g"),
        ({"acceleration": -1.0}, "points the other way"),
        ({"commands": -1.0}, "goes against the command"),
    ],
)
def test_wrong_unit_or_sign_is_said(change: dict[str, float], hint: str) -> None:
    ((name, factor),) = change.items()
    assert hint in said(replace(good(), **{name: factor * getattr(good(), name)}))


def test_swapped_command_and_position_are_said() -> None:
    swapped = replace(good(), commands=good().position, position=good().commands, acceleration=None)
    assert "command and position swapped?" in said(swapped)


def test_recordings_of_two_tables_are_said() -> None:
    assert "two tables" in said(good(1), good(2, flow=3.8e-7))


def test_five_seconds_are_too_little() -> None:
    made = record(3, 5.0)
    short = Record("short", SAMPLE_TIME, made.commands, made.position, made.acceleration)
    assert "5.0 s in all" in said(short)
    assert "10.0 s in all" in said(short, replace(short, name="held"))


def test_recordings_at_a_hundred_hertz_are_said_to_be_slow() -> None:
    factor = round(0.01 / SAMPLE_TIME)
    thin = replace(good(), sample_time=0.01, commands=good().commands[::factor], position=good().position[::factor])
    assert "sampled at 100 Hz" in said(replace(thin, acceleration=None))


def test_sine_alone_is_said() -> None:
    time = np.arange(12000) * SAMPLE_TIME
    sine = Record("sine", SAMPLE_TIME, 0.3 * np.sin(4.0 * np.pi * time), -0.015 * np.cos(4.0 * np.pi * time))
    assert "a single sine of 2 Hz" in said(sine)
