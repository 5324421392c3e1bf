"""One step of the table by the embedded Runge–Kutta pair 5(4) of Dormand and Prince, with its error.

The spool is no part of the step: `spool_path` gives it at every stage. Source: Dormand, Prince 1980, Journal of
Computational and Applied Mathematics 6, 19. Verified against Radau at rtol 1e-9 and by the order of convergence.
"""

from __future__ import annotations

import math

import numpy as np

from shake_ros.core.compiled import inlined_kernel, kernel, njit
from shake_ros.core.plant.right_hand_side import table_rates
from shake_ros.core.plant.shear_frame import LARGEST_STOREYS
from shake_ros.core.plant.spool_path import END, END_RATE
from shake_ros.core.plant.states import CONTINUOUS, DECLARED, SPOOL, SPOOL_RATE

STAGES = 7
STAGE = STAGES  # row of the work array: state at a stage, at the end the state after the step
PATH = STAGES + 1  # row of the work array: see spool_path.py
PACE = STAGES + 2  # row of the work array: see pace.py
ROWS = STAGES + 3
# Error scale of each continuous state: absolute part in its unit, at tolerance 1. The spool's are not used.
ABSOLUTE = np.array(
    [1e-2, 0.2, 1e6, 1e6, 1.0, 1.0]  # declared
    + [1e6, 1.0, 1e-2, 0.2, 1e-3, 0.2, 1e-2, 0.2, 20.0, 1e-2, 0.1]  # effects, friction memory
    + [1e-4, 1e-4, 1e6, 1e6]  # pipelines
    + LARGEST_STOREYS * [1e-2, 0.2]
)


@njit
def workspace():
    """Work array of an integration: rates of the stages, a state, the spool's path; shape (ROWS, CONTINUOUS)."""
    return np.zeros((ROWS, CONTINUOUS))


@inlined_kernel
def worst_error(work, y, h, first, last, worst):
    """Largest of `worst` and the errors of states first … last − 1 per scale [-]; not finite where one is not."""
    for i in range(first, last):
        slip = (
            71.0 / 57600.0 * work[0, i]
            - 71.0 / 16695.0 * work[2, i]
            + 71.0 / 1920.0 * work[3, i]
            - 17253.0 / 339200.0 * work[4, i]
            + 22.0 / 525.0 * work[5, i]
            - 1.0 / 40.0 * work[6, i]
        )
        error = abs(h * slip) / (ABSOLUTE[i] + abs(y[i]))
        if not error <= worst:  # also true for NaN
            worst = error
            if not math.isfinite(error):
                return math.inf  # a later state must not hide it
    return worst


@kernel
def dormand_prince(p, y, work, h, force, n):
    """One trial step of size h from y, with the rates at y in work[0] and the spool in work[PATH].

    Returns
    -------
    (error relative to the states' scales [-], acceleration at the end [m/s²]); the state after the step stands in
    work[STAGE], its rates in work[6].
    """
    k, stage, path = work, work[STAGE], work[PATH]
    stage[SPOOL_RATE] = path[END_RATE]
    for i in range(n):
        stage[i] = y[i] + h * (1.0 / 5.0 * k[0, i])
    stage[SPOOL] = path[0]
    table_rates(p, stage, y, force, n, k[1])
    for i in range(n):
        stage[i] = y[i] + h * (3.0 / 40.0 * k[0, i] + 9.0 / 40.0 * k[1, i])
    stage[SPOOL] = path[1]
    table_rates(p, stage, y, force, n, k[2])
    for i in range(n):
        stage[i] = y[i] + h * (44.0 / 45.0 * k[0, i] - 56.0 / 15.0 * k[1, i] + 32.0 / 9.0 * k[2, i])
    stage[SPOOL] = path[2]
    table_rates(p, stage, y, force, n, k[3])
    for i in range(n):
        stage[i] = y[i] + h * (
            19372.0 / 6561.0 * k[0, i]
            - 25360.0 / 2187.0 * k[1, i]
            + 64448.0 / 6561.0 * k[2, i]
            - 212.0 / 729.0 * k[3, i]
        )
    stage[SPOOL] = path[3]
    table_rates(p, stage, y, force, n, k[4])
    for i in range(n):
        stage[i] = y[i] + h * (
            9017.0 / 3168.0 * k[0, i]
            - 355.0 / 33.0 * k[1, i]
            + 46732.0 / 5247.0 * k[2, i]
            + 49.0 / 176.0 * k[3, i]
            - 5103.0 / 18656.0 * k[4, i]
        )
    stage[SPOOL] = path[END]
    table_rates(p, stage, y, force, n, k[5])
    for i in range(n):
        stage[i] = y[i] + h * (
            35.0 / 384.0 * k[0, i]
            + 500.0 / 1113.0 * k[2, i]
            + 125.0 / 192.0 * k[3, i]
            - 2187.0 / 6784.0 * k[4, i]
            + 11.0 / 84.0 * k[5, i]
        )
    stage[SPOOL] = path[END]
    stage[SPOOL_RATE] = path[END_RATE]
    acceleration = table_rates(p, stage, y, force, n, k[6])
    error = worst_error(work, y, h, 0, SPOOL, 0.0)
    return worst_error(work, y, h, DECLARED, n, error), acceleration
