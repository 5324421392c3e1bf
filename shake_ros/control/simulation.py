"""Plant, sensors, observer, controller and reference as one compiled function; many loops side by side on all cores.

The same semantics and the same numbers as the graph in lock-step: measurement k, estimate k from it and command k − 1,
command k from estimate k and reference k, then the plant advances under command k. The virtual table of a model
feedforward does not see the real table; it runs along the reference once and serves every law (`VirtualTable.follow`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from shake_ros.compiled import njit
from shake_ros.control.closed_loop import ClosedLoop
from shake_ros.control.laws import harmonic_cancellation
from shake_ros.control.laws.harmonic_cancellation import HarmonicCancellation
from shake_ros.control.laws.runner import Controller, own_feedforward, step_controller
from shake_ros.control.observer.runner import NO_MODEL, NO_OBSERVER, Compiled, Observer, step_observer, work
from shake_ros.packing import fields_layout, numbers
from shake_ros.physics.plant.dormand_prince import STAGE, workspace
from shake_ros.physics.plant.integration import OUTPUTS, acceleration_now, advance_late, outputs
from shake_ros.physics.plant.parameters import TableParameters, dead_time, records
from shake_ros.physics.plant.sensors import normal_draws
from shake_ros.physics.plant.simulation import TOLERANCE, workers
from shake_ros.physics.plant.states import BASE, BASE_RATE, POSITION, STATES, VELOCITY
from shake_ros.physics.plant.table import Table
from shake_ros.quantities import ShakeError

Array = NDArray[np.float64]
Result = TypeVar("Result")
MEASURED = 5  # columns of `measured`: position, acceleration, P_A, P_B, P_s
NOTHING = np.zeros(0)
NO_MOTION = np.zeros((0, 3))
NO_CANCELLATION = np.zeros(1, fields_layout(HarmonicCancellation))


@njit
def read_sensors(p, noise, shown, measured):  # type: ignore[no-untyped-def]
    """Noise and the position converter's steps and range on what the sensors see, as `plant.sensors.SensorNoise`.

    Parameters
    ----------
    p : parameter record.
    noise : (5,) standard normal draws.
    shown : (OUTPUTS,) row of `integration.outputs`.
    measured : (5,) result, position [m], acceleration [m/s²], P_A, P_B, P_s [Pa]
    """
    position = shown[0] + p.sensors_position_noise * noise[0]
    if p.sensors_position_bits > 0.0:
        step = p.sensors_position_range / 2.0**p.sensors_position_bits
        position = np.rint(position / step) * step
    half = 0.5 * p.sensors_position_range
    measured[0] = min(max(position, -half), half)
    measured[1] = shown[2] + p.sensors_acceleration_noise * noise[1]
    for i in range(3):
        measured[2 + i] = shown[3 + i] + p.sensors_pressure_noise * noise[2 + i]


@njit
def run_loop(p, plant, observer, seen, law, state, reference, feedforward, added, timing, noise, space, out):  # type: ignore[no-untyped-def]
    """One closed loop, sample by sample.

    Parameters
    ----------
    p : parameter record of the plant.
    plant : its first state with the past commands behind it; changed in place.
    observer : `Observer.compiled`; `NO_OBSERVER` gives the controller the true states.
    seen : the observer's first state, changed in place.
    law : `Controller.law`.
    state : the controller's first state.
    reference : (n, 3).
    feedforward : commands (n,) and motion (n, 3) of a virtual table, or both empty.
    added : harmonics' first state, empty without them, and numbers of a harmonic cancellation.
    timing : (dt [s], delay of the command in samples, whole samples and fraction of the plant's own dead time)
    noise : (n, 5) standard normal draws.
    space : from `observer.law.work`.
    out : estimate (n, 3), truth (n, 3), command (n,), measured (n, 5)

    Returns
    -------
    number of samples before a value was not finite, n where none was.
    """
    observing, model = observer
    commands, motion = feedforward
    harmonics, cancelling = added
    dt, delay, whole, fraction = timing
    estimate, truth, command, measured = out
    work, shown, past = workspace(), np.zeros(OUTPUTS), plant[STATES:]
    u = 0.0
    for k in range(reference.shape[0]):
        acceleration = acceleration_now(p, plant, work[STAGE])
        outputs(p, plant, acceleration, shown)
        read_sensors(p, noise[k], shown, measured[k])
        truth[k, 0] = plant[POSITION] + plant[BASE]
        truth[k, 1] = plant[VELOCITY] + plant[BASE_RATE]
        truth[k, 2] = acceleration
        if observing[0].kind == 0.0:
            estimate[k] = truth[k]
        else:
            step_observer(seen, observing, model, measured[k], u, dt, space, estimate[k])
        if not math.isfinite(estimate[k, 0] + estimate[k, 1] + estimate[k, 2]):
            return k
        if commands.shape[0] > 0:
            state, u = step_controller(state, law, motion[k], estimate[k], commands[k], dt)
        else:
            wanted = reference[k]
            if harmonics.shape[0] > 0:
                harmonics, wanted = harmonic_cancellation.step(harmonics, cancelling, k * dt, wanted, measured[k, 1])
            own = own_feedforward(law, wanted)
            state, u = step_controller(state, law, wanted, estimate[k], own, dt)
        command[k] = u
        acting = min(max(command[k - delay] if k >= delay else 0.0, -1.0), 1.0)
        advance_late(p, plant, past, acting, whole, fraction, 0.0, dt, work, k > 0, TOLERANCE)
        if not math.isfinite(plant[VELOCITY] + plant[POSITION] + u):
            return k
    return reference.shape[0]


@dataclass(frozen=True)
class Loop:
    """A closed loop to be run.

    Attributes
    ----------
    table : the plant with its sensors.
    seed : of the sensor noise.
    observer : estimates from the measured position; None hands the true states to the controller.
    controller : the law.
    reference : (n, 3) position [m], velocity [m/s], acceleration [m/s²].
    feedforward : commands (n,) and motion (n, 3) of the controller's virtual table along this reference; None, with a
        controller that has one, computes them.
    delay : samples by which a command reaches the valve late.
    start : initial position of the table [m].
    cancellation : of harmonics, under a law without a virtual table.
    """

    table: TableParameters
    observer: Observer | None
    controller: Controller
    reference: Array
    feedforward: tuple[Array, Array] | None = None
    seed: int = 0
    delay: int = 0
    start: float = 0.0
    cancellation: HarmonicCancellation | None = None


def simulate(loop: Loop) -> tuple[ClosedLoop, int]:
    """Run a loop in compiled code.

    Returns
    -------
    (run, samples) : the run, and the number of its samples that are finite; the rows behind them are NaN.

    Raises
    ------
    ShakeError : sample times differ, the feedforward is of another length than the reference, or harmonics are to be
        cancelled under a virtual table.
    """
    dt, n = loop.controller.sample_time, len(loop.reference)
    if loop.observer is not None and loop.observer.sample_time != dt:
        raise ShakeError(f"closed loop: sample times {loop.observer.sample_time:g} and {dt:g} s differ")
    reference = np.ascontiguousarray(loop.reference, dtype=np.float64)
    feedforward = loop.feedforward
    if feedforward is None:
        virtual = loop.controller.virtual
        feedforward = (NOTHING, NO_MOTION) if virtual is None else virtual.follow(reference)
    elif len(feedforward[0]) != n or feedforward[1].shape != (n, 3):
        raise ShakeError(f"closed loop: feedforward of {len(feedforward[0])} samples for a reference of {n}")
    added = NOTHING, NO_CANCELLATION
    if loop.cancellation is not None:
        if len(feedforward[0]):
            raise ShakeError("closed loop: harmonics are not cancelled under a virtual table")
        cancellation = loop.cancellation
        added = harmonic_cancellation.initial_state(cancellation), numbers(cancellation)
    out = np.full((n, 3), np.nan), np.full((n, 3), np.nan), np.full(n, np.nan), np.full((n, MEASURED), np.nan)
    table = Table(loop.table, dt, loop.seed)
    plant = table.initial_state(loop.start)
    observer, seen = Compiled(NO_OBSERVER, NO_MODEL), np.zeros(0)
    if loop.observer is not None:
        observer, seen = loop.observer.compiled, loop.observer.initial_state(table.measure(plant, 0).position)
    finite = run_loop(
        records(loop.table.vector())[0],
        plant,
        tuple(observer),
        seen,
        loop.controller.law,
        loop.controller.initial_state()[: loop.controller.law_size],
        reference,
        feedforward,
        added,
        (dt, loop.delay, *dead_time(loop.table, dt)),
        normal_draws(loop.seed, n),
        work(),
        out,
    )
    estimate, truth, command, measured = out
    for rows in out:
        rows[finite:] = np.nan
    return ClosedLoop(dt, reference, estimate, truth, command, measured), finite


def run_batch(
    loops: Sequence[Loop], judge: Callable[[int, ClosedLoop], Result], done: Callable[[int], None] = lambda _: None
) -> list[Result]:
    """Run many loops on all cores without the GIL; `judge(i, run)` keeps of a run what is wanted.

    `done` is called with the number of finished loops, from the calling thread.
    """
    result: list[Result] = []
    with ThreadPoolExecutor(workers()) as pool:
        for value in pool.map(lambda i: judge(i, simulate(loops[i])[0]), range(len(loops))):
            result.append(value)
            done(len(result))
    return result
