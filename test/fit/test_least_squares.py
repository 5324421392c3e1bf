"""Fits of problems whose solution is known in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from shake_ros.fit.free_parameters import FreeParameter, FreeParameters, free_parameter
from shake_ros.fit.least_squares import Fit, KeptJacobian, fit, jacobian
from shake_ros.fit.uncertainty import SPREAD, at_bound, correlation, covariance, estimates, form_errors
from shake_ros.physics.plant.parameters import INDEX
from shake_ros.quantities import ShakeError
from shake_ros.settings import load_table

VISCOUS, COULOMB = "friction.viscous", "friction.coulomb_level"
WIDTH = "friction.transition_velocity"
TRUE = (300.0, 120.0)
TABLE = load_table("bergamo")


def line(high: float = 20000.0) -> FreeParameters:
    given = {VISCOUS: {"scale": 50.0, "low": 0.0, "high": high}, COULOMB: {"scale": 20.0, "low": 0.0, "high": 5000.0}}
    return FreeParameters(TABLE, [free_parameter(n, c, "here") for n, c in given.items()])


class Line:
    """y = viscous · x + coulomb, measured with noise of deviation 1."""

    def __init__(self, noise: np.ndarray, broken_above: float = np.inf) -> None:
        self.x = np.linspace(-1.0, 1.0, len(noise))
        self.y = TRUE[0] * self.x + TRUE[1] + noise
        self.broken_above = broken_above

    @property
    def design(self) -> np.ndarray:
        return np.column_stack([self.x, np.ones_like(self.x)])

    def residuals(self, vectors: np.ndarray) -> np.ndarray:
        slope, level = vectors[:, [INDEX[VISCOUS]]], vectors[:, [INDEX[COULOMB]]]
        result = slope * self.x + level - self.y
        result[slope[:, 0] > self.broken_above] = np.nan
        return np.asarray(result)


def solve(problem: Line, free: FreeParameters) -> Fit:
    return fit(problem, free, free.start(), evaluations=40, tolerance=1e-10)


def values(result: Fit) -> np.ndarray:
    return np.asarray(result.x * result.free.scale)


WHITE = np.random.default_rng(7).standard_normal(400)


def test_fit_of_a_line_is_the_least_squares_solution() -> None:
    problem = Line(WHITE)
    best = np.linalg.lstsq(problem.design, problem.y, rcond=None)[0]
    result = solve(problem, line())
    assert values(result) == pytest.approx(best, rel=1e-6)
    assert result.cost == pytest.approx(0.5 * float(np.sum((problem.design @ best - problem.y) ** 2)), rel=1e-9)


def test_fit_does_not_depend_on_its_start() -> None:
    problem, free = Line(WHITE), line()
    far = fit(problem, free, free.x_of({VISCOUS: 15000.0, COULOMB: 3000.0}), tolerance=1e-10)
    assert values(far) == pytest.approx(values(solve(problem, free)), rel=1e-6)


class Bent:
    """Residuals u − 3 and 40 + 5 (u − 2)² of one parameter in its scales: the second leaves much and bends."""

    def residuals(self, vectors: np.ndarray) -> np.ndarray:
        u = vectors[:, INDEX[VISCOUS]] / 50.0
        return np.column_stack([u - 3.0, 40.0 + 5.0 * (u - 2.0) ** 2])


def test_runs_that_bend_are_fitted_by_central_differences() -> None:
    (least,) = (root.real for root in np.roots([50.0, -300.0, 1001.0, -1203.0]) if abs(root.imag) < 1e-9)

    def error(narrow: bool) -> float:
        free = FreeParameters(TABLE, [FreeParameter(VISCOUS, 50.0, 0.0, 5000.0, "N s/m", narrow=narrow)])
        return float(abs(fit(Bent(), free, np.array([2.5]), tolerance=1e-12).x[0] - least))

    assert 30.0 * error(narrow=True) < error(narrow=False)


def test_central_differences_stay_within_the_bounds() -> None:
    parameter = FreeParameter(VISCOUS, 50.0, 0.0, 100.0, "N s/m", narrow=True)
    problem, free = Line(WHITE), FreeParameters(TABLE, [parameter])
    for place in (0.0, 2.0):
        x = np.array([place])
        slope = jacobian(problem, free, x, problem.residuals(free.vectors(x))[0])[:, 0]
        assert slope == pytest.approx(50.0 * problem.x, rel=1e-6)


def test_parameter_rests_on_the_bound_that_it_would_cross() -> None:
    result = solve(Line(WHITE), line(high=200.0))
    assert values(result)[0] == pytest.approx(200.0, rel=1e-3)
    assert at_bound(result).tolist() == [True, False]


def test_simulations_that_break_off_are_avoided_and_do_not_stop_the_fit() -> None:
    result = solve(Line(WHITE, broken_above=2000.0), line())
    assert values(result) == pytest.approx(TRUE, rel=0.01)
    free = line()
    back = fit(Line(WHITE, broken_above=900.0), free, free.x_of({VISCOUS: 800.0}), tolerance=1e-10)
    assert values(back) == pytest.approx(TRUE, rel=0.01)


class Overshot:
    """arctan((viscous − 300)/50): from far off a Gauss–Newton step crosses to where a run ends in `broken`."""

    def __init__(self, broken: float) -> None:
        self.broken, self.lost = broken, 0

    def residuals(self, vectors: np.ndarray) -> np.ndarray:
        slope, level = vectors[:, [INDEX[VISCOUS]]], vectors[:, [INDEX[COULOMB]]]
        result = np.hstack([np.arctan((slope - TRUE[0]) / 50.0), level - TRUE[1]])
        far = slope[:, 0] > 500.0
        self.lost += int(far.sum())
        result[far] = self.broken
        return np.asarray(result)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("broken", [np.nan, np.inf, 1e200])
def test_a_step_to_where_a_run_is_lost_is_taken_back(broken: float) -> None:
    problem, free = Overshot(broken), line()
    result = fit(problem, free, free.x_of({VISCOUS: 200.0}), tolerance=1e-10)
    assert problem.lost > 0
    assert values(result) == pytest.approx(TRUE, rel=1e-6)


def test_differences_at_an_upper_bound_step_inward() -> None:
    problem, free = Line(WHITE, broken_above=200.0), line(high=200.0)
    x = free.high.copy()
    derivative = jacobian(problem, free, x, problem.residuals(free.vectors(x))[0])
    assert derivative == pytest.approx(problem.design * free.scale, rel=1e-6)


def test_standard_errors_are_those_of_linear_regression() -> None:
    rows = 40000
    problem = Line(np.random.default_rng(8).standard_normal(rows))
    result = solve(problem, line())
    closed = np.sqrt(np.diag(np.linalg.inv(problem.design.T @ problem.design)))
    blocks = np.arange(rows) // 100
    found = [e.std_error for e in estimates(result, blocks)]
    assert found == pytest.approx(closed, rel=0.1)
    assert [e.name for e in estimates(result, blocks)] == [VISCOUS, COULOMB]
    assert [e.unit for e in estimates(result, blocks)] == ["N*s/m", "N"]


def test_estimates_of_slope_and_level_of_a_centred_line_do_not_correlate() -> None:
    result = solve(Line(np.random.default_rng(8).standard_normal(20000)), line())
    matrix = correlation(result, np.arange(20000) // 100)
    assert np.diag(matrix) == pytest.approx([1.0, 1.0])
    assert abs(matrix[0, 1]) < 0.2


def test_noise_that_lasts_makes_the_standard_error_as_large_as_its_blocks_say() -> None:
    slow = np.repeat(np.random.default_rng(9).standard_normal(400), 100)
    result = solve(Line(slow), line())
    lasting, short = (estimates(result, np.arange(40000) // n)[1].std_error for n in (100, 1))
    assert lasting == pytest.approx(1.0 / np.sqrt(400.0), rel=0.1)
    assert short is not None and lasting is not None
    assert lasting > 5.0 * short


class Rounded(Line):
    """The line through a corner that is rounded over a width near rest: residuals follow the width."""

    def residuals(self, vectors: np.ndarray) -> np.ndarray:
        return super().residuals(vectors) + 4e4 * (vectors[:, [INDEX[WIDTH]]] - TABLE.value(WIDTH))


def test_form_error_is_the_shift_that_another_width_near_rest_brings() -> None:
    shift = 4e4 * TABLE.value(WIDTH) * np.array([SPREAD - 1.0, 1.0 / SPREAD - 1.0])
    sharp, rounded = (form_errors(p, solve(p, line())) for p in (Line(WHITE), Rounded(WHITE)))
    assert sharp == pytest.approx([0.0, 0.0])
    assert rounded * line().scale == pytest.approx([0.0, np.sqrt(np.mean(shift**2))], abs=1e-6)


class Cornered(Line):
    """The line through such a corner in every other sample, so that the width can be told from the level."""

    def residuals(self, vectors: np.ndarray) -> np.ndarray:
        every_other = np.tile([0.0, 8e4], len(self.x) // 2)
        return super().residuals(vectors) + every_other * (vectors[:, [INDEX[WIDTH]]] - TABLE.value(WIDTH))


def test_a_width_that_was_fitted_leaves_the_others_the_error_of_another_form() -> None:
    assumed = line()
    fitted = assumed.extended([free_parameter(WIDTH, {"scale": 1e-4}, "here")])
    without, beside = (solve(Cornered(WHITE), free) for free in (assumed, fitted))
    errors = form_errors(Cornered(WHITE), beside) * fitted.scale
    ratio = values(beside)[2] / TABLE.value(WIDTH)
    assert errors[:2] == pytest.approx(ratio * form_errors(Cornered(WHITE), without) * assumed.scale, rel=1e-6)
    assert errors[1] > 5.0
    either = np.array([SPREAD - 1.0, 1.0 / SPREAD - 1.0])
    assert errors[2] == pytest.approx(values(beside)[2] * np.sqrt(np.mean(either**2)), rel=1e-9)


class Throttled(Line):
    """The line whose level follows the pressure between supply and tank, as the flow does."""

    def residuals(self, vectors: np.ndarray) -> np.ndarray:
        change = vectors - TABLE.vector()
        drop = change[:, [INDEX["supply.supply_pressure"]]] - change[:, [INDEX["supply.tank_pressure"]]]
        return super().residuals(vectors) + 1e-3 * drop


def test_form_error_counts_a_root_that_lags_behind() -> None:
    lag = 2.0 * TABLE.value("valve.laminar_pressure")  # of the drop across both edges
    found = form_errors(Throttled(WHITE), solve(Throttled(WHITE), line()))
    assert found * line().scale == pytest.approx([0.0, 1e-3 * lag / np.sqrt(3.0)], abs=1e-6)


def test_form_error_widens_the_deviation_and_leaves_the_standard_error() -> None:
    result, blocks = solve(Rounded(WHITE), line()), np.arange(400) // 20
    plain, widened = estimates(result, blocks)[1], estimates(result, blocks, np.array([0.0, 3.0]))[1]
    assert widened.std_error == plain.std_error
    assert widened.deviation == pytest.approx(np.hypot(plain.std_error or 0.0, widened.form_error))
    assert widened.form_error > 0.0


def test_parameter_on_a_bound_carries_no_standard_error() -> None:
    result = solve(Line(WHITE), line(high=200.0))
    blocks = np.arange(400) // 20
    first, second = estimates(result, blocks)
    assert first.std_error is None
    assert second.std_error is not None and second.std_error > 0.0
    assert np.isnan(covariance(result, blocks)[0]).all()


def test_ninety_per_cent_intervals_cover_the_truth_at_about_that_rate() -> None:
    inside = np.zeros(2)
    for seed in range(120):
        result = solve(Line(np.random.default_rng(seed).standard_normal(600)), line())
        errors = [e.std_error or 0.0 for e in estimates(result, np.arange(600) // 15)]
        inside += np.abs(values(result) - TRUE) < 1.645 * np.array(errors)
    assert np.all(inside / 120 > 0.80)
    assert np.all(inside / 120 < 0.97)


def test_free_parameter_has_the_bounds_and_the_unit_of_its_quantity() -> None:
    made = free_parameter("friction.coulomb_level", {"scale": 5.0}, "here")
    assert made.low == 0.0
    assert made.unit == "N"
    assert free_parameter("friction.coulomb_level", {"scale": 5.0, "low": -3.0}, "here").low == 0.0


@pytest.mark.parametrize(
    ("name", "content", "text"),
    [
        ("friction.colomb_level", {"scale": 1.0}, "did you mean 'friction.coulomb_level'"),
        (VISCOUS, {"scale": 1.0, "hight": 2.0}, "did you mean 'high'"),
        (VISCOUS, {}, "needs a number 'scale'"),
        (VISCOUS, {"scale": "wide"}, "needs a number 'scale'"),
        (VISCOUS, {"scale": 0.0}, "needs scale > 0"),
        (VISCOUS, {"scale": 1.0, "low": 3.0, "high": 2.0}, "low < high, got 1, 3, 2"),
    ],
)
def test_wrong_free_parameter_is_one_line_that_names_the_file(name: str, content: dict, text: str) -> None:
    with pytest.raises(ShakeError, match=r"full\.yaml") as caught:
        free_parameter(name, content, "full.yaml")
    assert text in str(caught.value)
    assert "\n" not in str(caught.value)


def test_vectors_change_the_free_parameters_alone() -> None:
    free = line()
    row = free.vectors(np.array([2.0, 3.0]))[0]
    base = TABLE.vector()
    changed = np.flatnonzero(row != base)
    assert {int(i) for i in changed} == {INDEX[VISCOUS], INDEX[COULOMB]}
    assert row[INDEX[VISCOUS]] == 100.0
    assert row[INDEX[COULOMB]] == 60.0
    assert free.vectors(np.zeros((5, 2))).shape == (5, len(base))


def test_table_of_a_solution_holds_its_values_within_the_bounds() -> None:
    table = line().table(np.array([4.0, -1.0]))
    assert table.value(VISCOUS) == 200.0
    assert table.value(COULOMB) == 0.0
    assert table.value("body.table_mass") == TABLE.value("body.table_mass")


def test_start_is_the_declared_table_held_within_the_bounds() -> None:
    low = FreeParameters(TABLE, [FreeParameter(VISCOUS, 10.0, 50.0, 90.0, "N*s/m")])
    assert low.start() * low.scale == pytest.approx([50.0])
    assert low.x_of({VISCOUS: 70.0}) * low.scale == pytest.approx([70.0])
    assert low.x_of({VISCOUS: 1000.0}) * low.scale == pytest.approx([90.0])


def test_extension_adds_each_parameter_once() -> None:
    free = line()
    more = free_parameter("effects.soft_zone.depth", {"scale": 0.1}, "here")
    assert free.extended([more, free.free[0]]).names == (VISCOUS, COULOMB, "effects.soft_zone.depth")


class Valley:
    """Rosenbrock's curved valley in two parameters, and how many sets were simulated."""

    smooth = True

    def __init__(self) -> None:
        self.simulated = 0

    def residuals(self, vectors: np.ndarray) -> np.ndarray:
        self.simulated += len(vectors)
        x, y = vectors[:, INDEX[VISCOUS]] / 50.0, vectors[:, INDEX[COULOMB]] / 20.0
        return np.column_stack([10.0 * (y - 0.2 * x**2), 5.0 - x, 0.1 * np.ones_like(x)])


