"""Declared models: the layout of their tables, and their free runs over recordings (chapter 4, 6.3.3.2).

What the state was when the recording began shows in its first half second: a run of the full model is corrected to the
measured motion there, and free from then on. Volumes and position-dependent effects follow the measured position.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import ClassVar, NamedTuple, final

import numpy as np

from shake_ros.fit.records import Record
from shake_ros.physics.plant.parameters import FULL_LAYOUT, TableLayout, TableParameters
from shake_ros.physics.plant.simulation import COLUMNS, NOTHING, SMOOTH, initial_state, remember, run, run_batch
from shake_ros.physics.plant.states import CLOCK, SPECIMEN, SPECIMEN_RATE, VELOCITY
from shake_ros.quantities import ShakeError

SWAY, SWAY_MOST = 1e-3, 100.0  # of a specimen: that is tried [m], and at most, over the motion of its table
SWAY_STEPS, SWAY_FOUND = 6, 0.03  # in which it is found, and part of it by which the last one changes it
MOTION, CHAMBERS = (1, 2), (COLUMNS.index("pressure_a"), COLUMNS.index("pressure_b"))
SPECIMEN_MASS, SPECIMEN_FREQUENCY = (
    FULL_LAYOUT.index[f"effects.specimen_resonance.{n}"] for n in ("mass", "frequency")
)


class Compared(NamedTuple):
    """What is compared of free runs, each of shape (m, n).

    Attributes
    ----------
    velocity : unfiltered [m/s]. acceleration : [m/s²]. position : of models that compare it [m].
    pressure : in chamber A less that in B, where the recording has it [Pa].
    """

    velocity: np.ndarray
    acceleration: np.ndarray
    position: np.ndarray | None = None
    pressure: np.ndarray | None = None


class DeclaredModel(ABC):
    """A declared model: the layout of its tables, and its free runs over recordings. MODELS has all of them by name.

    Attributes
    ----------
    layout : of its tables; its name is the model's. driven_by : signal of a recording that a Record's `commands` are.
    candidates_file : file of config/discovery with the effects it may lack. nuisances : whether the offset of each
    channel and recording is estimated with every fit. injects : whether a run can be corrected towards the measurement.
    smooth : whether its runs change with the parameters without small jumps, as friction makes them that holds a table
    fast for whole steps. positions, pressures : whether the position of its free run is compared as well, and the load
    pressure where it was measured.
    """

    layout: ClassVar[TableLayout]
    driven_by: ClassVar[str] = "valve_command"
    candidates_file: ClassVar[str]
    nuisances: ClassVar[bool] = False
    injects: ClassVar[bool] = False
    smooth: ClassVar[bool] = False
    positions: ClassVar[bool] = False
    pressures: ClassVar[bool] = False

    @property
    def name(self) -> str:
        """Its name in MODELS, in config/identification and in the effects' `models`."""
        return self.layout.name

    @property
    def priors(self) -> tuple[tuple[int, float, float], ...]:
        """Column of the parameter vector, value and standard deviation of each number known before the fit."""
        return ()

    def may_move(self, name: str) -> bool:  # noqa: ARG002 (for a model whose table leaves only some numbers open)
        """Whether a fit may move a declared number."""
        return True

    def may_lack(self, effect: str) -> bool:  # noqa: ARG002 (the same)
        """Whether an effect may be missing."""
        return True

    @abstractmethod
    def compared(self, vectors: np.ndarray, record: Record, injection: float = 0.0, /) -> Compared:
        """What is compared of free runs for rows of parameters.

        injection : rate at which a model that `injects` is corrected towards what was measured [1/s].
        """

    def simulate(self, vectors: np.ndarray, record: Record, injection: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
        """Unfiltered velocity [m/s] and acceleration [m/s²] for rows of parameters, each of shape (m, n)."""
        found = self.compared(vectors, record, injection)
        return found.velocity, found.acceleration

    def contradicted(
        self,
        before: TableParameters,  # noqa: ARG002 (for a model whose force is measured)
        after: TableParameters,  # noqa: ARG002 (the same)
        records: list[Record],  # noqa: ARG002 (the same)
    ) -> bool:
        """Whether something measured besides the motion speaks against what was added to a table."""
        return False

    @abstractmethod
    def run(self, table: TableParameters, record: Record) -> np.ndarray:
        """Free run, shape (n, ≥ 3): position, velocity, acceleration, then columns of the model's own."""

    def run_under(self, table: TableParameters, record: Record, forces: np.ndarray) -> np.ndarray | None:  # noqa: ARG002
        """The run under an additional force [N], held from each sample, shape (n,); None for a model without one."""
        return None

    @abstractmethod
    def moved_mass(self, table: TableParameters) -> float:
        """Mass that makes a force of a residual acceleration [kg]; 1 where the model counts in forces per mass."""

    def first_table(self, records: list[Record]) -> TableParameters:  # noqa: ARG002 (for the models that can)
        """A first guess from the recordings alone; ShakeError where the model cannot do without a declared table."""
        raise ShakeError(f"the model {self.name} starts from a declared table, not from recordings")

    def quantities(self, record: Record, simulated: np.ndarray) -> dict[str, np.ndarray]:
        """What a residual may depend on, each of shape (n,); `simulated` as `run` gives it."""
        return {
            "position": record.track,
            "velocity": record.velocity,
            "direction": np.sign(record.velocity),
            **self.inner_quantities(simulated),
            "time": record.begin + np.arange(len(simulated)) * record.sample_time,
        }

    def inner_quantities(self, simulated: np.ndarray) -> dict[str, np.ndarray]:  # noqa: ARG002 (for models with some)
        """Those among them that are simulated, not measured."""
        return {}


@final
class FullModel(DeclaredModel):
    """The sixth-order table of (6.15)."""

    layout = FULL_LAYOUT
    candidates_file = "effects"
    injects = True
    smooth = True
    pressures = True

    def compared(self, vectors: np.ndarray, record: Record, injection: float = 0.0) -> Compared:
        """Velocity, acceleration and, where it was measured, the load pressure."""
        out = self._ran(vectors, self.begun(vectors, record), record, injection)
        pressure = None if record.pressure is None else out[:, :, 2] - out[:, :, 3]
        return Compared(out[:, :, 0], out[:, :, 1], None, pressure)

    @staticmethod
    def _ran(vectors: np.ndarray, states: np.ndarray, record: Record, injection: float = 0.0) -> np.ndarray:
        """Motion, and the pressures where they were measured, of rows of parameters from these states."""
        return run_batch(
            *(vectors, states, record.commands, record.sample_time),
            track=record.track,
            command_before=record.command_before,
            measured=record.motion if injection > 0.0 else record.beginning,
            injection=injection or record.correction,
            cutoff=record.cutoff,
            columns=MOTION if record.pressure is None else MOTION + CHAMBERS,
            tolerance=SMOOTH,
        )

    def run(self, table: TableParameters, record: Record) -> np.ndarray:
        """Free run with the columns of plant.simulation.COLUMNS."""
        return self.run_under(table, record, NOTHING)

    def run_under(self, table: TableParameters, record: Record, forces: np.ndarray) -> np.ndarray:
        """The run under an additional force."""
        (state,) = self.begun(table.vector()[None, :], record)
        return run(
            *(table, record.commands, record.sample_time),
            position=record.track,
            forces=forces,
            state=state,
            command_before=record.command_before,
            measured=record.beginning,
            injection=record.correction,
            cutoff=record.cutoff,
            tolerance=SMOOTH,
        )

    def begun(self, vectors: np.ndarray, record: Record) -> np.ndarray:
        """States of rows of parameters at the first sample of a recording, shape (m, STATES)."""
        states = np.array([initial_state(v, record.track[0]) for v in vectors])
        states[:, VELOCITY], states[:, CLOCK] = record.velocity[0], record.begin
        for vector, state in zip(vectors, states, strict=True):
            remember(vector, state, record.past, record.slid, record.sample_time)
        sway = np.flatnonzero(vectors[:, SPECIMEN_MASS] > 0.0)
        if len(sway) and record.begins_in_motion and record.acceleration is not None and record.explained is None:
            states[sway] = self._swaying(vectors[sway], states[sway], record)
        return states

    def _swaying(self, vectors: np.ndarray, states: np.ndarray, record: Record) -> np.ndarray:
        """States with the specimen's sway that explains most of the beginning of what is compared (Gauss-Newton)."""
        first, found = record.part(slice(0, 4 * record.start)), states.copy()  # which has the same start
        own, omega = [SPECIMEN, SPECIMEN_RATE], 2.0 * math.pi * vectors[:, SPECIMEN_FREQUENCY]
        most = SWAY_MOST * float(np.std(first.felt)) * np.column_stack([omega**-2.0, 1.0 / omega])
        if len(states) > 1:
            found[:, own] = self._swaying(vectors[:1], states[:1], record)[:, own]
        for _ in range(SWAY_STEPS):
            tried = np.repeat(found, 3, axis=0)
            tried[1::3, SPECIMEN] += SWAY
            tried[2::3, SPECIMEN_RATE] += SWAY * omega
            made = self._ran(np.repeat(vectors, 3, axis=0), tried, first)[:, :, 1]
            left = np.nan_to_num(first.acceleration_left(made), posinf=0.0, neginf=0.0)
            rest, *swayed = left.reshape(len(found), 3, -1).swapaxes(0, 1)
            slopes = rest[:, None] - np.stack(swayed, axis=1)
            parts = np.array([np.linalg.lstsq(j.T, r, rcond=1e-6)[0] for j, r in zip(slopes, rest, strict=True)])
            found += np.einsum("ij,ijk->ik", parts, tried.reshape(len(found), 3, -1)[:, 1:] - found[:, None])
            found[:, own] = np.clip(found[:, own], -most, most)
            if np.max(np.abs(parts)) < SWAY_FOUND:
                break
        return found

    def moved_mass(self, table: TableParameters) -> float:
        """Declared mass in motion [kg]."""
        return table.moved_mass

    def inner_quantities(self, simulated: np.ndarray) -> dict[str, np.ndarray]:
        """Load pressure [Pa], spool [-], and the spool times the root of its pressure drop."""
        load, opening = simulated[:, 3] - simulated[:, 4], simulated[:, 6]
        drop = np.maximum(simulated[:, 5] - np.sign(opening) * load, 0.0)
        return {"load_pressure": load, "valve_opening": opening, "flow": opening * np.sqrt(drop)}


FULL = FullModel()
