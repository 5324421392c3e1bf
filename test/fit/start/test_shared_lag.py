"""The lag of valve and delay: parted otherwise it is the same lag, and a fit in a bent valley leaps along it."""

import numpy as np
import pytest

from shake_ros.fit.free_parameters import FreeParameter, FreeParameters
from shake_ros.fit.least_squares import fit
from shake_ros.fit.start.narrow_valleys import DAMPING, DELAY, FREQUENCY, OF_LAG, parted_anew, with_lag_parted
from shake_ros.settings import load_table

FREQUENCIES = 2.0 * np.pi * np.linspace(1.0, 40.0, 120)
TRUE = {FREQUENCY: 550.0, DAMPING: 0.75, DELAY: 0.0, "valve.gain": 1.1}


def parameters(names: tuple[str, ...] = (*OF_LAG, "valve.gain")) -> FreeParameters:
    """Free parameters of a valve and its delay."""
    bounds = {
        FREQUENCY: FreeParameter(FREQUENCY, 20.0, 20.0, 5000.0, "rad/s"),
        DAMPING: FreeParameter(DAMPING, 0.05, 0.3, 3.0, "-"),
        DELAY: FreeParameter(DELAY, 5e-4, 0.0, 0.05, "s"),
        "valve.gain": FreeParameter("valve.gain", 0.05, 0.1, 10.0, "-"),
    }
    table = load_table("bergamo").with_values({DELAY: 0.0})
    return FreeParameters(table, [bounds[name] for name in names])


class Response:
    """Frequency response of a second-order valve behind a delay against the true one, from its closed form."""

    def __init__(self, free: FreeParameters) -> None:
        self._columns = [[*free.base.fields].index(name) for name in TRUE]
        self._true = self.of(np.array(list(TRUE.values())))
        self.calls = 0

    @staticmethod
    def of(values: np.ndarray) -> np.ndarray:
        frequency, damping, delay, gain = values
        s = 1j * FREQUENCIES
        h = gain * np.exp(-s * delay) / (1.0 + 2.0 * damping * s / frequency + (s / frequency) ** 2)
        return np.concatenate([h.real, h.imag])

    def residuals(self, vectors: np.ndarray) -> np.ndarray:
        self.calls += len(vectors)
        return np.array([(self.of(row[self._columns]) - self._true) / 1e-4 for row in np.atleast_2d(vectors)])


def test_every_point_has_the_lag_of_the_first() -> None:
    free = parameters()
    x = free.x_of({FREQUENCY: 800.0, DAMPING: 0.9, DELAY: 1e-3, "valve.gain": 1.3})
    rows = parted_anew(free, x) * free.scale
    assert len(rows) == 12
    lag = 2.0 * rows[:, 1] / rows[:, 0] + rows[:, 2]
    inside = rows[:, 0] < 4999.0  # a lag that is nearly all delay asks for a faster valve than is allowed
    assert np.count_nonzero(inside) >= 8
    assert lag[inside] == pytest.approx(2.0 * 0.9 / 800.0 + 1e-3)
    assert np.all(rows[:, 3] == pytest.approx(1.3))


def test_nothing_leaps_where_one_of_the_three_is_known() -> None:
    free = parameters((FREQUENCY, DAMPING, "valve.gain"))
    problem = Response(free)
    found = fit(problem, free, free.start(), evaluations=3)
    before = problem.calls
    assert with_lag_parted(problem, found, 1e-4) is found
    assert problem.calls == before


def test_a_fit_that_a_delay_has_misled_leaps_to_the_valve() -> None:
    free = parameters()
    problem = Response(free)
    start = free.x_of({FREQUENCY: 4400.0, DAMPING: 2.7, DELAY: 1.5e-3, "valve.gain": 1.1})
    stuck = fit(problem, free, start, evaluations=3, tolerance=1e-3)
    found = with_lag_parted(problem, stuck, 1e-6)
    assert stuck.cost > 1e2  # of 240 residuals, in noise of 1e-4
    assert found.cost < 1e-2 * stuck.cost
    assert found.x * free.scale == pytest.approx(list(TRUE.values()), rel=1e-2, abs=2e-5)


def test_a_fit_at_its_end_stays() -> None:
    free = parameters()
    problem = Response(free)
    found = fit(problem, free, free.x_of(TRUE), evaluations=5)
    assert with_lag_parted(problem, found, 1e-4).x == pytest.approx(found.x)
