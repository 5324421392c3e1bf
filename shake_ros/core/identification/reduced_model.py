"""The reduced model (6.36) in a fit: its free runs over recordings, and a first guess from the recordings alone."""

from __future__ import annotations

import math

import numpy as np

from shake_ros.core.identification.free_parameters import Declared
from shake_ros.core.identification.recordings import Record, low_pass
from shake_ros.core.plant.reduced import ReducedParameters
from shake_ros.core.plant.reduced_simulation import initial_state, run_batch
from shake_ros.core.plant.reduced_table import reduced_table
from shake_ros.core.plant.small_table import SmallTable
from shake_ros.core.quantities import ShakeError

FREQUENCIES = np.geomspace(0.5, 60.0, 16)  # natural frequencies of the first guess [Hz]
DAMPINGS = (0.1, 0.4, 1.0)


class ReducedModel:
    """Third order in acceleration per command; forces count per moved mass."""

    def _runs(self, vectors: np.ndarray, record: Record) -> np.ndarray:
        place, speed, standing = record.track[0], record.velocity[0], record.standing
        starts = np.array([initial_state(v, place, speed, standing) for v in vectors])
        return run_batch(vectors, starts, record.commands, record.sample_time, record.track, standing=standing)

    def simulate(self, vectors: np.ndarray, record: Record) -> tuple[np.ndarray, np.ndarray]:
        """Velocity [m/s] and acceleration [m/s²] for rows of parameters, each of shape (m, n)."""
        out = self._runs(vectors, record)
        return out[:, :, 1], out[:, :, 2]

    def run(self, table: Declared, record: Record) -> np.ndarray:
        """Free run with the columns of plant.reduced_simulation.COLUMNS."""
        return np.asarray(self._runs(table.vector()[None, :], record)[0])

    def quantities(self, record: Record, simulated: np.ndarray) -> dict[str, np.ndarray]:
        """What a residual may depend on, each of shape (n,)."""
        return {
            "position": record.track,
            "velocity": record.velocity,
            "direction": np.sign(record.velocity),
            "valve_opening": simulated[:, 3],
            "time": np.arange(len(simulated)) * record.sample_time,
        }

    def moved_mass(self, table: Declared) -> float:
        """1: forces count per mass."""
        return 1.0


REDUCED = ReducedModel()


def first_table(records: list[Record]) -> SmallTable:
    """The linear model on a grid of frequency and damping that comes nearest to the measured velocity.

    Raises
    ------
    ShakeError : the velocity goes against the command, or does not answer it.
    """
    grid = [(2.0 * math.pi * f, z) for f in FREQUENCIES for z in DAMPINGS]
    neutral = reduced_table(ReducedParameters(beta1=-1.0, beta2=-1.0, beta3=1.0, beta4=0.0, beta5=0.0)).vector()
    vectors = np.tile(neutral, (len(grid), 1))
    vectors[:, 0] = [-w * w for w, _ in grid]
    vectors[:, 1] = [-2.0 * z * w for w, z in grid]
    vectors[:, 2] = [w * w for w, _ in grid]  # a gain of 1 m/s per command
    cross, power = np.zeros(len(grid)), np.zeros(len(grid))
    for record in records:
        simulated = low_pass(REDUCED.simulate(vectors, record)[0], record.sample_time)[:, record.start :]
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
    return reduced_table(beta)
