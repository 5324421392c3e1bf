"""The filter behind the accelerometer: how late the acceleration is, and how much of that is a low-pass.

The delay that position and acceleration show (sensor_pair.py) is a first one, since a slow sensor is much like a late
one; and a delay alone does not tell the filter, which also rounds what friction makes of the acceleration at each
reversal. Both are told by what the free run of a fitted table leaves, once that is near the noise: the delay, and how
much of it is that of a Butterworth filter of second order, √2/ω_c. What the table's own parameters could take up to
first order tells neither (variable projection).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from scipy.optimize import minimize_scalar

from shake_ros.fit.least_squares import Adjustment, Fit
from shake_ros.fit.nuisances.sensor_pair import SHARES, SensorPair, timely
from shake_ros.fit.recording_problem import RecordingProblem
from shake_ros.fit.records import Record
from shake_ros.physics.plant.sensors import FILTER_DELAY

CUTOFFS = (0.4, 0.2, 0.1, 0.05)  # of a filter where no delay shows, in parts of the sampling rate
SHORTEST_DELAY = 0.1  # samples, from which a filter is sought whose delay shows
HIGH_RATIO = 5.0  # ratio of the residual to the noise from which no filter is chosen
LESS = 0.98  # of the mean square that another filter has to leave
WIDTH = 0.5  # of the delay, by which it may be another
SAME = 1e-9  # [s]
SWEEPS = 2  # over delay and filter


@dataclass(frozen=True)
class SensorFilter:
    """Delay of the accelerometer [s], and that of a Butterworth filter of second order which is part of it [s].

    The filter's may be more than all: clocks that were set by the signals (second_file.py) make up for it.
    """

    delay: float
    by_filter: float

    @property
    def pure(self) -> float:
        """The delay that is no filter's [s]."""
        return self.delay - self.by_filter

    @property
    def cutoff(self) -> float:
        """Of the filter [Hz]; 0 where there is none."""
        return FILTER_DELAY / self.by_filter if self.by_filter > 0.0 else 0.0

    def later(self, time: float) -> SensorFilter:
        """One whose delay is longer by a time [s], with as large a part of it in the filter."""
        part = self.by_filter / self.delay if self.delay else 0.0
        return SensorFilter(self.delay + time, max(self.by_filter + part * time, 0.0))

    def reformed(self, by_filter: float) -> SensorFilter:
        """One with another filter, which delays by a time [s], and the same pure delay."""
        return SensorFilter(self.pure + by_filter, by_filter)

    def applied(self, record: Record) -> Record:
        """The recording with the pure delay taken out; the filter's stays, for the simulation to have it as well."""
        present = filter_of(record)
        if np.allclose((self.delay, self.pure), (present.delay, present.pure), rtol=0.0, atol=SAME):
            return record
        return replace(timely(record, self.pure - present.pure), delay=self.delay, cutoff=self.cutoff)


def filter_of(record: Record) -> SensorFilter:
    """With what filter a recording is seen."""
    return SensorFilter(record.delay, FILTER_DELAY / record.cutoff if record.cutoff else 0.0)


def is_late(record: Record) -> bool:
    """Whether the acceleration is so late that a filter may be what delays it."""
    return record.delay > SHORTEST_DELAY * record.sample_time


def behind_filter(records: Sequence[Record], sensors: SensorPair) -> SensorFilter | None:
    """The filter that the sensors show in the delay of recordings; None where none is late."""
    return next((SensorFilter(r.delay, sensors.filter_share * r.delay) for r in records if is_late(r)), None)


def better_filter(problem: RecordingProblem, found: Fit) -> SensorFilter | None:
    """A filter with which a fitted table leaves less than with the present one; None where none does.

    None as well where all leave much above the noise: then the effects that are missing would choose. Where no delay
    shows, one is sought only if clock and offsets of the recordings are their own.
    """
    if problem.records[0].explained is not None:
        return None  # it shows above what the command explains
    late = [r for r in problem.records if is_late(r)]
    accelerations = [r for r in problem.records if r.acceleration is not None]
    if not late and not (accelerations and problem.model.nuisances):
        return None
    adjustment = Adjustment(found.jacobian)

    @cache
    def left(tried: SensorFilter) -> float:
        corrected = RecordingProblem([tried.applied(r) for r in problem.records], problem.model)
        r = corrected.residuals(found.vector[None, :])[0]
        return float(np.mean(adjustment.left(r) ** 2))

    first = best = filter_of((late or accelerations)[0])
    before = least = left(first)
    for _ in range(SWEEPS):
        near = _late(best, first.delay, left) if late else _timely(best, accelerations[0].sample_time, left)
        nearest = min(near, key=left)
        if left(nearest) >= least:
            break
        best, least = nearest, left(nearest)
    return best if least < min(LESS * before, HIGH_RATIO**2 * problem.noise_cost()) else None


Left = Callable[[SensorFilter], float]


def _late(best: SensorFilter, first: float, left: Left) -> Iterator[SensorFilter]:
    """The best delay near the first one [s], and other parts of the present one."""
    share = best.by_filter / best.delay
    yield _scanned(lambda delay: SensorFilter(delay, share * delay), first, left)
    yield from (SensorFilter(best.delay, s * best.delay) for s in SHARES)


def _timely(best: SensorFilter, sample_time: float, left: Left) -> Iterator[SensorFilter]:
    """Usual filters, and the best one near the present one."""
    yield from (SensorFilter(best.delay, FILTER_DELAY * sample_time / c) for c in CUTOFFS)
    if best.by_filter:
        yield _scanned(lambda by_filter: SensorFilter(best.delay, by_filter), best.by_filter, left)


def _scanned(of_size: Callable[[float], SensorFilter], about: float, left: Left) -> SensorFilter:
    """The filter that leaves least of those whose size is near a time [s]."""
    scan = minimize_scalar(
        lambda size: left(of_size(float(size))),
        bounds=((1.0 - WIDTH) * about, (1.0 + WIDTH) * about),
        options={"maxiter": 10},
    )
    return of_size(float(scan.x))
