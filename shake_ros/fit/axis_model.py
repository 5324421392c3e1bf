"""The force-driven axis in a fit: its free runs over recordings, and its parameters by inverse dynamics.

The inverse dynamics M a + F_v v + F_c sign(v) + F_0 = F is linear in the four parameters; least squares over all its
signals behind one zero-phase filter, the direction included, is how the EMPS benchmark's values were published.

Some things change so slowly on such an axis that each recording has its own: level of friction, offset, drift.

    M v̇ = F − F_0 − b − d (t − t_m) − λ (friction of the axis)

Grease and amplifier warm up between recordings and within them, and a free run adds that up: 0.1 N beside 20 N of
friction moves a run of 25 s by millimetres. So every recording that is long enough has a drift d of its force, zero in
the mean about its middle t_m; and every one but the first that is learned from has an offset b and a level λ of all
friction, relative to that one. They are the least squares of its position error for whatever parameters are tried
(Gauss-Newton from d = 0, b = 0, λ = 1). They are no numbers of the axis. A recording held out has them as well: what is
shown of it with them is no forecast from its force alone, which `forecast_errors` gives.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, final

import numpy as np

from shake_ros.fit.declared_model import Compared, DeclaredModel
from shake_ros.fit.recording_problem import BLOCK
from shake_ros.fit.records import Record
from shake_ros.physics.effects.unlisted import CHANGES, FORCE_OF_VELOCITY, FRICTION_OF_POSITION, NODES
from shake_ros.physics.plant.axis import AXIS_LAYOUT, AxisParameters, accelerations, initial_state, run_batch
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.physics.plant.simulation import NOTHING
from shake_ros.quantities import ShakeError
from shake_ros.signals.velocity_filter import CUTOFF, low_pass

DRIFT, LEVEL, OFFSET = "drift", "level", "offset"
LONG = 10.0  # a drift shows in recordings that are long beside the seconds in which an axis settles [s]
ROUNDS = 3  # of Gauss-Newton, the last on the slopes of the one before; a drift alone needs one less
# Steps of the differences, which move a long run by millimetres [N/s], [-], [N]; and the largest values, in the force's
# deviation (per length of the recording) and in all friction: more is no slow change.
STEPS = {DRIFT: 1e-3, LEVEL: 2e-3, OFFSET: 1e-2}
LARGEST = {DRIFT: 0.1, LEVEL: 0.3, OFFSET: 0.1}
_INDEX = AXIS_LAYOUT.index
_KIND = _INDEX["effects.unlisted.kind"]
_NODES = [_INDEX[f"effects.unlisted.node_{i:02d}"] for i in range(NODES)]
_NODES += [_INDEX[f"effects.unlisted.{end}_{i}"] for end in ("above", "below") for i in range(CHANGES)]
_FRICTION = [
    _INDEX[name]
    for name in (
        "axis.viscous",
        "axis.coulomb",
        "effects.quadratic_drag.coefficient",
        "effects.position_dependent_friction.gradient",
        "effects.position_dependent_friction.curvature",
    )
]
Run = Callable[[np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True)
class SlowChange:
    """What one recording has of its own. level : of its friction [-]. offset [N] and drift [N/s] : of its force."""

    recording: str
    level: float = 1.0
    offset: float = 0.0
    drift: float = 0.0


def with_slow_changes(estimation: Sequence[Record], validation: Sequence[Record]) -> tuple[list[Record], list[Record]]:
    """The records with what each takes from itself, as the module says."""

    def own(record: Record, first: bool) -> Record:
        long = len(record.commands) * record.sample_time >= LONG
        return replace(record, own=() if not long else (DRIFT,) if first else (DRIFT, LEVEL, OFFSET))

    learned = [own(r, r.name == estimation[0].name) for r in estimation]
    return learned, [own(r, False) for r in validation]


def changed(
    vectors: np.ndarray, record: Record, names: Sequence[str], values: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Parameters, shape (m, k), and forces, (m, n) [N], under slow changes of some names, (m, len(names))."""
    vectors, forces = vectors.copy(), np.tile(record.commands, (len(vectors), 1))
    for name, value in zip(names, values.T, strict=True):
        if name == DRIFT:
            time = record.sample_time * (np.arange(forces.shape[1]) - 0.5 * (forces.shape[1] - 1))
            forces -= value[:, None] * time
        elif name == OFFSET:
            forces -= value[:, None]
        else:
            vectors[:, _FRICTION] *= 1.0 + value[:, None]
            of_friction = np.isin(vectors[:, _KIND], (FRICTION_OF_POSITION, FORCE_OF_VELOCITY))
            vectors[:, _NODES] *= np.where(of_friction, 1.0 + value, 1.0)[:, None]
    return vectors, forces


