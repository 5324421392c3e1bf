"""A table as a fit would give it that began and ended there: for tests of what a fitted table tells."""

from __future__ import annotations

import numpy as np

from shake_ros.fit.free_parameters import FreeParameter, FreeParameters
from shake_ros.fit.least_squares import Fit
from shake_ros.fit.recording_problem import RecordingProblem
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.search.problem import linearised

FREE = FreeParameter("valve.flow_coefficient", 1e-9, 0.0, 1e-6, "m^4/(s*N^0.5)")


def as_fitted(table: TableParameters, problem: RecordingProblem) -> Fit:
    """The table with its flow coefficient free, and what it leaves of a problem."""
    free = FreeParameters(table, [FREE])
    return linearised(problem, Fit(free, free.start(), np.zeros(1), np.zeros((1, 1)), 0.0, 0))