def test_a_kept_jacobian_leads_through_a_curved_valley_to_its_end() -> None:
    problem, free = Valley(), line()
    result = fit(problem, free, np.array([1.0, 15.0]), evaluations=40, tolerance=1e-12)
    assert result.x == pytest.approx([5.0, 5.0], rel=1e-5)
    assert result.cost == pytest.approx(0.005, rel=1e-6)
    assert result.evaluations == problem.simulated


def test_the_jacobian_of_a_fit_is_that_of_its_end() -> None:
    problem, free = Valley(), line()
    result = fit(problem, free, np.array([1.0, 15.0]), evaluations=40, tolerance=1e-12)
    taken = jacobian(problem, free, result.x, result.residuals)
    assert result.jacobian == pytest.approx(taken, abs=1e-3)


class Decay:
    """A decaying exponential whose size and rate are sought, without noise."""

    smooth = True

    def residuals(self, vectors: np.ndarray) -> np.ndarray:
        size, rate = vectors[:, [INDEX[VISCOUS]]] / 50.0, vectors[:, [INDEX[COULOMB]]] / 20.0
        time = np.linspace(0.0, 2.0, 40)
        return np.asarray(size * np.exp(-rate * time) - 3.0 * np.exp(-2.0 * time))


def test_most_steps_need_no_new_jacobian() -> None:
    kept = KeptJacobian(Decay(), line())
    at, steps = np.array([2.5, 1.6]), 0
    while np.sum(kept.residuals(at) ** 2) > 1e-16:
        at, steps = at - np.linalg.lstsq(kept(at), kept.residuals(at), rcond=None)[0], steps + 1
        assert steps < 30
    assert at == pytest.approx([3.0, 2.0], abs=1e-6)
    assert kept.taken <= 0.5 * steps
    kept.forget()
    taken = kept.taken
    kept(at)
    assert (kept.taken, kept.age) == (taken + 1, 0)