def found_changes(run: Run, vectors: np.ndarray, record: Record) -> np.ndarray:
    """Drift [N/s], level − 1 and offset [N] of a recording, those of record.own, for rows of parameters, (m, len(own)).

    Parameters
    ----------
    run : gives the positions, shape (m, n) [m], of rows of parameters and of forces.
    """
    names, m = record.own, len(vectors)
    found, step = np.zeros((m, len(names))), np.array([STEPS[name] for name in names])
    seconds = len(record.commands) * record.sample_time
    force = float(np.std(record.commands))
    unit = {DRIFT: force / seconds, OFFSET: force, LEVEL: 1.0}
    largest = np.array([LARGEST[n] * unit[n] for n in names])
    rounds = ROUNDS if LEVEL in names else ROUNDS - 1
    for k in range(rounds):
        reached = run(*changed(vectors, record, names, found))[:, record.start :]
        if k < max(rounds - 1, 1):
            tried = [run(*changed(vectors, record, names, found + row))[:, record.start :] for row in np.diag(step)]
            slopes = (np.array(tried) - reached) / step[:, None, None]
        error = record.position[record.start :] - reached
        for i in range(m):
            found[i] += np.linalg.lstsq(slopes[:, i].T, error[i], rcond=None)[0]
        found = np.clip(np.nan_to_num(found), -largest, largest)
    return found


@final
class AxisModel(DeclaredModel):
    """Second order, driven by a force [N]; a Record's `commands` are forces here."""

    layout = AXIS_LAYOUT
    driven_by = "force"
    candidates_file = "axis_effects"

    positions: ClassVar[bool] = True

    def compared(self, vectors: np.ndarray, record: Record, _injection: float = 0.0) -> Compared:
        """Velocity, acceleration and position, with what the recording has of its own."""
        out = self._free_runs(vectors, record, record.track)
        return Compared(out[:, :, 1], out[:, :, 2], out[:, :, 0])

    def run(self, table: TableParameters, record: Record) -> np.ndarray:
        """Free run with the columns of plant.axis.COLUMNS; the position is the run's own everywhere."""
        return self._free_runs(table.vector()[None, :], record, NOTHING)[0]

    def slow_change(self, table: TableParameters, record: Record) -> SlowChange:
        """What a recording has of its own under a table."""
        _, values = self._changed(table.vector()[None, :], record, NOTHING)
        own = dict(zip(record.own, values[0].tolist(), strict=True))
        return SlowChange(record.name, 1.0 + own.get(LEVEL, 0.0), own.get(OFFSET, 0.0), own.get(DRIFT, 0.0))

    def contradicted(self, before: TableParameters, after: TableParameters, records: list[Record]) -> bool:
        """Whether the force along the measured motion fits a table less than before.

        A free run that is pulled to the velocities of a recording by steps of its friction is near it, whatever the
        force; along the measured motion each such step is an error of the force.
        """
        return force_error(after, records) > force_error(before, records)

    def _free_runs(self, vectors: np.ndarray, record: Record, track: np.ndarray) -> np.ndarray:
        return self._runs(*self._changed(vectors, record, track)[0], record, track)

    def _changed(
        self, vectors: np.ndarray, record: Record, track: np.ndarray
    ) -> tuple[tuple[np.ndarray, np.ndarray], np.ndarray]:
        """Parameters and forces under the slow changes of a recording, and these."""
        if not record.own:
            return (vectors, record.commands), np.zeros((len(vectors), 0))
        values = found_changes(lambda v, f: self._runs(v, f, record, track)[:, :, 0], vectors, record)
        return changed(vectors, record, record.own, values), values

    @staticmethod
    def _runs(vectors: np.ndarray, forces: np.ndarray, record: Record, track: np.ndarray) -> np.ndarray:
        start = initial_state(record.track[0], record.velocity[0], record.begin)
        return run_batch(vectors, start, forces, record.sample_time, track, force_before=record.command_before)

    def forces_left(self, table: TableParameters, record: Record) -> np.ndarray:
        """What a table leaves of the low-passed force along the measured motion, shape (n,) [N]."""
        (vectors, forces), _ = self._changed(table.vector()[None, :], record, NOTHING)
        dt, v = record.sample_time, record.velocity
        expected = np.empty(len(v))
        series = np.ascontiguousarray(np.broadcast_to(forces, (1, len(v)))[0])
        p = AXIS_LAYOUT.records(vectors)[0]
        accelerations(p, series, record.command_before, v, record.track, record.begin, dt, expected)
        return self.moved_mass(table) * low_pass(expected - np.gradient(v, dt), dt)

    def run_under(self, table: TableParameters, record: Record, forces: np.ndarray) -> np.ndarray:
        """The run under an additional force, which a dead time of the command does not delay; it follows the track.

        What the recording has of its own is what it has without that force.
        """
        ahead = table.value("effects.command_delay.delay") / record.sample_time
        sample = np.arange(len(forces))
        early = np.interp(sample + ahead, sample, forces)
        (vectors, own), _ = self._changed(table.vector()[None, :], record, record.track)
        return np.asarray(self._runs(vectors, own + early, record, record.track)[0])

    def moved_mass(self, table: TableParameters) -> float:
        """Moved mass [kg]."""
        return table.value("axis.mass")

    def first_table(self, records: list[Record]) -> TableParameters:
        """The axis of least squares over the forces."""
        return InverseDynamics(records).solve()


