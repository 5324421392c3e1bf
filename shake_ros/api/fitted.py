"""What results of `identify` and `close_loop` share: data, effects, errors, parameters, test data, missing force.

Test data are recordings that no decision has seen, run with every model of an answer once the answer stands.

Scale of the command, clock and filter of the sensors are those of the other recordings. The nuisance parameters of a
recording (offsets of its sensors, the valve's null; slow changes of a force-driven axis) are estimated from the
recording itself, as for validation data. They do not influence the answer.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

from shake_ros.api.model import Model
from shake_ros.api.read import Data, Recordings, recordings
from shake_ros.explain.latent_force import LatentForce
from shake_ros.fit.axis_model import AXIS, forecast_errors, with_slow_changes
from shake_ros.fit.identified import identified
from shake_ros.fit.nuisances.estimates import NuisanceEstimates, estimated_null_shifts
from shake_ros.fit.nuisances.prepared import Prepared
from shake_ros.fit.nuisances.sensor_filter import filter_of
from shake_ros.fit.recording_problem import RecordingProblem
from shake_ros.fit.records import Record
from shake_ros.fit.start.linear_table import earlier
from shake_ros.fit.uncertainty import Estimate
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.quantities import ShakeError, unknown_name
from shake_ros.repair.close_loop import LoopClosure
from shake_ros.report.page import Result
from shake_ros.report.report_json import FoundEffect
from shake_ros.report.result_table import ResultTable
from shake_ros.report.text import force_table, nuisance_table, parameter_table, slow_change_table
from shake_ros.search.declared_fit import FittedModel


class Effects(Sequence[FoundEffect]):
    """Effects in the order in which they were added.

    none : what is printed where there are none.
    """

    def __init__(self, effects: Sequence[FoundEffect], none: str = "nothing is missing") -> None:
        self._effects, self._none = tuple(effects), none

    def __len__(self) -> int:
        return len(self._effects)

    def __getitem__(self, key: Any) -> Any:
        return self._effects[key]

    @property
    def names(self) -> tuple[str, ...]:
        """The effects' names."""
        return tuple(effect.name for effect in self)

    @property
    def frame(self) -> ResultTable:
        """A row for each parameter."""
        rows = []
        for e in self:
            others = ", ".join(e.alternatives) or None
            for p in e.parameters:
                name = p.name.rpartition(".")[2]
                rows.append((e.name, e.place, name, p.value, p.std_error, p.unit, e.state, e.worth, others))
        heads = ("effect", "place", "parameter", "value", "std. error", "unit", "state", "worth")
        return ResultTable((*heads, "not distinguished from"), rows)

    def __repr__(self) -> str:
        return repr(self.frame) if self else self._none

    def _repr_html_(self) -> str:
        return self.frame._repr_html_() if self else self._none


class LatentForces(Sequence[LatentForce]):
    """Histories of the force that the final model lacks: validation data first; by number or by recording."""

    def __init__(self, forces: Sequence[LatentForce]) -> None:
        self._forces = tuple(forces)

    def __len__(self) -> int:
        return len(self._forces)

    def __getitem__(self, key: Any) -> Any:
        if isinstance(key, str):
            return {force.recording: force for force in self._forces}[key]
        return self._forces[key]

    @property
    def zero(self) -> bool:
        """Whether every force stays within its confidence band."""
        return all(force.kinds.zero for force in self)

    @property
    def frame(self) -> ResultTable:
        """A row for each recording."""
        return force_table(self._forces)

    def __repr__(self) -> str:
        return repr(self.frame)

    def _repr_html_(self) -> str:
        return self.frame._repr_html_()


