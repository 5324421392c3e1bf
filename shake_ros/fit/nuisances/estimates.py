"""Nuisance parameters of recordings from a fitted model: the accelerometer's filter and noise, the valve's null shifts.

Before a fit the noise comes from the highest frequencies of a recording (signals/noise.py), where friction at rest and
rattling joints still move a table that is sampled slowly: up to four times the truth. What a model predicts of such
jumps is no noise, so the highest frequencies of what it leaves are a better measure, and still never too small a one.

The null shift of a recording is free in every fit to it. That at which the free run has its mean velocity leaves it
open by what may be many times the noise, where friction holds a table between slow motions. A validation recording has
the one that leaves least. A flow gain that differs by direction moves them as well, by as much as the command is large,
so those of a model without it are no others' (`RecordingProblem.centred`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from shake_ros.fit.declared_model import DeclaredModel
from shake_ros.fit.identified import velocity_gain
from shake_ros.fit.least_squares import Fit
from shake_ros.fit.nuisances.sensor_filter import SensorFilter, better_filter
from shake_ros.fit.recording_problem import RecordingProblem
from shake_ros.fit.records import Record
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.signals.noise import white_deviation
from shake_ros.signals.velocity_filter import filtered_velocity

CALMER = 0.95  # of the noise that is assumed, from which a smaller one counts
LEAST_CHANGE, WIDEST = 3e-4, 0.05  # of the largest command: change of a null shift that counts, and the largest at once


@dataclass(frozen=True)
class NuisanceEstimates:
    """Nuisance parameters of recordings, estimated with a model.

    behind : delay and filter of the accelerometer, as of sensor_filter.py; None: as at the start.
    noise : largest standard deviation by recording [m/s²], where a model shows it to be smaller than at the start.
    shifts : null shift of the valve by recording [-], beside that which was taken out before the first model.
    """

    behind: SensorFilter | None = None
    noise: Mapping[str, float] = field(default_factory=dict)
    shifts: Mapping[str, float] = field(default_factory=dict)

    def applied(self, record: Record) -> Record:
        """The recording with these estimates applied."""
        known = record if self.behind is None else self.behind.applied(record)
        if record.name in self.noise:
            known = replace(known, calmest=self.noise[record.name])
        shift = self.shifts.get(record.name, record.shift)
        if shift == record.shift:
            return known
        more = shift - record.shift
        return replace(known, commands=known.commands + more, command_before=known.command_before + more, shift=shift)

    def problem(self, problem: RecordingProblem) -> RecordingProblem:
        """A problem with these estimates applied to its recordings."""
        corrected = RecordingProblem([self.applied(r) for r in problem.records], problem.model)
        return corrected.unpredicted(problem.unpredictable)

    def updated(self, problem: RecordingProblem, others: Sequence[Record], model: Fit) -> NuisanceEstimates:
        """These estimates updated with a fitted table, or the same where that changes nothing.

        Parameters
        ----------
        problem : recordings of the fit, with these estimates applied. others : validation data.
        model : the fit of the table to them.
        """
        behind = better_filter(problem, model)
        known = self if behind is None else replace(self, behind=behind)
        noise = dict(known.noise)
        for name, records in by_name([known.applied(r) for r in (*problem.records, *others)]).items():
            if records[0].explained is not None:
                continue
            found = residual_noise(RecordingProblem(records, problem.model), model.vector)
            if found < CALMER * records[0].acceleration_noise():
                noise[name] = found
        shifts = estimated_null_shifts(problem.model, model, problem.records, others)
        if shifts:
            known = replace(known, shifts={**known.shifts, **shifts})
        return known if noise == known.noise else replace(known, noise=noise)


def null_shifts(model: DeclaredModel, table: TableParameters, records: Sequence[Record]) -> dict[str, float]:
    """Null shift by recording at which the free run of a table has the measured mean velocity [-].

    Only of a model whose recordings have null shifts of their own, and where it is clearly another than the present.
    """
    found: dict[str, float] = {}
    if not model.nuisances:
        return found
    gain = velocity_gain(table)
    for name in dict.fromkeys(r.name for r in records):
        parts = [r for r in records if r.name == name]
        left = float(np.mean(np.concatenate([_velocity_left(model, table, r) for r in parts])))
        largest = max(float(np.max(np.abs(r.commands))) for r in parts)
        more = float(np.clip(left / gain, -WIDEST * largest, WIDEST * largest)) if math.isfinite(left) else 0.0
        if abs(more) > LEAST_CHANGE * largest:
            found[name] = parts[0].shift + more
    return found


def estimated_null_shifts(
    model: DeclaredModel, found: Fit, estimation: Sequence[Record], validation: Sequence[Record]
) -> dict[str, float]:
    """Null shift by recording, where it is clearly another than the present [-].

    That which the fit has found; where it has none, as for a validation recording, that which leaves least, from the
    present one or from that of the mean velocity.
    """
    shifts: dict[str, float] = {}
    width = len(model.layout.names)
    if not model.nuisances:
        return shifts
    for records in filter(None, (estimation, validation)):
        present = RecordingProblem(list(records), model)
        left_open = [r for r in records if r.run >= len(found.vector) - width]
        moved = (
            NuisanceEstimates(shifts=null_shifts(model, found.table, left_open)).problem(present)
            if left_open
            else present
        )
        least: dict[int, float] = {}
        for problem in (present,) if moved is present else (present, moved):
            row = problem.centred(found.vector)
            left = problem.left_by_run(row)
            for before, record in zip(records, problem.records, strict=True):
                shift = record.shift + float(row[width + record.run]) if len(row) > width else record.shift
                change = abs(shift - before.shift)
                if left[record.run] <= least.setdefault(record.run, left[record.run]):
                    least[record.run] = left[record.run]
                    shifts.pop(record.name, None)
                    if change > LEAST_CHANGE * float(np.max(np.abs(record.commands))):
                        shifts[record.name] = shift
    return shifts


def without_null_shifts(found: Fit, before: Sequence[Record], after: Sequence[Record]) -> Fit:
    """A fit less the null shifts that its recordings have by now in their commands."""
    x, width = found.x.copy(), len(found.free.base.fields)
    more = {new.run: new.shift - old.shift for old, new in zip(before, after, strict=True)}
    for i, column in enumerate(found.free.columns):
        if column >= width:
            x[i] -= more.get(column - width, 0.0) / found.free.scale[i]
    return replace(found, x=x)


def _velocity_left(model: DeclaredModel, table: TableParameters, record: Record) -> np.ndarray:
    """Measured less simulated velocity [m/s]."""
    simulated = filtered_velocity(model.run(table, record)[:, 1], record.sample_time)
    return np.asarray((record.velocity - simulated)[record.start :])


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
