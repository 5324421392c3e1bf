"""Recordings on disk become records of a fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import shake_ros as sr
from shake_ros.fit.records import SHORTEST, Record
from shake_ros.quantities import ShakeError
from shake_ros.recordings.bags import write_table_recording
from shake_ros.recordings.bags.bag import Finding
from shake_ros.recordings.fit_records import finding_lines

TIME = np.arange(4000) * 0.001
ANGLE = 4.0 * np.pi * TIME


def bag(path: Path, keep: np.ndarray | None = None, **changes: Any) -> Path:
    arrays = {
        "time": TIME,
        "valve_command": 0.5 * np.cos(ANGLE),
        "position": 0.05 * np.sin(ANGLE),
        "acceleration": -0.05 * (4.0 * np.pi) ** 2 * np.sin(ANGLE),
        **changes,
    }
    if keep is not None:
        arrays = {name: None if values is None else values[keep] for name, values in arrays.items()}
    return write_table_recording(path, **arrays)


def without(first: float, last: float) -> np.ndarray:
    return (first > TIME) | (last <= TIME)


def records_and_findings(paths: Sequence[Path]) -> tuple[list[Record], list[str]]:
    """What a fit takes of recordings, and what reading them met."""
    runs = sr.read(*paths)
    return runs.records(), runs.findings


def test_record_holds_what_was_recorded(tmp_path: Path) -> None:
    (record,), findings = records_and_findings([bag(tmp_path / "run")])
    assert record.name == "run"
    assert record.sample_time == pytest.approx(0.001)
    assert record.commands == pytest.approx(0.5 * np.cos(ANGLE))
    assert record.position == pytest.approx(0.05 * np.sin(ANGLE))
    assert record.acceleration == pytest.approx(-0.05 * (4.0 * np.pi) ** 2 * np.sin(ANGLE))
    assert record.velocity[500:-500] == pytest.approx(0.2 * np.pi * np.cos(ANGLE)[500:-500], abs=1e-3)
    assert findings == []


def test_recording_without_accelerometer_gives_a_record_without_it(tmp_path: Path) -> None:
    (record,), _ = records_and_findings([bag(tmp_path / "run", acceleration=None)])
    assert record.acceleration is None


def test_recording_without_a_position_gives_a_record_of_its_acceleration(tmp_path: Path) -> None:
    felt = 0.3 - 0.05 * (4.0 * np.pi) ** 2 * np.sin(ANGLE)  # a bias, which would move the table by 2.4 m
    (record,), findings = records_and_findings([bag(tmp_path / "run", position=None, acceleration=felt)])
    assert not record.position_measured
    assert record.acceleration == pytest.approx(felt)
    assert record.position[1000:-1000] == pytest.approx(0.05 * np.sin(ANGLE)[1000:-1000], abs=4e-3)
    assert np.isnan(record.motion[:, 0]).all()
    assert findings == ["run: no position was recorded; fits compare the acceleration alone"]
    with pytest.raises(ShakeError, match="run: no position was recorded, which this model needs"):
        sr.read(bag(tmp_path / "axis" / "run", position=None, force=felt)).records("force")
    with pytest.raises(ShakeError, match="run: imu: the acceleration does not change"):
        sr.read(bag(tmp_path / "still" / "run", position=None, acceleration=np.zeros(len(TIME)))).records()


def test_clipped_acceleration_is_left_out_and_reported(tmp_path: Path) -> None:
    whole = -0.05 * (4.0 * np.pi) ** 2 * np.sin(ANGLE)
    (record,), findings = records_and_findings([bag(tmp_path / "run", acceleration=np.clip(whole, -5.0, 5.0))])
    assert np.array_equal(record.whole, np.abs(whole) < 5.0)
    left = record.acceleration_left(whole)
    assert np.max(np.abs(left)) < 1e-9 and np.all(left[~record.whole[record.start :]] == 0.0)
    assert record.acceleration is not None
    assert np.max(np.abs(record.acceleration - whole)[200:-200]) < 0.2  # restored from the position
    assert (
        f"run: imu: its {np.count_nonzero(~record.whole)} clipped samples do not count in fits and errors" in findings
    )


def test_a_few_lost_samples_part_nothing_and_are_reported(tmp_path: Path) -> None:
    keep = ~np.isin(np.arange(4000), [700, 701, 702, 2500])
    felt = -0.05 * (4.0 * np.pi) ** 2 * np.sin(ANGLE)
    felt[1200] = np.nan
    (record,), findings = records_and_findings([bag(tmp_path / "run", keep, acceleration=felt)])
    assert np.flatnonzero(~record.whole).tolist() == [700, 701, 702, 1200, 2500]
    assert record.position == pytest.approx(0.05 * np.sin(ANGLE), abs=1e-9)
    assert record.commands == pytest.approx(0.5 * np.cos(ANGLE), abs=2e-4)
    assert any("run: 5 lost samples in 3 gaps of up to 3 are filled for fits" in line for line in findings)


def test_longer_gap_and_leap_over_a_short_one_part_a_recording(tmp_path: Path) -> None:
    (*longer,), _ = records_and_findings([bag(tmp_path / "longer", ~np.isin(np.arange(4000), np.arange(2000, 2004)))])
    assert [len(r.commands) for r in longer] == [2000, 1996]
    leapt = 0.05 * np.sin(ANGLE) + np.where(np.arange(4000) > 2000, 0.02, 0.0)
    (*apart,), findings = records_and_findings([bag(tmp_path / "apart", np.arange(4000) != 2000, position=leapt)])
    assert [len(r.commands) for r in apart] == [2000, 1999]
    assert not any("are filled" in line for line in findings)


def test_slow_recording_loses_no_more_than_one_sample_in_a_row(tmp_path: Path) -> None:
    rows = np.arange(4000) % 10 == 0
    one, two = rows & (np.arange(4000) != 2000), rows & ~np.isin(np.arange(4000), [2000, 2010])
    assert len(records_and_findings([bag(tmp_path / "one", one)])[0]) == 1
    assert len(records_and_findings([bag(tmp_path / "two", two)])[0]) == 2


def test_piece_of_a_recording_without_a_segment_has_its_findings_all_the_same(tmp_path: Path) -> None:
    (whole,) = sr.read(bag(tmp_path / "run"))
    empty = replace(whole, segments=(), findings=(Finding("idle", "/diagnostics", 4000, "did not act"),))
    assert finding_lines(empty) == ["run: /diagnostics: did not act"]


def test_gap_makes_two_records_of_one_name_and_is_reported(tmp_path: Path) -> None:
    records, findings = records_and_findings([bag(tmp_path / "run", without(1.5, 1.8))])
    assert [r.name for r in records] == ["run", "run"]
    assert [len(r.commands) for r in records] == [1500, 2200]
    assert records[1].commands[0] == pytest.approx(0.5 * np.cos(4.0 * np.pi * 1.8))
    assert any(line.startswith("run: /shake/joint_states") for line in findings)


def test_stretch_too_short_for_the_dynamics_is_left_out(tmp_path: Path) -> None:
    assert SHORTEST > 0.5
    (record,), _ = records_and_findings([bag(tmp_path / "run", without(0.5, 0.6))])
    assert len(record.commands) == 3400


def test_recording_of_short_stretches_alone_is_refused(tmp_path: Path) -> None:
    keep = (TIME % 0.6) < 0.5
    with pytest.raises(ShakeError, match="run: no segment of 1 s without a gap"):
        records_and_findings([bag(tmp_path / "run", keep)])


def test_time_in_milliseconds_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ShakeError, match=r"run: a sample every 1 s is too slow .* milliseconds"):
        records_and_findings([bag(tmp_path / "run", time=1e3 * TIME)])


def test_two_recordings_of_one_name_are_refused(tmp_path: Path) -> None:
    first = bag(tmp_path / "a" / "run")
    second = bag(tmp_path / "b" / "run")
    with pytest.raises(ShakeError, match="'run' is given twice"):
        records_and_findings([first, second])


def test_recording_of_a_table_at_rest_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ShakeError, match="run: joint_states: the position does not move"):
        records_and_findings([bag(tmp_path / "run", position=np.full(len(TIME), 0.02))])


def test_dead_accelerometer_is_no_accelerometer(tmp_path: Path) -> None:
    (record,), findings = records_and_findings([bag(tmp_path / "run", acceleration=np.zeros(len(TIME)))])
    assert record.acceleration is None
    assert any("imu: has the same value 0 throughout" in line for line in findings)
