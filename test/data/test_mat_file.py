"""Variables of a .mat file as columns."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from shake_ros.core.quantities import ShakeError
from shake_ros.data.columns import Column
from shake_ros.data.mat_file import read_mat_columns


@pytest.fixture
def path(tmp_path: Path) -> Path:
    file = tmp_path / "data.mat"
    savemat(file, {"t": np.arange(5.0)[:, None], "v": np.arange(5.0)[None, :], "k": 3.0, "short": np.ones(4), "s": "x"})
    return file


def test_rows_and_columns_come_as_arrays_times_their_scale(path: Path) -> None:
    values = read_mat_columns(path, {"time": Column("t"), "force": Column("v", 2.0)})
    np.testing.assert_array_equal(values["time"], np.arange(5.0))
    np.testing.assert_array_equal(values["force"], 2.0 * np.arange(5.0))


@pytest.mark.parametrize(
    ("columns", "text"),
    [
        ({"time": Column("tt")}, "unknown variable 'tt'"),
        ({"time": Column("k")}, "'k' of shape"),
        ({"time": Column("s")}, "'s' of shape"),
        ({"time": Column("t"), "x": Column("short")}, "differ in length: t 5, short 4"),
    ],
)
def test_a_wrong_variable_is_refused_with_its_name(path: Path, columns: dict[str, Column], text: str) -> None:
    with pytest.raises(ShakeError, match=text):
        read_mat_columns(path, columns)


def test_a_file_that_is_none_is_refused(tmp_path: Path) -> None:
    (tmp_path / "text.mat").write_text("nothing of the kind, but long enough to have a header " * 10)
    for name in ("text.mat", "absent.mat"):
        with pytest.raises(ShakeError, match=name):
            read_mat_columns(tmp_path / name, {"time": Column("t")})
