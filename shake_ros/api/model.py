"""`model`: a declared model of a table: its numbers, what a fit may move, what it may lack, its free run."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from shake_ros.api.read import Recordings
from shake_ros.declared import MODELS, declared_table, effect_candidates, free_parameters, leaves_open, unknown_model
from shake_ros.fit.axis_model import AXIS, with_slow_changes
from shake_ros.fit.declared_model import DeclaredModel
from shake_ros.fit.free_parameters import FreeParameter
from shake_ros.fit.nuisances.prepared import Prepared, prepared
from shake_ros.fit.records import Record
from shake_ros.fit.start.data_checks import contradictions, unmeasured_positions, usable_pressures, within_stroke
from shake_ros.fit.start.linear_table import in_time
from shake_ros.fit.start.stages import StartingPoint, staged_start
from shake_ros.fit.start.unknown_model import NAME as UNKNOWN
from shake_ros.fit.start.unknown_model import UnknownModel
from shake_ros.physics.plant.parameters import FULL_LAYOUT, TableParameters
from shake_ros.quantities import ShakeError, unknown_name
from shake_ros.report.result_table import ResultTable


@dataclass(frozen=True, repr=False)
class Model:
    """A declared model.

    Attributes
    ----------
    kind : "full", "reduced", "unknown" or "axis".
    table : the declared table; None where the recordings give the first guess.
    changes : values by dotted name over those of the table.
    notes : what the given table does not declare, a line each.
    """

    kind: str
    declared: DeclaredModel
    table: TableParameters | None
    changes: Mapping[str, float]
    notes: tuple[str, ...] = ()

    @property
    def parameters(self) -> ResultTable:
        """The parameters that a fit may move: from the start, or only once they explain much of what is left."""
        table = self.table
        rows = [
            (p.name, None if table is None else table.value(p.name), p.unit, p.low, p.high, when)
            for late, when in ((False, "from the start"), (True, "late"))
            for p in free_parameters(self.declared, late)
        ]
        return ResultTable(("parameter", "value", "unit", "low", "high", "freed"), rows)

    @property
    def candidates(self) -> ResultTable:
        """The effects that the model may lack."""
        rows = [(c.effect, c.place, ", ".join(c.depends_on), c.strength.name) for c in effect_candidates(self.declared)]
        return ResultTable(("effect", "place", "depends on", "strength"), rows)

    @property
    def _declared_table(self) -> TableParameters | None:
        """The hydraulic table with the declared numbers; None where the model has none."""
        table = self.declared.table if isinstance(self.declared, UnknownModel) else self.table
        return table if table is not None and table.layout is FULL_LAYOUT else None

    @property
    def stroke(self) -> float | None:
        """Full stroke that is declared [m]; None where there is none."""
        table, name = self._declared_table, "body.stroke"
        unseen = isinstance(self.declared, UnknownModel) and name in self.declared.unknown
        return None if table is None or unseen else table.value(name)

    def start(self, records: list[Record]) -> TableParameters:
        """The table that a fit to these records starts from."""
        return self.table or self.declared.first_table(records).with_values(self.changes)

    def begin(
        self,
        estimation: list[Record],
        validation: list[Record],
        progress: Callable[[str, float], None] = lambda *_: None,
    ) -> StartingPoint:
        """Where a fit begins, with the recordings as it takes them.

        What lies at the end stops of a known stroke is left out, offsets are taken out where the model counts these as
        nuisances; of a force-driven axis each recording has its own slow changes. progress : called with what is being
        done and which part is done.
        """
        declared = self.declared
        (estimation, first), (validation, second) = map(self.usable, (estimation, validation))
        stops = first + second
        if not isinstance(declared, UnknownModel):
            both = with_slow_changes(estimation, validation) if declared is AXIS else (estimation, validation)
            return StartingPoint.declared(self.start(estimation), Prepared(*both, 1.0, (), stops=stops))

        def effects(table: TableParameters) -> dict[str, tuple[FreeParameter, ...]]:
            return {c.effect: c.free for c in effect_candidates(declared, table, estimation)}

        data = replace(in_time(prepared(estimation, validation)), stops=stops)
        return staged_start(declared, free_parameters(declared), effects, data, progress)

    def usable(self, records: list[Record]) -> tuple[list[Record], tuple[str, ...]]:
        """What of some recordings a fit can use, and a line on what it leaves out: end stops, impossible pressures.

        Of recordings without a position as well.
        """
        lines = unmeasured_positions(records)
        if self.stroke is not None:
            records, stops = within_stroke(records, self.stroke)
            lines += stops
        if not self.declared.pressures:
            return records, lines
        found, wrong = usable_pressures(records, None if self.declared.nuisances else self.table)
        return found, lines + wrong

    def contradictions(self, recordings: Recordings) -> list[str]:
        """In which quantities the declared numbers and the recordings are far apart, a line each."""
        declared = self._declared_table
        if declared is None:
            return []
        records = recordings.records()
        if not isinstance(self.declared, UnknownModel):
            return contradictions(declared, records)
        data = prepared(records, [])
        return contradictions(declared, data.estimation, self.declared.unknown, data.sensors)

    def simulate(self, record: Record) -> np.ndarray:
        """Free run of the table over a record from its command alone, shape (n, ≥ 3): position [m], velocity, …"""
        return self.declared.run(self.start([record]), record)

    def __repr__(self) -> str:
        changed = "".join(f", {name} = {value:g}" for name, value in self.changes.items())
        where = "starting from the recordings" if self.table is None else f"{len(self.declared.layout.names)} numbers"
        return f"Model({self.kind}, {where}{changed})\n{self.parameters!r}"


def model(
    kind: str = "full",
    table: str | Path | TableParameters | None = None,
    set: Mapping[str, float] | None = None,  # noqa: A002 (the command's option has this name)
) -> Model:
    """A declared model of a shaking table.

    Parameters
    ----------
    kind : "full", the sixth-order table of (6.15); "reduced", third order in acceleration per command (6.36), for
        hydraulics that are not declared; "unknown", the full physics without a data sheet; "axis", a positioning axis
        driven by a force.
    table : a name of config/table, a YAML file, or a table; the default table of `full`, otherwise the first guess
        comes from the recordings. A file that leaves numbers open makes "full" the model "unknown".
    set : declared values to change, by dotted name or its last part: `{"specimen_mass": 200.0}`.

    Raises
    ------
    ShakeError
        An unknown name, a value out of bounds, or a table of another kind.

    Examples
    --------
    >>> import shake_ros as sr
    >>> model = sr.model("full", set={"specimen_mass": 200.0})
    >>> model.table.value("body.specimen_mass")
    200.0
    >>> "bulk_modulus.modulus" in model.parameters["parameter"]
    True
    >>> "soft_zone" in model.candidates["effect"]
    True
    """
    if kind == UNKNOWN or (kind == "full" and isinstance(table, str | Path) and leaves_open(str(table))):
        return _unknown(table, set or {})
    if kind not in MODELS:
        raise unknown_name("model", kind, (*MODELS, UNKNOWN))
    declared = MODELS[kind]
    changes = declared.layout.changes(set)
    notes: tuple[str, ...] = ()
    if table is None or isinstance(table, str | Path):
        config = None if table is None else str(table)
        base = declared_table(declared, config)
        if base is None and config is not None:
            notes = (f"{config}: declares no beta1 … beta5; the reduced model starts from the recordings alone",)
    else:
        base = table
        if base.layout != declared.layout:
            raise ShakeError(f"the model {kind} does not take a table of the model {base.layout.name}")
    return Model(kind, declared, base and base.with_values(changes), changes, notes)


def declared_of(model: Model) -> DeclaredModel:
    """What a model declares; ShakeError where it is none, such as its name."""
    if not isinstance(model, Model):
        raise ShakeError(f"model: expected a Model, such as sr.model({UNKNOWN!r}), not {model!r}")
    return model.declared


def _unknown(table: str | Path | TableParameters | None, changes: Mapping[str, float]) -> Model:
    """The model of a table that leaves numbers open; a number that is set is exact."""
    if isinstance(table, TableParameters):
        raise ShakeError(f"the model {UNKNOWN} takes a file with what is known, not a table")
    declared = unknown_model(UNKNOWN if table is None else str(table))
    assert declared.table is not None
    exact = declared.layout.changes(changes)
    declared = UnknownModel(
        declared.table.with_values(exact),
        tuple(name for name in declared.unknown if name not in exact),
        {name: sd for name, sd in declared.deviations.items() if name not in exact},
    )
    return Model(UNKNOWN, declared, None, exact)
