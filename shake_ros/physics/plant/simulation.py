"""Simulation of recordings: one run, or many parameter sets side by side on all cores."""

from __future__ import annotations

import math
import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from shake_ros.physics.effects.friction import film_after
from shake_ros.physics.effects.structure import specimen_after
from shake_ros.physics.plant.cylinder import rest_pressures
from shake_ros.physics.plant.integration import MOST, OUTPUTS, acceleration_now, simulate, spool_command
from shake_ros.physics.plant.parameters import INDEX, TableParameters, records
from shake_ros.physics.plant.states import (
    CONTINUOUS,
    FILM,
    FRICTION_AT_STOP,
    FRICTION_RISE,
    HELD_COMMAND,
    LAGGED_POSITION,
    LINE_PRESSURE_A,
    LINE_PRESSURE_B,
    POSITION,
    PRESSURE_A,
    PRESSURE_B,
    PRESSURE_SUPPLY,
    SPECIMEN,
    SPECIMEN_RATE,
    SPOOL,
    STATES,
    STEP_SIZE,
    VALVE,
    VELOCITY,
)
from shake_ros.physics.valve.detailed import DETAILED, VALVE_STATES, valve_at_rest
from shake_ros.quantities import ShakeError

TOLERANCE = 2e-6  # relative local error of a step; keeps the acceleration within 0.1 % of Radau (test_integration.py)
SMOOTH = 1e-6  # the same of a fit, whose batches follow the steps of their first run (integration.py)
NOTHING = np.zeros(0)
UNSEEN = np.zeros((0, 2))  # no measurement that corrects the run
NO_PACE = np.zeros((0, 1 + MOST))  # every run by its own steps
WEIGHED = 3  # corrections of the load pressure; its law is linear but for the chambers' limits
BALANCED = 1e-9  # [m/s²] departure of the acceleration that is none
COLUMNS = ("position", "velocity", "acceleration", "pressure_a", "pressure_b", "pressure_supply", "spool")


def initial_state(vector: np.ndarray, position: float = 0.0) -> np.ndarray:
    """State of a table at rest: valve at null, both chambers at half the supply pressure.

    Where the areas differ the two pressures stand as the areas do the other way round, so that the piston stays.

    Parameters
    ----------
    vector : parameters in the order of `parameters.NAMES`. position [m].
    """
    y = np.zeros(STATES)
    supply = float(vector[INDEX["supply.supply_pressure"]])
    tank, ratio = (float(vector[INDEX[name]]) for name in ("supply.tank_pressure", "body.area_ratio"))
    at_rest = rest_pressures(supply, tank, ratio)
    y[POSITION] = y[LAGGED_POSITION] = position
    y[PRESSURE_A], y[PRESSURE_B] = at_rest
    y[PRESSURE_SUPPLY] = supply
    y[LINE_PRESSURE_A], y[LINE_PRESSURE_B] = y[PRESSURE_A], y[PRESSURE_B]
    y[FRICTION_AT_STOP] = y[FRICTION_RISE] = vector[INDEX["friction.stribeck_rise"]]  # after a long rest
    y[SPOOL] = y[HELD_COMMAND] = 0.0
    y[STEP_SIZE] = 5e-4
    if vector[INDEX["valve.kind"]] == DETAILED:
        y[VALVE : VALVE + VALVE_STATES] = valve_at_rest(records(vector)[0], supply, tank)
    return y


def remember(vector: np.ndarray, y: np.ndarray, past: np.ndarray, slid: np.ndarray, sample_time: float) -> None:
    """Give a state what a motion has left, in place: the film of friction, and the specimen's swaying.

    Parameters
    ----------
    vector : parameters in the order of `parameters.NAMES`. past : velocity before the state's instant, (n,) [m/s].
    slid : the same as the film has it, (m,) [m/s]. sample_time : of both [s].
    """
    if vector[INDEX["effects.film_friction.relief"]] and len(slid):
        y[FILM] = film_after(records(vector)[0], slid, sample_time)
    if vector[INDEX["effects.specimen_resonance.mass"]] and len(past):
        y[SPECIMEN], y[SPECIMEN_RATE] = specimen_after(records(vector)[0], np.append(past, y[VELOCITY]), sample_time)


def weigh(vector: np.ndarray, y: np.ndarray, acceleration: float = 0.0) -> None:
    """Give a state the load pressure that makes an acceleration [m/s²], as far as supply and tank allow, in place.

    So a table at rest is held by its oil against a constant force or a spring.
    """
    p, rates = records(vector)[0], np.zeros(CONTINUOUS)
    low, high = p.supply_tank_pressure, p.supply_supply_pressure
    push = (p.body_table_mass + p.body_specimen_mass) / ((1.0 + p.body_area_ratio) * p.body_piston_area)
    for _ in range(WEIGHED):
        missing = acceleration - acceleration_now(p, y, rates)
        if abs(missing) < BALANCED:
            break
        y[PRESSURE_A] = min(max(y[PRESSURE_A] + push * missing, low), high)
        y[PRESSURE_B] = min(max(y[PRESSURE_B] - push * missing, low), high)


