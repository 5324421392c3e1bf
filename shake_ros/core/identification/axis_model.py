"""The force-driven axis in a fit: its free runs over recordings, and its parameters by inverse dynamics.

The inverse dynamics M a + F_v v + F_c sign(v) + F_0 = F is linear in the four parameters; least squares over all its
signals behind one zero-phase filter, the direction included, is how the EMPS benchmark's values were published.
"""

from __future__ import annotations

from typing import final

import numpy as np

from shake_ros.core.identification.recording_problem import BLOCK
from shake_ros.core.identification.recordings import DeclaredModel, Record
from shake_ros.core.identification.velocity_filter import CUTOFF, low_pass
from shake_ros.core.plant.axis import AXIS_LAYOUT, AxisParameters, initial_state, run_batch
from shake_ros.core.plant.parameters import TableParameters
from shake_ros.core.quantities import ShakeError


@final
class AxisModel(DeclaredModel):
    """Second order, driven by a force [N]; a Record's `commands` are forces here."""

    layout = AXIS_LAYOUT
    driven_by = "force"
    candidates_file = "axis_effects"

    def simulate(self, vectors: np.ndarray, record: Record, _injection: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
        """Velocity and acceleration for rows of parameters."""
        start = initial_state(record.track[0], record.velocity[0])
        out = run_batch(vectors, start, record.commands, record.sample_time, record.track, standing=record.standing)
        return out[:, :, 1], out[:, :, 2]

    def run(self, table: TableParameters, record: Record) -> np.ndarray:
        """Free run with the columns of plant.axis.COLUMNS; the position is the run's own everywhere."""
        start = initial_state(record.track[0], record.velocity[0])
        vectors, standing = table.vector()[None, :], record.standing
        return np.asarray(run_batch(vectors, start, record.commands, record.sample_time, standing=standing)[0])

    def run_under(self, table: TableParameters, record: Record, forces: np.ndarray) -> np.ndarray:
        """The run under an additional force, which a dead time of the command does not delay; it follows the track."""
        ahead = table.value("effects.command_delay.delay") / record.sample_time
        sample = np.arange(len(forces))
        early = np.interp(sample + ahead, sample, forces)
        start, vectors = initial_state(record.track[0], record.velocity[0]), table.vector()[None, :]
        given = (record.sample_time, record.track)
        return np.asarray(run_batch(vectors, start, record.commands + early, *given, standing=record.standing)[0])

    def moved_mass(self, table: TableParameters) -> float:
        """Moved mass [kg]."""
        return table.value("axis.mass")

    def first_table(self, records: list[Record]) -> TableParameters:
        """The axis of least squares over the forces."""
        return InverseDynamics(records).solve()


AXIS = AxisModel()
PARAMETERS = ("axis.mass", "axis.viscous", "axis.coulomb", "axis.offset")
SETTLED = 2.0 / CUTOFF  # at both ends of a recording, where the filter still settles [s]


def position_errors(table: TableParameters, records: list[Record]) -> dict[str, float]:
    """Root mean square position error of the free run per recording [m]; each piece starts where it was measured."""
    squares: dict[str, list[np.ndarray]] = {}
    for record in records:
        error = AXIS.run(table, record)[:, 0] - record.position
        squares.setdefault(record.name, []).append(error**2)
    return {name: float(np.sqrt(np.mean(np.concatenate(parts)))) for name, parts in squares.items()}


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
                "is the motion rich enough, and do both point the same way?"
            )
        viscous, coulomb = max(viscous, 0.0), max(coulomb, 0.0)
        axis = AxisParameters(mass=mass, viscous=viscous, coulomb=coulomb, offset=offset)
        return TableParameters(AXIS_LAYOUT, {"axis": axis})
