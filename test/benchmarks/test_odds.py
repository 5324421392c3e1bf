"""The table of odds against what was right."""

from __future__ import annotations

import numpy as np

from benchmarks.discovery.odds import table


def test_odds_that_come_true_as_often_as_they_say_have_no_error() -> None:
    odds, right = np.full(100, 19.0), np.arange(100) >= 5
    assert table(odds, right)[1:] == [
        "1 … 20 | 100 | 95.0 % | 95.0 %",
        "expected calibration error 0.000 of 100 verdicts",
    ]


def test_certainty_that_errs_each_second_time_has_an_error_of_a_half() -> None:
    assert table(np.full(10, 1e9), np.arange(10) % 2 == 0)[-1] == "expected calibration error 0.500 of 10 verdicts"
