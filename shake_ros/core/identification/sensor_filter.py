"""The filter behind the accelerometer: how late the acceleration is, and how much of that is a low-pass.

The delay that position and acceleration show (sensor_pair.py) is a first one, since a slow sensor is much like a late
one; and a delay alone does not tell the filter, which also rounds what friction makes of the acceleration at each
reversal. Both are told by what the free run of a fitted table leaves, once that is near the noise: the delay, and how
much of it is that of a Butterworth filter of second order, √2/ω_c. What the table's own parameters could take up to
first order tells neither (variable projection).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from scipy.optimize import minimize_scalar

from shake_ros.core.identification.fit import Fit
from shake_ros.core.identification.recording_problem import RecordingProblem
from shake_ros.core.identification.recordings import Record
from shake_ros.core.identification.sensor_pair import FILTER_DELAY, timely

SHARES = (0.0, 0.25, 0.5, 0.75, 1.0)  # of the delay that may be a filter's
SHORTEST_DELAY = 0.1  # samples, from which a filter is sought
FAR = 5.0  # ratio of the residual to the noise from which no filter is chosen
LESS = 0.98  # of the mean square that another filter has to leave
WIDTH = 0.5  # of the delay, by which it may be another
SAME = 1e-9  # [s]
SWEEPS = 2  # over delay and share


@dataclass(frozen=True)
class SensorFilter:
    """Delay of the accelerometer [s], and how much of it is that of a Butterworth filter of second order."""

    delay: float
    share: float

    @property
    def pure(self) -> float:
        """The delay that is no filter's [s]."""
        return (1.0 - self.share) * self.delay

    @property
    def cutoff(self) -> float:
        """Of the filter [Hz]; 0 where there is none."""
        by_filter = self.share * self.delay
        return FILTER_DELAY / by_filter if by_filter > 0.0 else 0.0

    def seen(self, record: Record) -> Record:
        """The recording with the pure delay taken out; the filter's stays, for the simulation to have it as well."""
        present = filter_of(record)
        if np.allclose((self.delay, self.pure), (present.delay, present.pure), rtol=0.0, atol=SAME):
            return record
        return replace(timely(record, self.pure - present.pure), delay=self.delay, cutoff=self.cutoff)


def filter_of(record: Record) -> SensorFilter:
    """With what filter a recording is seen."""
    by_filter = FILTER_DELAY / record.cutoff if record.cutoff else 0.0
    return SensorFilter(record.delay, by_filter / record.delay if record.delay else 0.0)


def is_late(record: Record) -> bool:
    """Whether the acceleration is so late that a filter may be what delays it."""
    return record.delay > SHORTEST_DELAY * record.sample_time


def behind_filter(records: Sequence[Record]) -> SensorFilter | None:
    """All of the delay that recordings show as a filter's, which most accelerometers have; None where none is late."""
    return next((SensorFilter(r.delay, 1.0) for r in records if is_late(r)), None)


def better_filter(problem: RecordingProblem, found: Fit) -> SensorFilter | None:
    """A filter with which a fitted table leaves less than with the present one; None where none does.

    None as well where all leave much above the noise: then the effects that are missing would choose.
    """
    late = [r for r in problem.records if is_late(r)]
    if not late:
        return None
    explained = np.linalg.qr(found.jacobian)[0]

    @cache
    def left(tried: SensorFilter) -> float:
        seen = RecordingProblem([tried.seen(r) for r in problem.records], problem.model)
        r = seen.residuals(found.vector[None, :])[0]
        return float(np.mean((r - explained @ (explained.T @ r)) ** 2))

    first = best = filter_of(late[0])
    before = least = left(first)
    for _ in range(SWEEPS):
        share, span = best.share, ((1.0 - WIDTH) * first.delay, (1.0 + WIDTH) * first.delay)
        scan = minimize_scalar(
            lambda delay, share=share: left(SensorFilter(float(delay), share)), bounds=span, options={"maxiter": 10}
        )
        tried = [SensorFilter(float(scan.x), share), *(SensorFilter(best.delay, s) for s in SHARES if s != share)]
        costs = [float(scan.fun), *(left(t) for t in tried[1:])]
        if min(costs) >= least:
            break
        least = min(costs)
        best = tried[costs.index(least)]
    return best if least < min(LESS * before, FAR**2 * problem.noise_cost()) else None
