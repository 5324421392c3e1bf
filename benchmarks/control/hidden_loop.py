"""The package's observer and law around a hidden table, as one compiled function."""

from __future__ import annotations

import math

import numba
import numpy as np

from benchmarks.discovery import hidden_tables as hidden
from shake_ros.control.closed_loop import ClosedLoop
from shake_ros.control.laws.runner import Controller, step_controller
from shake_ros.control.observer.runner import Observer, step_observer, work

LATE = 1  # samples by which a command reaches the table late


@numba.njit(cache=True, nogil=True)
def run(t, start, law, state, observer, seen, model, reference, feedforward, noise, frozen_at, bias, space, out):
    """Observer and law around the table, which begins at rest at `start` [m]; the number of samples that are finite.

    A command acts LATE samples after its own, and then the table's own dead time. Columns of noise: position,
    accelerometer, P_A, P_B, NaN where the sensor says nothing; from sample `frozen_at` on the accelerometer repeats
    itself. Out: truth and estimate, rows of position, velocity, acceleration, and command.
    """
    truth, estimates, command = out
    y, d = np.zeros(hidden.STATES), np.zeros(hidden.STATES)
    held = 0.5 * t.constant_force / t.area  # a table at rest is held by its oil
    y[hidden.PA], y[hidden.PB] = 0.5 * (t.supply + t.tank) - held, 0.5 * (t.supply + t.tank) + held
    y[hidden.PS], y[hidden.X], y[hidden.LAGX] = t.supply, start, start
    k, extra = np.zeros((4, hidden.STATES)), np.zeros(hidden.STATES)
    h = hidden.SAMPLE / hidden.SUBSTEPS
    behind = round(t.command_delay / h) + LATE * hidden.SUBSTEPS
    estimate, last, measured = np.zeros(3), 0.0, np.zeros(4)
    for i in range(len(reference)):
        truth[i, 2] = hidden.rates(t, y, i * hidden.SAMPLE, last, hidden.regular_friction(t, y), d)
        truth[i, 0], truth[i, 1] = y[hidden.X] + y[hidden.B], y[hidden.V] + y[hidden.DB]
        shown = y[hidden.LAGX] if t.position_sensor_lag > 0.0 else y[hidden.X]
        measured[0] = round((shown + noise[i, 0]) / hidden.POSITION_STEP) * hidden.POSITION_STEP
        if i < frozen_at:
            measured[1] = y[hidden.LAGA] + bias + noise[i, 1]
        measured[2], measured[3] = y[hidden.PA] + noise[i, 2], y[hidden.PB] + noise[i, 3]
        step_observer(seen, observer, model, measured, command[i - 1] if i > 0 else 0.0, hidden.SAMPLE, space, estimate)
        if not math.isfinite(estimate[2] + truth[i, 2]):
            return i
        estimates[i] = estimate
        state, command[i] = step_controller(state, law, feedforward[1][i], estimate, feedforward[0][i], hidden.SAMPLE)
        for j in range(hidden.SUBSTEPS):
            back = i * hidden.SUBSTEPS + j - behind
            last = command[back // hidden.SUBSTEPS] if back >= 0 else 0.0
            hidden.step(t, y, i * hidden.SAMPLE + j * h, h, last, k, extra)
    return len(reference)


def closed_loop(
    truth: hidden.Truth,
    observer: Observer,
    law: Controller,
    reference: np.ndarray,
    noise: np.ndarray,
    *,
    start: float = 0.0,
    frozen_at: int | None = None,
    bias: float = 0.0,
) -> ClosedLoop:
    """A run with the noise of the sensors (n, 4), as `run` has it; rows behind a lost loop are NaN."""
    n = len(reference)
    assert law.virtual is not None
    motion, estimates, command = np.full((n, 3), np.nan), np.full((n, 3), np.nan), np.zeros(n)
    kept, model = observer.compiled
    state, seen = law.initial_state()[: law.law_size], observer.initial_state(start)
    frozen = n if frozen_at is None else frozen_at
    given = model, reference, law.virtual.follow(reference), noise, frozen, bias, work()
    end = run(truth, start, law.law, state, kept, seen, *given, (motion, estimates, command))
    motion[end:] = np.nan
    return ClosedLoop(hidden.SAMPLE, reference, estimates, motion, command, noise)
