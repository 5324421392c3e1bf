"""The closed loop stepped through the objects of the nodes: what `control.simulation` and the graph must equal."""

from __future__ import annotations

import numpy as np

from shake_ros.control.closed_loop import ClosedLoop
from shake_ros.control.laws.runner import Controller
from shake_ros.control.observer.runner import Observer
from shake_ros.control.reference.program import Program
from shake_ros.physics.plant.table import Table
from shake_ros.quantities import ShakeError


def simulate_closed_loop(
    table: Table,
    observer: Observer | None,
    controller: Controller,
    program: Program,
    samples: int,
    *,
    delay: int = 0,
    start: float = 0.0,
) -> ClosedLoop:
    """Run the loop: measurement k, estimate k from it and command k − 1, command k from estimate k and reference k.

    The plant then advances under command k.

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
