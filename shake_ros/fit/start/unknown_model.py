"""The full table of which little is known: what recordings can tell of it is free, what they cannot is a gauge.

From command, position and acceleration no area and no pressure can be told: a cylinder twice as large on half the
pressure moves the same. One area and one pressure are fixed (config/table/unknown.yaml); all else counts relative to
them: masses, forces, flow coefficient and leakages take values of a table of that area. Numbers that a configuration
gives as exact stay, those it gives with a standard deviation enter the fit as a prior, those `unknown` start from the
recordings. Offsets of each recording are no part of the table, see nuisances.py.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar, final

import numpy as np

from shake_ros.fit.records import FULL, Compared, DeclaredModel, Record
from shake_ros.fit.start.first_guess import FirstGuess
from shake_ros.physics.plant.parameters import FULL_LAYOUT, TableParameters

NAME = "unknown"
TABLE, OFFSET = len(FULL_LAYOUT.names), FULL_LAYOUT.index["effects.valve_null_shift.offset"]


@final
@dataclass(frozen=True)
class UnknownModel(DeclaredModel):
    """The sixth-order table of (6.15) with a gauge instead of a data sheet.

    Attributes
    ----------
    table : numbers given, placeholders for those that are not. unknown : dotted names without a value.
    deviations : standard deviation of the numbers given with one, in their unit.
    """

    layout = FULL_LAYOUT
    candidates_file = "effects"
    nuisances: ClassVar[bool] = True
    injects: ClassVar[bool] = True
    smooth: ClassVar[bool] = True
    pressures: ClassVar[bool] = True

    table: TableParameters | None = None
    unknown: tuple[str, ...] = ()
    deviations: Mapping[str, float] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """Its name in MODELS and in config/identification."""
        return NAME

    @property
    def priors(self) -> tuple[tuple[int, float, float], ...]:
        """Column of the parameter vector, value and standard deviation of each number that has one."""
        if self.table is None:
            return ()
        return tuple((FULL_LAYOUT.index[n], self.table.value(n), sd) for n, sd in self.deviations.items())

    def may_move(self, name: str) -> bool:
        """Whether a fit may move a declared number: one that is unknown or has a deviation."""
        return name in self.unknown or name in self.deviations

    def may_lack(self, effect: str) -> bool:
        """Whether an effect may be missing: not one that the table has, nor one that a free number stands for."""
        stands_for = {"payload_error": "body.table_mass", "dead_volume": "body.cylinder_volume"}
        stands_for |= {"slow_valve": "valve.natural_frequency", "tank_back_pressure": "body.table_mass"}
        stands_for |= {"spool_hysteresis": "valve.hysteresis"}
        has = self.table is not None and effect in self.table.effects
        return not has and effect != "accelerometer_bias" and stands_for.get(effect) not in self.unknown

    def compared(self, vectors: np.ndarray, record: Record, injection: float = 0.0) -> Compared:
        """As the full model, for rows of parameters behind which the recordings' null shifts may follow."""
        table, own = vectors[:, :TABLE], vectors[:, TABLE:]
        if not own.shape[1]:
            return FULL.compared(table, record, injection)
        if record.run < own.shape[1]:
            table = table.copy()
            table[:, OFFSET] += own[:, record.run]
        other = np.any(table != table[0], axis=1)  # the null shift of another recording changes nothing here
        other[0] = True
        row = np.where(other, np.cumsum(other) - 1, 0)
        found = FULL.compared(table[other], record, injection)
        return Compared(*(None if each is None else each[row] for each in found))  # type: ignore[arg-type]

    def run(self, table: TableParameters, record: Record) -> np.ndarray:
        """Free run with the columns of plant.simulation.COLUMNS."""
        return FULL.run(table, record)

    def run_under(self, table: TableParameters, record: Record, forces: np.ndarray) -> np.ndarray:
        """The run under an additional force, in the gauge."""
        return FULL.run_under(table, record, forces)

    def moved_mass(self, table: TableParameters) -> float:
        """Mass in motion, in the gauge [kg]."""
        return FULL.moved_mass(table)

    def inner_quantities(self, simulated: np.ndarray) -> dict[str, np.ndarray]:
        """Those of the full model."""
        return FULL.inner_quantities(simulated)

    def first_table(self, records: list[Record]) -> TableParameters:
        """What is given, and for the rest a first guess from the recordings."""
        assert self.table is not None
        return FirstGuess(records).tables(self.table, self.unknown, self)[0]
