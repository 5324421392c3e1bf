"""What every observer has: a number of its own, its parameters, what is computed from them once, and its start."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from shake_ros.core.plant.parameters import TableParameters
from shake_ros.core.quantities import Parameters


@dataclass(frozen=True)
class ObserverParameters(Parameters):
    """Base of the observers' parameters."""

    code: ClassVar[int]  # number by which compiled code knows the observer, above zero
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
