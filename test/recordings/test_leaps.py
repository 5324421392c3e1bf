"""Recordings parted where the position leaps, and driven by what the model is driven by."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import shake_ros as sr
from shake_ros.quantities import ShakeError
from shake_ros.recordings.bags import read_table_recording, write_table_recording
from shake_ros.recordings.fit_records import fit_records, leaps

DT = 0.005
TIME = np.arange(1200) * DT


def write(folder: Path, position: np.ndarray, force: np.ndarray | None = None) -> Path:
    return write_table_recording(folder / "run", TIME, np.sin(TIME), position, force=force)


def test_a_leap_parts_a_recording_and_is_reported(tmp_path: Path) -> None:
    position = np.round(0.02 * np.sin(3.0 * TIME), 4)
    position[600:] += 0.01
    runs = sr.read(write(tmp_path, position))
    records, findings = runs.records(), runs.findings
    assert [len(r.commands) for r in records] == [600, 600]
    assert any("jumps 1 times, first at 3.000 s" in line for line in findings)


def test_smooth_and_noisy_motion_does_not_leap() -> None:
    rng = np.random.default_rng(1)
    assert len(leaps(0.02 * np.sin(3.0 * TIME) + 1e-4 * rng.standard_normal(len(TIME)))) == 0
    assert len(leaps(np.abs(np.sin(3.0 * TIME)))) == 0  # a reversal at full speed
    assert len(leaps(np.zeros(1000))) == 0


def test_a_model_driven_by_a_force_takes_the_force(tmp_path: Path) -> None:
    recording = read_table_recording(write(tmp_path, 0.02 * np.sin(TIME), 50.0 * np.cos(TIME)))
    np.testing.assert_allclose(fit_records(recording, "force")[0].commands, 50.0 * np.cos(TIME))


def test_a_recording_without_force_is_refused_for_such_a_model(tmp_path: Path) -> None:
    recording = read_table_recording(write(tmp_path, 0.02 * np.sin(TIME)))
    with pytest.raises(ShakeError, match="run: no topic force"):
        fit_records(recording, "force")