class FittedResult(Result):
    """What both results share about the fitted model."""

    model: Model  # as declared
    # estimation, validation: the gapless segments of the recordings
    estimation: Sequence[Record]
    validation: Sequence[Record]
    data: Prepared  # these as they were fitted, with what was removed from them

    @property
    def records(self) -> list[Record]:
        """The parts of all recordings."""
        return [*self.estimation, *self.validation]

    @property
    @abstractmethod
    def final(self) -> FittedModel:
        """The fitted model."""

    @property
    def compared(self) -> tuple[TableParameters, ...]:
        """The tables whose free runs are compared, the fitted one last."""
        return (self.table,)

    @property
    def table(self) -> TableParameters:
        """The fitted table, with effects where such were found."""
        return self.final.table

    @property
    def parameters(self) -> ResultTable:
        """Fitted parameters with their standard errors."""
        return parameter_table(self.final.parameters)

    @cached_property
    def identified_estimates(self) -> tuple[Estimate, ...]:
        """What the recordings determine whatever area and pressure are; empty for a declared table."""
        if not self.model.declared.nuisances:
            return ()
        problem = RecordingProblem(list(self.estimation), self.model.declared)
        return identified(self.final.fit, problem.blocks())

    @property
    def identified(self) -> ResultTable:
        """The same as a table."""
        return parameter_table(self.identified_estimates)

    @property
    def nuisances(self) -> ResultTable:
        """Offsets that were removed from each recording; empty for a declared table."""
        return nuisance_table(self.data)

    @property
    def forecast_error(self) -> dict[str, float]:
        """Position error of the free run from the force alone, without the recordings' nuisance parameters [m rms].

        Empty but for the model axis.
        """
        return forecast_errors(self.table, self.records) if self.model.kind == "axis" else {}

    @property
    def slow_changes(self) -> ResultTable:
        """Nuisance parameters of each recording of a force-driven axis; empty for other models."""
        return slow_change_table(self.compared, self.records if self.model.kind == "axis" else ())


def fit_data(estimation: Data, validation: Data | None, driven_by: str) -> tuple[list[Record], list[Record]]:
    """Records of both sets as a fit takes them; a recording in both is an error."""
    first, second = recordings(estimation), recordings(validation)
    if not first:
        raise ShakeError("no recording to estimate from")
    check_apart(first, second)
    return first.records(driven_by), second.records(driven_by)


def check_apart(first: Recordings, second: Recordings, roles: tuple[str, str] = ("estimation", "validation")) -> None:
    """ShakeError for a recording in both sets."""
    both = sorted({*first.names} & {*second.names})
    if both:
        raise ShakeError(f"{', '.join(both)}: given both as {roles[0]} and as {roles[1]} data")


def names_of(records: Sequence[Record]) -> list[str]:
    """The recordings' names, each once."""
    return list(dict.fromkeys(r.name for r in records))


def chosen_record(records: Sequence[Record], name: str | None) -> Record:
    """The first record, or the first of a recording."""
    if name is None:
        return records[0]
    if name not in names_of(records):
        raise unknown_name("recording", name, names_of(records))
    return next(r for r in records if r.name == name)


def command_comment(data: Prepared) -> str:
    """What a valve command of 1 is in the recordings; empty where it is per unit there."""
    return "" if data.full_scale == 1.0 else f" A valve command of 1 is {data.full_scale:g} of the recorded unit."


def test_records(
    model: Model, test: Data | None, others: Sequence[Data | None]
) -> tuple[list[Record], tuple[str, ...]]:
    """Test data as records between the end stops, and a line on each recording that meets one.

    Raises
    ------
    ShakeError : a recording cannot be run, or is among the others.
    """
    given = recordings(test)
    for role, other in zip(("estimation", "validation"), others, strict=True):
        check_apart(recordings(other), given, (role, "test"))
    records = given.records(model.declared.driven_by)
    return model.usable(records)


def prepared_alike(
    model: Model, records: Sequence[Record], data: Prepared, found: LoopClosure
) -> tuple[list[Record], Prepared]:
    """Test records as the models see recordings; and the other recordings with what was taken out of these as well."""
    declared = model.declared
    if declared is AXIS:
        return with_slow_changes(data.estimation, records)[1], data
    if not declared.nuisances:
        return list(records), data
    alike, offsets = data.alike(records)
    alike = [filter_of(data.estimation[0]).applied(earlier(r, data.ahead) if data.ahead else r) for r in alike]
    shifts = estimated_null_shifts(declared, found.final.fit, (), alike)
    offsets = tuple(replace(n, null_shift=n.null_shift + shifts.get(n.recording, 0.0)) for n in offsets)
    return [NuisanceEstimates(shifts=shifts).applied(r) for r in alike], replace(
        data, nuisances=(*data.nuisances, *offsets)
    )


def with_test(found: LoopClosure, records: Sequence[Record]) -> LoopClosure:
    """The answer with the errors of all of its models on test data."""
    problem = RecordingProblem(list(records), found.model)

    def tested(model: FittedModel) -> FittedModel:
        return replace(model, test=problem.errors(model.fit.vector))

    return replace(found, baseline=tested(found.baseline), models=tuple(map(tested, found.models)))
