"""What every observer has: a number of its own, its parameters, what is computed from them once, and its start."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from shake_ros.core.plant.parameters import TableParameters
from shake_ros.core.quantities import Parameters

SENSORS = ("acceleration", "pressure_a", "pressure_b")  # beside the position, in the order of `measured`


@dataclass(frozen=True)
class ObserverParameters(Parameters):
    """Base of the observers' parameters."""

    code: ClassVar[int]  # number by which compiled code knows the observer, above zero
    sensors: ClassVar[tuple[str, ...]] = ()  # of `SENSORS`: what it takes beside the position where it is there
    carries_table: ClassVar[bool] = False  # whether it needs the table that `model` names
    derived: ClassVar[tuple[str, ...]] = ()  # names of what `derive` gives

    def derive(self, sample_time: float, model: TableParameters | None) -> dict[str, float]:
        """What the compiled step reads beside the parameters, by name."""
        return {}

    def started(
        self, estimate: NDArray[np.float64], command: float, sample_time: float, model: TableParameters | None
    ) -> NDArray[np.float64]:
        """The state that continues from an estimate (3,) under the command that stands."""
        return np.array(estimate, dtype=np.float64)

    def not_believed(self, state: NDArray[np.float64]) -> tuple[str, ...]:
        """Names of sensors that are there and not taken, since they are far off what is expected or frozen."""
        return ()
