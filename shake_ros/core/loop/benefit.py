"""What a better model is worth: the identified table in closed loop, controlled by one model of it and by another."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shake_ros.core.control.closed_loop import ClosedLoop
from shake_ros.core.control.runner import Controller
from shake_ros.core.loop.compiled import Loop, simulate
from shake_ros.core.observer.runner import Observer
from shake_ros.core.plant.parameters import TableParameters
from shake_ros.core.quantities import ShakeError

Loops = Callable[[TableParameters], tuple[Observer, Controller]]


@dataclass(frozen=True)
class TrackingBenefit:
    """Runs on one table under the model before and the model after. reference : what they follow, by name."""

    reference: str
    before: ClosedLoop
    after: ClosedLoop

    def errors(self) -> dict[str, dict[str, float]]:
        """Relative tracking error of position, velocity and acceleration under each model."""
        names = ("position", "velocity", "acceleration")
        return {
            when: dict(zip(names, (float(e) for e in run.tracking_error()), strict=True))
            for when, run in (("before", self.before), ("after", self.after))
        }


def benefit(
    table: TableParameters,
    before: TableParameters,
    after: TableParameters,
    loops: Loops,
    reference: NDArray[np.float64],
    name: str,
    *,
    delay: int,
) -> TrackingBenefit:
    """Run the same loop twice on one table, with one model in observer and controller and with the other.

    Parameters
    ----------
    table : the plant. before, after : models. loops : observer and controller that carry a model.
    reference : (n, 3) position [m], velocity [m/s], acceleration [m/s²]. name : of the reference.
    delay : samples by which a command reaches the valve late.

    Raises
    ------
    ShakeError : a loop left the finite numbers.
    """
    runs = []
    for model in (before, after):
        observer, controller = loops(model)
        run, finite = simulate(Loop(table, observer, controller, reference, delay=delay))
        if finite < len(reference):
            raise ShakeError(f"{name}: the loop was lost after {finite * controller.sample_time:g} s")
        runs.append(run)
    return TrackingBenefit(name, *runs)
