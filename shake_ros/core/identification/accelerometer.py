"""What a fitted model tells of the accelerometer: the filter behind it, and its noise.

Before a fit the noise comes from the highest frequencies of a recording (noise.py), where friction at rest and rattling
joints still move a table that is sampled slowly: up to four times the truth. What a model predicts of such jumps is no
noise, so the highest frequencies of what it leaves are a better measure, and still never too small a one.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from shake_ros.core.identification.fit import Fit
from shake_ros.core.identification.noise import white_deviation
from shake_ros.core.identification.recording_problem import RecordingProblem
from shake_ros.core.identification.recordings import Record
from shake_ros.core.identification.sensor_filter import SensorFilter, better_filter

CALMER = 0.95  # of the noise that is assumed, from which a smaller one counts


@dataclass(frozen=True)
class Accelerometer:
    """What is known of it from a model.

    behind : delay and filter, as of sensor_filter.py; None: as at the start.
    noise : largest standard deviation by recording [m/s²], where a model shows it to be smaller than at the start.
    """

    behind: SensorFilter | None = None
    noise: Mapping[str, float] = field(default_factory=dict)

    def seen(self, record: Record) -> Record:
        """A recording as it is seen with this knowledge."""
        known = record if self.behind is None else self.behind.seen(record)
        return replace(known, calmest=self.noise[record.name]) if record.name in self.noise else known

    def problem(self, problem: RecordingProblem) -> RecordingProblem:
        """A problem with its recordings as they are seen."""
        seen = RecordingProblem([self.seen(r) for r in problem.records], problem.model)
        return seen.unpredicted(problem.unpredictable)

    def learned(self, problem: RecordingProblem, others: Sequence[Record], model: Fit) -> Accelerometer:
        """More of it from a fitted table, or the same where that tells nothing new.

        Parameters
        ----------
        problem : recordings of the fit, as they are seen. others : recordings whose noise counts as well.
        model : the fit of the table to them.
        """
        behind = better_filter(problem, model)
        known = self if behind is None else replace(self, behind=behind)
        noise = dict(known.noise)
        for name, records in by_name([known.seen(r) for r in (*problem.records, *others)]).items():
            found = residual_noise(RecordingProblem(records, problem.model), model.vector)
            if found < CALMER * records[0].acceleration_noise():
                noise[name] = found
        return known if noise == known.noise else replace(known, noise=noise)


def by_name(records: Sequence[Record]) -> dict[str, list[Record]]:
    """Recordings with an acceleration, each with all of its pieces."""
    found: dict[str, list[Record]] = {}
    for record in records:
        if record.acceleration is not None:
            found.setdefault(record.name, []).append(record)
    return found


def residual_noise(problem: RecordingProblem, vector: np.ndarray) -> float:
    """White part of what a table leaves of the acceleration of one recording's pieces [m/s²]; inf of a lost run."""
    parts = []
    for record in problem.records:
        parts.append(white_deviation(record.acceleration_left(problem.simulate(vector[None, :], record)[1][0])))
    found = math.sqrt(float(np.mean(np.square(parts))))
    return found if math.isfinite(found) else math.inf
