"""The stretch of a recording in which a drive was played: found, few lost samples put in, all else refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shake_ros.control.reference.baseline import states_from_rest
from shake_ros.quantities import ShakeError
from shake_ros.recordings.bags import TableRecording, read_table_recording, write_table_recording
from shake_ros.recordings.reference_file import played

DT, REST = 0.001, 400


def drive(seed: int = 0) -> np.ndarray:
    """A smooth burst of 1 s that begins and ends at rest, (n, 3)."""
    t = np.linspace(0.0, 1.0, 1001)
    bump = 30.0 * t**2 * (1.0 - t) ** 2
    phase = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi, 3)
    position = 1e-3 * bump**2 * sum(np.sin(2 * np.pi * f * t + p) for f, p in zip((4.0, 7.0, 11.0), phase, strict=True))
    return states_from_rest(np.gradient(np.gradient(position, t), t), DT)


def recording(motion: np.ndarray, folder, lost: np.ndarray | None = None, late: float = 0.0) -> TableRecording:
    """A run of it between two rests; `late` : the reference has stamps of its own [s]."""
    rows = np.vstack([np.zeros((REST, 3)), motion, np.zeros((REST, 3))])
    time = np.arange(len(rows)) * DT
    reference = np.column_stack([np.interp(time - late, time, column) for column in rows.T])
    kept = np.delete(np.arange(len(rows)), [] if lost is None else REST + lost)
    signals = {"reference": reference[kept], "truth": rows[kept], "pressure_supply": np.full(len(kept), 2e7)}
    command = np.arange(len(rows)) * 1e-4
    write_table_recording(folder / "bag", time[kept], command[kept], rows[kept, 0], rows[kept, 2], **signals)
    return read_table_recording(folder / "bag")


def test_run_of_a_drive_is_found_between_its_rests(tmp_path) -> None:
    found, missing = played(recording(drive(), tmp_path), drive(), DT, "run_1")
    assert missing == 0 and found.name == "run_1"
    assert found.time[0] == 0.0 and len(found.time) == 1001
    np.testing.assert_allclose(found.acceleration, drive()[:, 2], atol=1e-12)
    np.testing.assert_allclose(found.valve_command, 1e-4 * np.arange(REST, REST + 1001), atol=1e-12)


def test_few_lost_samples_are_put_in_by_lines_and_counted(tmp_path) -> None:
    lost = np.array([100, 500, 501])
    found, missing = played(recording(drive(), tmp_path, lost), drive(), DT, "run_1")
    assert missing == 3
    whole = drive()[:, 0]
    assert found.position[100] == pytest.approx((whole[99] + whole[101]) / 2, abs=1e-12)
    assert found.valve_command[501] == pytest.approx(1e-4 * (REST + 499))  # held


def test_last_run_counts_of_a_motion_that_was_played_before_and_of_twice_its_size(tmp_path) -> None:
    two = np.vstack([2.0 * drive(), np.zeros((REST, 3)), drive(), np.zeros((REST, 3)), drive()])
    found, _ = played(recording(two, tmp_path), drive(), DT, "run_1")
    assert found.valve_command[0] == pytest.approx(1e-4 * (3 * REST + 2 * 1001), abs=1e-9)
    np.testing.assert_allclose(found.acceleration, drive()[:, 2], atol=1e-12)


def test_reference_with_stamps_of_its_own_tells_the_place_as_well(tmp_path) -> None:
    found, _ = played(recording(drive(), tmp_path, late=0.0004), drive(), DT, "run_1")
    np.testing.assert_allclose(found.acceleration, drive()[:, 2], atol=1e-12)


def test_run_that_cannot_be_evaluated_is_refused_with_its_reason(tmp_path) -> None:
    whole = recording(drive(), tmp_path)
    with pytest.raises(ShakeError, match=r"run_1: no topic imu"):
        played(replace(whole, acceleration=None), drive(), DT, "run_1")
    with pytest.raises(ShakeError, match=r"run_1: the motion that was played is not the one requested"):
        played(whole, drive(1), DT, "run_1")
    with pytest.raises(ShakeError, match=r"run_1: a sample every 0.001 s, the motion has one every 0.002 s"):
        played(whole, drive(), 0.002, "run_1")
    with pytest.raises(ShakeError, match=r"do not contain the 1001 of the motion"):
        played(whole[slice(0, 900)], drive(), DT, "run_1")


def test_run_with_many_lost_samples_is_not_evaluated(tmp_path) -> None:
    with pytest.raises(ShakeError, match=r"run_1: 11 of 1001 samples are missing, 11 in a row: not evaluated"):
        played(recording(drive(), tmp_path, np.arange(300, 311)), drive(), DT, "run_1")
