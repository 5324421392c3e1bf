"""The filter behind the accelerometer, against the same equation integrated in fine steps and against its response."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from shake_ros.physics.plant.sensors import advance_filter, begin_filter
from shake_ros.physics.plant.simulation import run
from shake_ros.settings import load_table


def filtered(cutoff: float, times: np.ndarray, ends: np.ndarray, gains: np.ndarray) -> np.ndarray:
    """Output at every instant, from rest at the first value; `gains` of the input's integral between two instants."""
    row = np.zeros(4)
    begin_filter(row, cutoff, ends[0])
    out = [ends[0]]
    for after, gain, step in zip(ends[1:], gains, np.diff(times), strict=True):
        advance_filter(row, after, gain, step)
        out.append(row[1])
    return np.array(out)


@pytest.mark.parametrize(("cutoff", "rate"), [(82.0, 204.8), (205.0, 512.0), (40.0, 1000.0)])
@pytest.mark.parametrize("frequency", [3.0, 25.0, 60.0])
def test_sine_comes_out_as_the_response_of_the_filter_tells(cutoff: float, rate: float, frequency: float) -> None:
    w, dt = 2.0 * np.pi * frequency, 1.0 / rate
    t = np.arange(round(2.0 * rate)) * dt
    out = filtered(cutoff, t, np.sin(w * t), -np.diff(np.cos(w * t)) / w)
    r = frequency / cutoff
    response = 1.0 / (1.0 - r * r + 1j * np.sqrt(2.0) * r)
    wanted = np.imag(response * np.exp(1j * w * t))
    late = t > 0.5
    assert np.max(np.abs(out - wanted)[late]) < 0.003 + 0.2 * (w * dt / np.pi) ** 4


@pytest.mark.parametrize("rise", [1e-3, 1e-6, 1e-12])
def test_short_steps_over_a_jump_give_its_response(rise: float) -> None:
    cutoff, jump = 80.0, 0.1
    times = np.array([0.0, jump, jump + rise, *(jump + rise + np.linspace(0.001, 0.05, 7))])
    ends = np.where(times > jump, 1.0, 0.0)
    gains = 0.5 * np.diff(times) * (ends[:-1] + ends[1:])
    w = 2.0 * np.pi * cutoff

    def rates(t: float, z: np.ndarray) -> list[float]:
        return [z[1], w * w * (min(max((t - jump) / rise, 0.0), 1.0) - z[0]) - np.sqrt(2.0) * w * z[1]]

    after = times[2:]
    exact = solve_ivp(rates, (jump, after[-1]), [0.0, 0.0], t_eval=after, rtol=1e-9, atol=1e-10, max_step=1e-4).y[0]
    assert filtered(cutoff, times, ends, gains)[2:] == pytest.approx(exact, abs=2e-6)


@pytest.mark.parametrize("lag", [0.0, 6e-3])
@pytest.mark.parametrize("cutoff", [20.0, 60.0, 110.0])
def test_recording_through_the_filter_is_the_acceleration_filtered_in_fine_steps(cutoff: float, lag: float) -> None:
    table, fine, factor = load_table("bergamo"), 1e-4, 50
    table = table.with_values({"friction.coulomb_level": 900.0, "effects.accelerometer_lag.time_constant": lag})
    commands = 0.25 * np.sin(2.0 * np.pi * 4.0 * np.arange(200) * fine * factor)
    quick = run(table, np.repeat(commands, factor), fine)[:, 2]
    w = 2.0 * np.pi * cutoff
    transition = np.linalg.inv(np.eye(2) - 0.5 * fine * (A := np.array([[0.0, 1.0], [-w * w, -np.sqrt(2.0) * w]])))
    z, exact = np.array([quick[0], 0.0]), [quick[0]]
    for before, after in zip(quick[:-1], quick[1:], strict=True):  # the trapezoid's rule
        z = transition @ (z + 0.5 * fine * (A @ z) + np.array([0.0, 0.5 * fine * w * w * (before + after)]))
        exact.append(float(z[0]))
    slow = run(table, commands, fine * factor, cutoff=cutoff)[:, 2]
    wanted = np.array(exact)[::factor]
    assert np.sqrt(np.mean((slow - wanted) ** 2)) < 0.001 * np.std(wanted)
    without = run(table, commands, fine * factor)[:, 2]
    assert np.sqrt(np.mean((without - wanted) ** 2)) > (0.1 if cutoff < 110.0 else 0.02) * np.std(wanted)
