"""What the watch of the chambers' pressures finds in a whole run."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from shake_ros.physics.plant.cylinder import PressureWatch
from shake_ros.physics.plant.parameters import TableParameters


def findings_of_run(table: TableParameters, result: NDArray[np.float64], sample_time: float) -> tuple[str, ...]:
    """Its sentences on the result of a run, shape (n, 7)."""
    watch = PressureWatch(table, sample_time)
    for row in result:
        watch.observe(row[0], row[1], row[3], row[4])
    return watch.findings()
