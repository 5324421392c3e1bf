"""The reduced model (6.36) in a fit: its free runs over recordings, and a first guess from the recordings alone."""

from __future__ import annotations

import math
from typing import final

import numpy as np

from shake_ros.fit.declared_model import Compared, DeclaredModel
from shake_ros.fit.records import Record
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.physics.plant.reduced import REDUCED_LAYOUT, ReducedParameters
from shake_ros.physics.plant.reduced_simulation import initial_state, run_batch
from shake_ros.quantities import ShakeError
from shake_ros.signals.velocity_filter import filtered_velocity

FREQUENCIES = np.geomspace(0.5, 60.0, 16)  # natural frequencies of the first guess [Hz]
DAMPINGS = (0.1, 0.4, 1.0)


@final
class ReducedModel(DeclaredModel):
    """Third order in acceleration per command; forces count per moved mass."""

    layout = REDUCED_LAYOUT
    candidates_file = "reduced_effects"

    def _runs(self, vectors: np.ndarray, record: Record) -> np.ndarray:
        place, speed, command_before = record.track[0], record.velocity[0], record.command_before
        starts = np.array([initial_state(v, place, speed, command_before) for v in vectors])
        return run_batch(
            vectors, starts, record.commands, record.sample_time, record.track, command_before=command_before
        )

    def compared(self, vectors: np.ndarray, record: Record, _injection: float = 0.0) -> Compared:
        """Velocity and acceleration."""
        out = self._runs(vectors, record)
        return Compared(out[:, :, 1], out[:, :, 2])

    def run(self, table: TableParameters, record: Record) -> np.ndarray:
        """Free run with the columns of plant.reduced_simulation.COLUMNS."""
        return np.asarray(self._runs(table.vector()[None, :], record)[0])

    def moved_mass(self, table: TableParameters) -> float:  # noqa: ARG002 (the signature of every model)
        """1: forces count per mass."""
        return 1.0

    def inner_quantities(self, simulated: np.ndarray) -> dict[str, np.ndarray]:
        """Valve opening [-]."""
        return {"valve_opening": simulated[:, 3]}

    def first_table(self, records: list[Record]) -> TableParameters:
        """The linear model on a grid of frequency and damping that comes nearest to the measured velocity.

        Raises
        ------
        ShakeError : the velocity goes against the command, or does not answer it.
        """
        grid = [(2.0 * math.pi * f, z) for f in FREQUENCIES for z in DAMPINGS]
        neutral = ReducedParameters(beta1=-1.0, beta2=-1.0, beta3=1.0, beta4=0.0, beta5=0.0)
        vectors = np.tile(TableParameters(REDUCED_LAYOUT, {"dynamics": neutral}).vector(), (len(grid), 1))
        vectors[:, 0] = [-w * w for w, _ in grid]
        vectors[:, 1] = [-2.0 * z * w for w, z in grid]
        vectors[:, 2] = [w * w for w, _ in grid]  # a gain of 1 m/s per command
        cross, power = np.zeros(len(grid)), np.zeros(len(grid))
        for record in records:
            simulated = filtered_velocity(self.simulate(vectors, record)[0], record.sample_time)[:, record.start :]
            weight = 1.0 / max(float(np.sum(record.velocity[record.start :] ** 2)), 1e-300)
            cross += weight * (simulated @ record.velocity[record.start :])
            power += weight * np.sum(simulated**2, axis=1)
        if all(not np.any(record.commands) for record in records):
            raise ShakeError(f"{records[0].name}: the command is zero throughout")
        best = int(np.argmax(cross**2 / np.maximum(power, 1e-300)))
        gain = float(cross[best] / power[best])
        if gain <= 0.0:
            names = ", ".join(dict.fromkeys(r.name for r in records))
            raise ShakeError(f"{names}: the velocity goes against the command; import one of them with the scale -1")
        omega, damping = grid[best]
        beta = ReducedParameters(
            beta1=-(omega**2), beta2=-2.0 * damping * omega, beta3=gain * omega**2, beta4=0.0, beta5=0.0
        )
        return TableParameters(REDUCED_LAYOUT, {"dynamics": beta})


REDUCED = ReducedModel()
