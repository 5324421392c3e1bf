"""The full table of which little is known: what recordings can tell of it is free, what they cannot is a gauge.

From command, position and acceleration no area and no pressure can be told: a cylinder twice as large on half the
pressure moves the same. One area and one pressure are fixed (config/table/unknown.yaml); all else counts relative to
them: masses, forces, flow coefficient and leakages take values of a table of that area. Numbers that a configuration
gives as exact stay, those it gives with a standard deviation enter the fit as a prior, those `unknown` start from the
recordings. Offsets of each recording are no part of the table, see nuisances/prepared.py.

A fit begins with a first guess from recordings alone. Velocity gain, hydraulic frequency, damping, delay and the first
mode of a flexible specimen are those of the linear table that comes nearest to the measured response (linear_table.py).
Dry friction and the acceleration at which the valve has no pressure left do not show there: of a small grid of both the
one whose free run leaves least is taken.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar, final

import numpy as np

from shake_ros.fit.declared_model import FULL, Compared, DeclaredModel
from shake_ros.fit.nuisances.sensor_pair import ALIKE, SensorPair
from shake_ros.fit.recording_problem import RecordingProblem
from shake_ros.fit.records import Record, windows
from shake_ros.fit.start.linear_table import SPECIMEN_BOUNDS, LinearTable, SpecimenMode, linear_table
from shake_ros.physics.plant.parameters import FULL_LAYOUT, TableParameters

RESERVES = (1.2, 1.7, 3.0, 10.0, 30.0)  # acceleration at full pressure, in parts of the largest measured one
FRICTIONS = (0.05, 0.3, 1.0)  # dry friction per mass [m/s²]
UNSEEN, DAMPING = (1.5, 3.0, 6.0), 0.2  # hydraulic frequencies beyond the highest line, in parts of it, damping
FREE_STROKE = 4.0  # length of both chambers in parts of the range of motion, where nothing is known
IDENTIFIED = 0.99  # part of the largest share of a specimen, up to which the response determines its share
SHARES = (0.3, 0.6)  # of the moved mass, tried where it does not
PIECES = 15.0  # of the recordings that the grid is run over [s]


class FirstGuess:
    """Linear table and range of motion of the recordings, from which tables are made in any gauge.

    mode : of a specimen that shows otherwise, where it shows none.
    """

    def __init__(
        self, records: Sequence[Record], sensors: SensorPair = ALIKE, mode: SpecimenMode | None = None
    ) -> None:
        self.records = list(records)
        linear = linear_table(records, sensors)
        self.linear = replace(linear, specimen=linear.specimen or mode)
        self.reach = max(float(np.max(np.abs(r.position))) for r in records)
        self.largest = max(float(np.percentile(np.abs(self._acceleration(r)), 99.9)) for r in records)

    def _acceleration(self, record: Record) -> np.ndarray:
        if record.acceleration is not None:
            return record.acceleration
        return np.asarray(np.gradient(record.velocity, record.sample_time))

    def tables(
        self,
        given: TableParameters,
        unknown: Sequence[str],
        model: DeclaredModel,
        shown: Callable[[TableParameters], Mapping[str, float]] = lambda _: {},
        specimen: bool = False,
    ) -> list[TableParameters]:
        """The given table with guesses of what is unknown, the best first; of several specimens the best of each.

        Parameters
        ----------
        shown : values by dotted name of the effects that each of them has on top.
        specimen : whether the specimen that the response shows is one of these.
        """
        problem = RecordingProblem(windows(self.records, PIECES), model)
        grid = itertools.product(self._columns(), RESERVES, FRICTIONS)
        made = [self._made(given, unknown, column, r, f) for column, r, f in grid]
        modes = self._modes() if specimen else [None]
        tables = [table.with_values({**shown(table), **_on(table, mode)}) for mode in modes for table in made]
        rows = problem.residuals(np.array([t.vector() for t in tables]))
        costs = np.mean(np.nan_to_num(rows, nan=1e3, posinf=1e3, neginf=-1e3) ** 2, axis=1)
        of_mode = np.argsort(costs.reshape(len(modes), -1), axis=1) + len(made) * np.arange(len(modes))[:, None]
        return [tables[i] for equals in of_mode.T for i in equals[np.argsort(costs[equals])]]

    def _modes(self) -> list[SpecimenMode | None]:
        """The specimen of the linear table, with several shares where the response does not determine it."""
        mode = self.linear.specimen
        if mode is None or mode.share < IDENTIFIED * SPECIMEN_BOUNDS[0][1]:
            return [mode]
        return [replace(mode, share=share) for share in SHARES]

    def _columns(self) -> list[LinearTable]:
        """The linear table, and others of its lag where its oil column rings beyond what the response shows."""
        table = self.linear
        if table.omega <= table.seen_to:
            return [table, replace(table, drag=0.0)]
        lag = table.delay + 2.0 * table.damping / table.omega
        unseen = [ratio * table.seen_to for ratio in UNSEEN]
        return [
            table,
            replace(table, drag=0.0),
            *(replace(table, omega=w, damping=DAMPING, delay=max(lag - 2 * DAMPING / w, 0.0)) for w in unseen),
        ]

    def _made(
        self, given: TableParameters, unknown: Sequence[str], column: LinearTable, reserve: float, friction: float
    ) -> TableParameters:
        area, drop = given.body.piston_area, given.supply.supply_pressure - given.supply.tank_pressure

        def of(name: str, guess: float) -> float:
            field = given.fields[name].metadata
            return float(np.clip(guess, field["low"], field["high"])) if name in unknown else given.value(name)

        mass = of("body.table_mass", drop * area / (reserve * self.largest)) + given.body.specimen_mass
        volume = of("body.cylinder_volume", 2.0 * FREE_STROKE * self.reach * area)
        modulus = of("bulk_modulus.modulus", column.omega**2 * volume * mass / (4.0 * area**2))
        zeta = given.value("valve.damping")
        stiff = math.sqrt(modulus * mass / volume) / area
        values = {
            "body.table_mass": mass - given.body.specimen_mass,
            "body.cylinder_volume": volume,
            "bulk_modulus.modulus": modulus,
            "valve.flow_coefficient": column.gain * area / math.sqrt(0.5 * drop),
            "leakage.internal": 0.3 * column.damping / stiff,
            "friction.coulomb_level": friction * mass,
            "friction.stribeck_rise": 0.3 * friction * mass,
            "friction.viscous": 0.5 * mass,
            "effects.command_delay.delay": 0.5 * column.delay,
            # what holds the table back as friction would is nearly always the valve
            "valve.natural_frequency": 2.0 * zeta / (column.drag + 2.0 * zeta / given.value("valve.natural_frequency")),
        }
        guessed = {name: of(name, value) for name, value in values.items() if name in unknown}
        return given.with_values(guessed)


def _on(table: TableParameters, mode: SpecimenMode | None) -> dict[str, float]:
    """A specimen by dotted name on a table; empty where there is none."""
    if mode is None:
        return {}
    values = {"mass": mode.share * table.moved_mass, "frequency": mode.frequency, "damping": mode.damping}
    return {f"effects.specimen_resonance.{key}": value for key, value in values.items()}


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
