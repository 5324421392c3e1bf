"""A drive is played as it is: nothing corrected, nothing limited, and only what ends at rest."""

from __future__ import annotations

import numpy as np
import pytest

from shake_ros.control.reference.baseline import states_from_rest
from shake_ros.iteration.drive import faded_to_rest
from shake_ros.quantities import ShakeError
from shake_ros.recordings.reference_file import build_program, write_drive

DT = 0.001


def test_reference_of_a_written_drive_is_the_drive(tmp_path) -> None:
    noise = np.random.default_rng(3).standard_normal(2000)
    drive = states_from_rest(faded_to_rest(noise, DT), DT)
    path = write_drive(tmp_path, tmp_path, drive, DT)
    states = np.asarray(build_program(str(path), DT).states)
    np.testing.assert_allclose(states[:2000], drive, atol=1e-9)


def test_record_that_does_not_end_at_rest_is_no_drive(tmp_path) -> None:
    path = write_drive(tmp_path, tmp_path, states_from_rest(np.ones(1000), DT), DT)
    time = np.arange(1000) * DT
    np.savetxt(tmp_path / "drive.csv", np.column_stack([time, np.ones(1000)]), delimiter=",")
    with pytest.raises(ShakeError, match=r"1e\+02 % of its displacement is left at its end"):
        build_program(str(path), DT)


def test_drive_that_was_recorded_is_written_so_that_it_ends_at_rest(tmp_path) -> None:
    noise = faded_to_rest(np.random.default_rng(3).standard_normal(2000), DT)
    drive = states_from_rest(noise + 1e-3, DT)
    states = np.asarray(build_program(str(write_drive(tmp_path, tmp_path, drive, DT)), DT).states)
    assert np.max(np.abs(states[-1])) < 1e-9 < abs(drive[-1, 0])
    assert np.max(np.abs(states[:2000, 2] - drive[:, 2])) < 5e-3


def test_drive_without_a_record_rests() -> None:
    assert not np.any(build_program("drive", DT).states)
