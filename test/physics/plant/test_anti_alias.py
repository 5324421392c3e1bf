"""The filter behind the accelerometer, against the same equation integrated in fine steps and against its response."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from shake_ros.physics.plant.sensors import NONE, advance_filter, filter_step
from shake_ros.physics.plant.simulation import run
from shake_ros.settings import load_table


def filtered(cutoff: float, dt: float, ends: np.ndarray, means: np.ndarray) -> np.ndarray:
    """Output at every sample, from rest at the first value."""
    step, z = filter_step(cutoff, dt), np.array([ends[0], 0.0])
    out = [z[0]]
    for before, after, mean in zip(ends[:-1], ends[1:], means, strict=True):
        advance_filter(step, z, before, after, mean)
        out.append(z[0])
    return np.array(out)


@pytest.mark.parametrize(("cutoff", "rate"), [(82.0, 204.8), (205.0, 512.0), (40.0, 1000.0)])
@pytest.mark.parametrize("frequency", [3.0, 25.0, 60.0])
def test_sine_comes_out_as_the_response_of_the_filter_tells(cutoff: float, rate: float, frequency: float) -> None:
    w, dt = 2.0 * np.pi * frequency, 1.0 / rate
    t = np.arange(round(2.0 * rate)) * dt
    means = -np.diff(np.cos(w * t)) / (w * dt)
    out = filtered(cutoff, dt, np.sin(w * t), means)
    r = frequency / cutoff
    response = 1.0 / (1.0 - r * r + 1j * np.sqrt(2.0) * r)
    wanted = np.imag(response * np.exp(1j * w * t))
    late = t > 0.5
    assert np.max(np.abs(out - wanted)[late]) < 0.003 + 0.2 * (w * dt / np.pi) ** 4


@pytest.mark.parametrize("instant", [0.1, 0.37, 0.5, 0.81])
def test_jump_within_a_sample_keeps_its_instant(instant: float) -> None:
    cutoff, dt, at = 80.0, 1.0 / 200.0, 20
    ends = np.where(np.arange(60) > at, 1.0, 0.0)
    means = np.where(np.arange(59) > at, 1.0, 0.0)
    means[at] = 1.0 - instant
    w = 2.0 * np.pi * cutoff
    begun = (at + instant) * dt

    def rates(t: float, z: np.ndarray) -> list[float]:
        return [z[1], w * w * (float(t > begun) - z[0]) - np.sqrt(2.0) * w * z[1]]

    t = np.arange(60) * dt
    exact = solve_ivp(rates, (0.0, t[-1]), [0.0, 0.0], t_eval=t, rtol=1e-9, atol=1e-10, max_step=dt / 50).y[0]
    jumped = filtered(cutoff, dt, ends, means)
    blind = filtered(cutoff, dt, ends, 0.5 * (ends[:-1] + ends[1:]))
    assert np.max(np.abs(jumped - exact)) < 0.06
    if abs(instant - 0.5) > 0.1:
        assert np.sum((jumped - exact) ** 2) < 0.2 * np.sum((blind - exact) ** 2)


def test_without_a_cutoff_there_is_no_filter() -> None:
    assert filter_step(0.0, 1e-3) is NONE


def test_recording_of_a_table_through_the_filter_is_its_acceleration_filtered_in_fine_steps() -> None:
    table, cutoff, fine, factor = load_table("bergamo"), 60.0, 1e-4, 50
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
    assert np.sqrt(np.mean((slow - wanted) ** 2)) < 0.01 * np.std(wanted)
    assert np.sqrt(np.mean((run(table, commands, fine * factor)[:, 2] - wanted) ** 2)) > 0.1 * np.std(wanted)