def moving_state(
    vector: np.ndarray, position: float, velocity: float, acceleration: float, command: float | None
) -> np.ndarray:
    """State of a table in motion under a command that has stood, as far as supply and tank allow.

    Parameters
    ----------
    vector : parameters in the order of `parameters.NAMES`. position [m]. velocity [m/s].
    acceleration : that the load pressure makes [m/s²]; NaN: the pressures are those at rest.
    command : that the spool has followed [-]; None: it is at null.
    """
    y = initial_state(vector, position)
    y[VELOCITY] = velocity
    if command is not None:
        y[SPOOL] = spool_command(records(vector)[0], y, command)
    if math.isfinite(acceleration):
        weigh(vector, y, acceleration)
    return y


def series(name: str, values: np.ndarray, length: int) -> np.ndarray:
    """`values` as contiguous floats of shape (length,); ShakeError where one is not finite or the length differs."""
    result = np.ascontiguousarray(values, dtype=float)
    if result.shape != (length,):
        raise ShakeError(f"{name}: shape {result.shape} where ({length},) is expected")
    finite = np.isfinite(result)
    if not finite.all():
        k = int(np.argmin(finite))
        raise ShakeError(f"{name}: sample {k} is {result[k]}")
    return result


_most = {"threads": math.inf}


def use_threads(most: float) -> None:
    """Batches of this process take no more threads than this from now on: other processes have the other cores."""
    _most["threads"] = most


def workers() -> int:
    """Number of threads for batches: the cores this process may use, or fewer as `use_threads` says."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return int(min(cores, _most["threads"]))


def run_batch(
    vectors: np.ndarray,
    starts: np.ndarray,
    commands: np.ndarray,
    sample_time: float,
    *,
    track: np.ndarray = NOTHING,
    forces: np.ndarray = NOTHING,
    command_before: float = 0.0,
    measured: np.ndarray = UNSEEN,
    injection: float = 0.0,
    cutoff: float = 0.0,
    columns: tuple[int, ...] = (1, 2),
    tolerance: float = TOLERANCE,
) -> np.ndarray:
    """Simulate many parameter sets, under the same commands or each under its own, on all cores without the GIL.

    Under the same commands all take the steps of the first one as far as their errors permit (integration.py), so that
    the differences of the results are those of the parameters.

    Parameters
    ----------
    vectors : shape (m, len(NAMES)).
    starts : first states, shape (m, STATES).
    commands : shape (n,) or (m, n) [-].
    track : measured position, shape (n,) [m], or empty. forces : external force, shape (n,) [N], or empty.
    command_before : as in `run` [-].
    measured, injection : velocity [m/s] and acceleration [m/s²] of the first k samples, shape (k, 2), NaN where there
        is none, towards which the runs are corrected, and the rate [1/s]; 0: one that falls as the state becomes known.
    cutoff : of the filter behind the accelerometer [Hz]; 0 where there is none, see sensors.py.
    columns : which of COLUMNS to keep.

    Returns
    -------
    shape (m, n, len(columns))
    """
    rows = records(vectors)
    length = np.shape(commands)[-1]
    each = [series("valve command", row, length) for row in np.atleast_2d(commands)]
    if len(each) not in (1, len(rows)):
        raise ShakeError(f"{len(each)} rows of commands for {len(rows)} parameter sets")
    track = series("position", track, length) if len(track) else NOTHING
    forces = series("force", forces, length) if len(forces) else NOTHING
    result = np.empty((len(rows), length, len(columns)))
    pace = np.empty((length, 1 + MOST)) if len(rows) > 1 and len(each) == 1 else NO_PACE

    def one(i: int) -> None:
        out = np.empty((length, OUTPUTS))
        given = (rows[i], each[i % len(each)], command_before, forces, track, measured, injection)
        simulate(*given, starts[i], sample_time, tolerance, cutoff, pace, len(pace) > 0 and i > 0, out)
        result[i] = out[:, columns]

    one(0)
    with ThreadPoolExecutor(workers()) as pool:
        list(pool.map(one, range(1, len(rows))))
    return result


def run(
    parameters: TableParameters,
    commands: np.ndarray,
    sample_time: float,
    *,
    position: np.ndarray | float = 0.0,
    forces: np.ndarray = NOTHING,
    state: np.ndarray | None = None,
    command_before: float = 0.0,
    measured: np.ndarray = UNSEEN,
    injection: float = 0.0,
    cutoff: float = 0.0,
    tolerance: float = TOLERANCE,
) -> np.ndarray:
    """Simulate one recording.

    Parameters
    ----------
    commands : shape (n,) [-], held from each sample to the next. sample_time [s].
    command_before : before the first one; it acts until that arrives where there is a dead time; null, as in a
        `Table`, where not given [-].
    position : start [m], or the measured position of shape (n,) which volumes and position-dependent effects follow.
    forces : external force, shape (n,) [N].
    state : first state; at rest where not given.
    measured, injection, cutoff : as of `run_batch`.

    Raises
    ------
    ShakeError : a command, force or position that is not finite, or of another length than the commands.

    Returns
    -------
    shape (n, 7): position and its rate as the transducer shows them [m], [m/s], acceleration [m/s²],
    P_A, P_B, P_s [Pa], spool [-].
    """
    vector = parameters.vector()
    y0 = initial_state(vector, float(np.ravel(position)[0])) if state is None else state
    return run_batch(
        vector,
        y0[None, :],
        commands,
        sample_time,
        forces=forces,
        track=position if isinstance(position, np.ndarray) else NOTHING,
        command_before=float(command_before),
        measured=measured,
        injection=injection,
        cutoff=cutoff,
        columns=tuple(range(OUTPUTS)),
        tolerance=tolerance,
    )[0]
