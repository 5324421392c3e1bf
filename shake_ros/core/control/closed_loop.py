"""The closed loop in one process: plant, observer, controller and reference, sample by sample.

The same semantics as the lock-step graph: measurement k, estimate k from it and command k − 1, command k from
estimate k and reference k, then the plant advances under command k. A run equals that of the nodes, sample for sample.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from shake_ros.core.control.runner import Controller
from shake_ros.core.plant.table import Table
from shake_ros.core.quantities import ShakeError

Array = NDArray[np.float64]


class Estimator(Protocol):
    """What the loop needs of an observer (`core.observer.runner.Observer`)."""

    def initial_state(self, position: float) -> Array: ...

    def step(
        self, state: Array, measured_position: float, u_previous: float, others: Sequence[float]
    ) -> tuple[Array, Any]: ...


class Schedule(Protocol):
    """What the loop needs of a reference (`core.reference.program.Program`)."""

    def at(self, k: int) -> tuple[float, float, float]: ...


@dataclass(frozen=True)
class ClosedLoop:
    """A run; row k belongs to t_k. `reference`, `estimate`, `truth`: (n, 3) position [m], velocity, acceleration.

    `command`: (n,) [-]. `measured`: (n, 5) position [m], acceleration [m/s²], P_A, P_B, P_s [Pa].
    """

    sample_time: float
    reference: Array
    estimate: Array
    truth: Array
    command: Array
    measured: Array

    def after(self, seconds: float) -> ClosedLoop:
        """The run from an instant on [s]."""
        first = round(seconds / self.sample_time)
        rows = self.reference, self.estimate, self.truth, self.command, self.measured
        return ClosedLoop(self.sample_time, *(row[first:] for row in rows))

    def tracking_error(self, first: int = 0) -> Array:
        """(3,) rms(truth − reference)/rms(reference − mean) of position, velocity, acceleration from a sample on."""
        return normalised_error(self.reference[first:], self.truth[first:])

    def estimation_error(self, first: int = 0) -> Array:
        """(3,) rms(estimate − truth)/rms(truth − mean) of position, velocity, acceleration from a sample on."""
        return normalised_error(self.truth[first:], self.estimate[first:])


def normalised_error(wanted: Array, found: Array) -> Array:
    """Root mean square of found − wanted over that of wanted − its mean, column by column.

    >>> normalised_error(np.array([[1.0], [-1.0]]), np.array([[1.1], [-1.1]])).round(6).tolist()
    [0.1]
    """
    error: Array = np.sqrt(
        np.mean((found - wanted) ** 2, axis=0) / np.mean((wanted - wanted.mean(axis=0)) ** 2, axis=0)
    )
    return error


def simulate_closed_loop(
    table: Table,
    observer: Estimator | None,
    controller: Controller,
    program: Schedule,
    samples: int,
    *,
    delay: int = 0,
    start: float = 0.0,
) -> ClosedLoop:
    """Run the loop.

    Parameters
    ----------
    table : the plant, with its sensors.
    observer : estimates from the sensors that it takes; None hands the true states to the controller.
    controller, program : the law and what it follows.
    samples : length of the run.
    delay : samples by which a command reaches the valve late, as in a real-time loop without lock-step.
    start : initial position of the table [m].

    Raises
    ------
    ShakeError : sample times differ, or a value of the loop is not finite.
    """
    for part in (observer, program):
        other = getattr(part, "sample_time", controller.sample_time)
        if other != controller.sample_time:
            raise ShakeError(f"closed loop: sample times {other:g} and {controller.sample_time:g} s differ")
    if table.sample_time != controller.sample_time:
        raise ShakeError(f"closed loop: sample times {table.sample_time:g} and {controller.sample_time:g} s differ")
    reference, estimate, truth = np.empty((samples, 3)), np.empty((samples, 3)), np.empty((samples, 3))
    command, measured = np.zeros(samples), np.empty((samples, 5))
    plant, law, estimator = table.initial_state(start), controller.initial_state(), np.zeros(0)
    u, waiting = 0.0, [0.0] * delay
    for k in range(samples):
        m = table.measure(plant, k)
        measured[k] = m.position, m.acceleration, m.pressure_a, m.pressure_b, m.pressure_supply
        truth[k] = m.truth_position, m.truth_velocity, m.truth_acceleration
        if observer is None:
            estimate[k] = truth[k]
        else:
            if k == 0:
                estimator = observer.initial_state(m.position)
            others = m.acceleration, m.pressure_a, m.pressure_b
            estimator, estimate[k] = observer.step(estimator, m.position, u, others)
        reference[k] = program.at(k)
        law, u = controller.step(law, reference[k], estimate[k])
        command[k] = u
        waiting.append(u)
        plant = table.advance(plant, waiting.pop(0))
    return ClosedLoop(controller.sample_time, reference, estimate, truth, command, measured)
