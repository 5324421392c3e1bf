"""Missing samples of a table: short gaps are filled on request and only these; repeated rows are left out."""

from __future__ import annotations

import numpy as np
import pytest

from shake_ros.recordings.fit_records import bridged, longest_short_gap, without_repeats

TIME = np.arange(1000) / 250.0
COLUMNS = {"time": TIME, "command": np.cos(8.0 * TIME), "position": np.sin(20.0 * TIME)}


def kept(rows: np.ndarray) -> dict[str, np.ndarray]:
    return {name: column[rows] for name, column in COLUMNS.items()}


def test_absent_rows_are_filled_near_the_truth() -> None:
    rows = ~np.isin(np.arange(1000), [100, 300, 301, 302])
    found = (whole := bridged(kept(rows), 3)).values
    assert (whole.count, whole.gaps) == (4, 2)
    assert np.array_equal(whole.filled, ~rows)
    assert np.array_equal(whole.rows < 0, ~rows)
    assert found["time"] == pytest.approx(TIME)
    assert found["position"] == pytest.approx(COLUMNS["position"], abs=1e-4)
    assert found["command"] == pytest.approx(COLUMNS["command"], abs=3e-3)


def test_empty_cells_are_filled_and_the_rest_stays_to_the_bit() -> None:
    position = COLUMNS["position"].copy()
    position[[50, 51, 700]] = np.nan
    found = (whole := bridged(COLUMNS | {"position": position}, 2)).values
    assert (whole.count, whole.gaps) == (3, 2)
    assert np.array_equal(whole.rows, np.arange(1000))
    there = np.isfinite(position)
    assert np.array_equal(found["position"][there], position[there])
    assert np.array_equal(found["command"], COLUMNS["command"])
    assert found["position"] == pytest.approx(COLUMNS["position"], abs=1e-5)


def test_longer_gap_stays_one() -> None:
    rows = (np.arange(1000) < 400) | (np.arange(1000) >= 410)
    found = bridged(kept(rows), 3)
    assert found.count == 0
    assert np.array_equal(found.values["time"], TIME[rows])


def test_stamps_off_by_a_third_of_a_period_are_no_gaps() -> None:
    late = TIME + np.random.default_rng(1).uniform(-0.3, 0.3, 1000) / 250.0
    assert bridged(COLUMNS | {"time": late}, 3).count == 0
    rows = np.arange(1000) != 500
    assert bridged(kept(rows) | {"time": late[rows]}, 3).count == 1


@pytest.mark.parametrize(("missing", "longest"), [([], 0), ([10], 1), ([10, 20, 21], 2), ([10, *range(30, 40)], 1)])
def test_longest_gap_that_may_be_filled(missing: list[int], longest: int) -> None:
    assert longest_short_gap(kept(~np.isin(np.arange(1000), missing)), 3) == longest


def test_rows_that_are_there_twice_count_once() -> None:
    twice = {name: np.repeat(column, np.where(np.arange(1000) == 7, 2, 1)) for name, column in COLUMNS.items()}
    found, count = without_repeats(twice)
    assert count == 1
    assert all(np.array_equal(found[name], COLUMNS[name]) for name in COLUMNS)