AXIS = AxisModel()
PARAMETERS = ("axis.mass", "axis.viscous", "axis.coulomb", "axis.offset")
SETTLED = 2.0 / CUTOFF  # at both ends of a recording, where the filter still settles [s]


def position_errors(table: TableParameters, records: Sequence[Record]) -> dict[str, float]:
    """Root mean square position error of the free run per recording [m]; each piece starts where it was measured."""
    squares: dict[str, list[np.ndarray]] = {}
    for record in records:
        error = AXIS.run(table, record)[:, 0] - record.position
        squares.setdefault(record.name, []).append(error**2)
    return {name: float(np.sqrt(np.mean(np.concatenate(parts)))) for name, parts in squares.items()}


def force_error(table: TableParameters, records: Sequence[Record]) -> float:
    """Root mean square of what a table leaves of the force along the measured motion [N]."""
    parts = []
    for record in records:
        margin = round(SETTLED / record.sample_time)
        parts.append(AXIS.forces_left(table, record)[margin : len(record.commands) - margin])
    return float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))


def slow_changes(table: TableParameters, records: Sequence[Record]) -> list[SlowChange]:
    """What those recordings have of their own that have anything."""
    return [AXIS.slow_change(table, record) for record in records if record.own]


def forecast_errors(table: TableParameters, records: Sequence[Record]) -> dict[str, float]:
    """The same position errors where no recording has anything of its own: from its force alone [m]."""
    return position_errors(table, [replace(record, own=()) for record in records])


class InverseDynamics:
    """Weighted residual of the force, M a + F_v v + F_c sign(v) + F_0 − F, with effects at their neutral values."""

    def __init__(self, records: list[Record]) -> None:
        matrices, forces, numbers, first = [], [], [], 0
        for record in records:
            v, dt = record.velocity, record.sample_time
            margin = round(SETTLED / dt)
            span = slice(margin, max(len(v) - margin, margin))
            direction = low_pass(np.sign(v), dt)
            matrices.append(np.column_stack([np.gradient(v, dt), v, direction, np.ones_like(v)])[span])
            forces.append(low_pass(record.commands, dt)[span])
            blocks = first + (np.arange(len(forces[-1])) * dt / BLOCK).astype(int)
            numbers.append(blocks)
            first = int(blocks[-1]) + 1
        self._matrix, self._force, self._blocks = (np.concatenate(x) for x in (matrices, forces, numbers))
        self._columns = [AXIS_LAYOUT.names.index(name) for name in PARAMETERS]
        self.names = ", ".join(dict.fromkeys(r.name for r in records))
        self.weight = 1.0 / max(float(np.std(self._force)), 1e-300)

    def residuals(self, vectors: np.ndarray) -> np.ndarray:
        """Residuals for rows of parameters, relative to the force's standard deviation, shape (m, n)."""
        return np.asarray(self.weight * (vectors[:, self._columns] @ self._matrix.T - self._force))

    def blocks(self) -> np.ndarray:
        """Number of the block of time that each residual belongs to, shape (n,)."""
        return self._blocks

    def solve(self) -> TableParameters:
        """The axis of least squares.

        Raises
        ------
        ShakeError : the motion does not tell the parameters apart, or the mass comes out negative.
        """
        solution, _, rank, _ = np.linalg.lstsq(self._matrix, self._force, rcond=None)
        mass, viscous, coulomb, offset = (float(value) for value in solution)
        if rank < len(PARAMETERS) or mass <= 0.0:
            raise ShakeError(
                f"{self.names}: topics force and joint_states give no mass ({mass:.3g} kg): "
                "is the motion rich enough, and do both have the same sign?"
            )
        viscous, coulomb = max(viscous, 0.0), max(coulomb, 0.0)
        axis = AxisParameters(mass=mass, viscous=viscous, coulomb=coulomb, offset=offset)
        return TableParameters(AXIS_LAYOUT, {"axis": axis})
