"""An effect is held against a converged fit: the model without it, from where the effect has led its values."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from shake_ros.core.discovery.judging import Attempt, Policy
from shake_ros.core.discovery.search import with_last
from shake_ros.core.discovery.step import settled
from shake_ros.core.identification.fit import Fit, fit

FREE: Any = SimpleNamespace(low=np.array([-3.0]), high=np.array([3.0]), vectors=np.atleast_2d)


class TwoValleys:
    """Residuals x² − 1 and 0.3 (x − 1): nought at 1, a worse valley of its own near −0.95."""

    def residuals(self, vectors: np.ndarray) -> np.ndarray:
        return np.hstack([vectors**2 - 1.0, 0.3 * (vectors - 1.0)])


def stuck_at(x: float) -> Fit:
    return fit(TwoValleys(), FREE, np.array([x]), evaluations=50, tolerance=1e-10)


def led_to(x: float) -> Attempt:
    richer: Any = SimpleNamespace(x=np.array([x, 7.0]))  # the effect's own parameter comes last
    nothing: Any = SimpleNamespace()
    return Attempt(nothing, richer, 0.1, 0.1, 0.0)


def test_a_fit_that_sits_in_the_worse_valley_is_led_out_of_it() -> None:
    current = stuck_at(-1.2)
    assert current.x[0] == pytest.approx(-0.953, abs=0.001)
    again = settled(TwoValleys(), current, led_to(0.6), Policy())
    assert again.x[0] == pytest.approx(1.0, abs=1e-5)
    assert again.cost < 1e-9 < current.cost


def test_a_fit_that_has_converged_stays_the_one_it_is() -> None:
    current = stuck_at(0.7)
    assert settled(TwoValleys(), current, led_to(0.9), Policy()) is current
    assert settled(TwoValleys(), current, led_to(-1.2), Policy()) is current


def test_a_better_declared_fit_takes_the_place_of_the_declared_one() -> None:
    worse, better = stuck_at(-1.2), stuck_at(0.7)
    hold: Any = TwoValleys()
    assert with_last(worse, [], better, hold) == (better, [])
