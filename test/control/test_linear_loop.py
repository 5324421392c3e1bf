"""The linear loop has the dead time, the observer and the margins of the nonlinear one."""

from __future__ import annotations

import math

import numpy as np

from shake_ros.control import linear_loop
from shake_ros.control.linear_loop import Feedback, OpenLoop, linear_at, margins, open_loop
from shake_ros.control.observer.linear import kalman_gain
from shake_ros.control.robust import RobustSettings, observer_of, points, softest
from shake_ros.settings import find, load_table, read_yaml

DT = 1e-3
PATH = find("robust_tuning", "default")
SETTINGS = RobustSettings.from_mapping(read_yaml(PATH)["numbers"], str(PATH))


def integrator(gain: float, delay: int) -> OpenLoop:
    """x⁺ = x + dt u(k − delay), w = −gain x."""
    n = delay + 1
    a, b, c = np.zeros((n, n)), np.zeros(n), np.zeros(n)
    a[0, 0], c[0] = 1.0, -gain
    if delay:
        a[0, n - 1], b[1] = DT, 1.0
        for i in range(2, n):
            a[i, i - 1] = 1.0
    else:
        b[0] = DT
    return OpenLoop(a, b, c, DT)


def test_margins_of_an_integrator_with_dead_time_are_those_of_the_textbook() -> None:
    # L = k e^{-sT}/s with the hold's half sample: unit gain at k, phase −180° at π/(2 T')
    gain, delay = 20.0, 9
    found = margins(integrator(gain, delay))
    late = (delay + 0.5) * DT
    assert math.isclose(found.phase, math.pi / 2.0 - gain * late, rel_tol=0.01)
    assert math.isclose(found.gain, math.pi / (2.0 * late * gain), rel_tol=0.01)
    assert found.stable
    assert not linear_loop.is_stable(integrator(1.05 * found.gain * gain, delay))
    assert linear_loop.is_stable(integrator(0.95 * found.gain * gain, delay))


def test_prediction_takes_the_known_dead_time_out_of_the_loop() -> None:
    # model equal to the plant: the poles with 5.4 ms are those without, and as many at zero as samples wait
    table = load_table("bergamo")
    y = points(table, SETTINGS)[0]
    beta = softest(table, [y])
    gains = kalman_gain(observer_of(beta, 0.3, SETTINGS), DT)
    feedback = Feedback(100.0, 40.0, 0.0, 0.003)
    poles = []
    for delay in (0.0, 0.0054):
        part = linear_at(table, y, delay, DT)
        loop = open_loop(part, part, gains, 3.4e5, feedback, DT)
        values = np.linalg.eigvals(loop.a + np.outer(loop.b, loop.c))
        poles.append(np.sort_complex(values[np.abs(values) > 0.5]))
    np.testing.assert_allclose(poles[0], poles[1], atol=2e-4)


def test_dead_time_that_is_not_known_makes_the_loop_ring_and_the_linear_loop_says_so() -> None:
    table = load_table("bergamo")
    y = points(table, SETTINGS)[0]
    beta = softest(table, [y])
    gains = kalman_gain(observer_of(beta, 0.3, SETTINGS), DT)
    model = linear_at(table, y, DT, DT)
    feedback = Feedback(1000.0, 100.0, 0.0, 0.003)
    near = open_loop(linear_at(table, y, DT, DT), model, gains, 3.4e5, feedback, DT)
    late = open_loop(linear_at(table, y, 0.02, DT), model, gains, 3.4e5, feedback, DT)
    assert linear_loop.is_stable(near)
    assert not linear_loop.is_stable(late)


def test_lag_of_the_position_transducer_is_in_the_loop() -> None:
    # known, it moves the observer's poles and none of the state feedback's; not known, it moves these too
    table = load_table("bergamo")
    slow = table.with_values({"effects.position_sensor_lag.time_constant": 0.02})
    y = points(table, SETTINGS)[0]
    gains = kalman_gain(observer_of(softest(table, [y]), 0.1, SETTINGS), DT)
    feedback = Feedback(0.0, 40.0, 0.0, 0.003)
    parts = {name: linear_at(t, points(t, SETTINGS)[0], DT, DT) for name, t in (("quick", table), ("slow", slow))}
    poles = {}
    for plant, model in (("quick", "quick"), ("slow", "slow"), ("slow", "quick")):
        loop = open_loop(parts[plant], parts[model], gains, 3.4e5, feedback, DT)
        poles[plant, model] = np.linalg.eigvals(loop.a + np.outer(loop.b, loop.c))

    def moved(pole: complex, loop: tuple[str, str]) -> float:
        return float(np.min(np.abs(poles[loop] - pole)))

    kept = [p for p in poles["quick", "quick"] if abs(p) > 0.5 and moved(p, ("slow", "slow")) < 1e-9]
    assert len(kept) == 4  # position, the oil column's pair, the spool
    assert len(poles["slow", "slow"]) == len(poles["quick", "quick"]) + 2
    assert max(moved(p, ("slow", "quick")) for p in kept) > 1e-3
