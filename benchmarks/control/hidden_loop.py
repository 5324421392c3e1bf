"""The package's observer and law around a hidden table, as one compiled function."""

from __future__ import annotations

import math

import numba
import numpy as np

from benchmarks.discovery import hidden_tables as hidden
from shake_ros.core.control.runner import step_controller
from shake_ros.core.observer.runner import step_observer


@numba.njit(cache=True, nogil=True)
def run_hidden(t, start, law, state, observer, seen, model, reference, feedforward, late, noise, space, truth, command):
    """The package's observer and law around the hidden table, which begins at rest at `start` [m].

    A command acts `late` samples after its own, and then the table's own dead time. Rows of truth: position, velocity,
    acceleration; ends where a number is not finite.
    """
    y, d = np.zeros(hidden.STATES), np.zeros(hidden.STATES)
    held = 0.5 * t.constant_force / t.area  # a table at rest is held by its oil
    y[hidden.PA], y[hidden.PB] = 0.5 * (t.supply + t.tank) - held, 0.5 * (t.supply + t.tank) + held
    y[hidden.PS], y[hidden.X], y[hidden.LAGX] = t.supply, start, start
    k, work = np.zeros((4, hidden.STATES)), np.zeros(hidden.STATES)
    h = hidden.SAMPLE / hidden.SUBSTEPS
    behind = round(t.command_delay / h) + late * hidden.SUBSTEPS
    estimate, last, measured = np.zeros(3), 0.0, np.full(4, np.nan)
    for i in range(len(reference)):
        truth[i, 2] = hidden.rates(t, y, i * hidden.SAMPLE, last, hidden.regular_friction(t, y), d)
        truth[i, 0], truth[i, 1] = y[hidden.X] + y[hidden.B], y[hidden.V] + y[hidden.DB]
        shown = y[hidden.LAGX] if t.position_sensor_lag > 0.0 else y[hidden.X]
        shown = round((shown + noise[i]) / hidden.POSITION_STEP) * hidden.POSITION_STEP
        measured[0] = shown
        step_observer(seen, observer, model, measured, command[i - 1] if i > 0 else 0.0, hidden.SAMPLE, space, estimate)
        if not math.isfinite(estimate[2] + truth[i, 2]):
            return i
        state, command[i] = step_controller(state, law, feedforward[1][i], estimate, feedforward[0][i], hidden.SAMPLE)
        for j in range(hidden.SUBSTEPS):
            back = i * hidden.SUBSTEPS + j - behind
            last = command[back // hidden.SUBSTEPS] if back >= 0 else 0.0
            hidden.step(t, y, i * hidden.SAMPLE + j * h, h, last, k, work)
    return len(reference)
