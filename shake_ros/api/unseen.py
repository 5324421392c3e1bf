"""Test data: recordings that no decision has seen, run with every model of an answer once the answer stands.

Scale of the command, clock and filter of the sensors are those that the other recordings have shown. What a recording
needs of its own (offsets of its sensors, the valve's null; slow changes of a force-driven axis) comes from itself, as
it does for validation data. Nothing of them goes back into the answer.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from shake_ros.api import fitted
from shake_ros.api.model import Model
from shake_ros.core.discovery.close_loop import LoopClosure
from shake_ros.core.discovery.declared_fit import FittedModel
from shake_ros.core.identification.axis_model import AXIS
from shake_ros.core.identification.end_stops import within_stroke
from shake_ros.core.identification.knowledge import Knowledge, own_null_shifts
from shake_ros.core.identification.late_command import earlier
from shake_ros.core.identification.nuisances import Prepared
from shake_ros.core.identification.recording_problem import RecordingProblem
from shake_ros.core.identification.recordings import Record
from shake_ros.core.identification.sensor_filter import filter_of
from shake_ros.core.identification.slow_changes import with_own


def unseen_records(
    model: Model, test: fitted.Data | None, others: Sequence[fitted.Data | None]
) -> tuple[list[Record], tuple[str, ...]]:
    """Test data as records between the end stops, and a line on each recording that meets one.

    Raises
    ------
    ShakeError : a recording cannot be run, or is among the others.
    """
    given = fitted.recordings(test)
    for role, other in zip(("estimation", "validation"), others, strict=True):
        fitted.check_apart(fitted.recordings(other), given, (role, "test"))
    records = given.records(model.declared.driven_by)
    return within_stroke(records, model.stroke) if model.stroke is not None else (records, ())


def seen_alike(
    model: Model, records: Sequence[Record], data: Prepared, found: LoopClosure
) -> tuple[list[Record], Prepared]:
    """Test records as the models see recordings; and the other recordings with what was taken out of these as well."""
    declared = model.declared
    if declared is AXIS:
        return with_own(data.estimation, records)[1], data
    if not declared.nuisances:
        return list(records), data
    seen, offsets = data.alike(records)
    seen = [filter_of(data.estimation[0]).seen(earlier(r, data.ahead) if data.ahead else r) for r in seen]
    shifts = own_null_shifts(declared, found.final.fit, (), seen)
    offsets = tuple(replace(n, null_shift=n.null_shift + shifts.get(n.recording, 0.0)) for n in offsets)
    return [Knowledge(shifts=shifts).seen(r) for r in seen], replace(data, nuisances=(*data.nuisances, *offsets))


def with_test(found: LoopClosure, records: Sequence[Record]) -> LoopClosure:
    """The answer with the errors of all of its models on test data."""
    problem = RecordingProblem(list(records), found.model)

    def tested(model: FittedModel) -> FittedModel:
        return replace(model, test=problem.errors(model.fit.vector))

    return replace(found, baseline=tested(found.baseline), models=tuple(map(tested, found.models)))
