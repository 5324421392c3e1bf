"""What the declared model makes of the measured command: velocity and acceleration, sample by sample.

The free run of `identify` and `close_loop`: from the command alone, volumes and friction at the measured position. It
goes on under the last command where a few samples are missing, and begins at rest behind a longer gap.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from shake_ros.core.plant.parameters import TableParameters
from shake_ros.core.plant.states import POSITION, VELOCITY
from shake_ros.core.plant.table import Table
from shake_ros.core.quantities import ShakeError

Row = npt.NDArray[np.float32]
FASTEST = 20.0  # a model that runs away is begun again [m/s]
SETTLING = 0.3  # after a beginning at rest, while the table may move, the model says nothing [s]
LONGEST_GAP = 50  # samples that may be missing


class Prediction:
    """One model that follows the table.

    Parameters
    ----------
    sample_time : [s]. model : table to predict with; None for none.
    """

    def __init__(self, sample_time: float, model: TableParameters | None) -> None:
        self._sample_time = sample_time
        self._state: np.ndarray | None = None
        self._command, self._missing, self._settled = 0.0, 0, 0.0
        self.use(model)

    def use(self, model: TableParameters | None) -> None:
        """Predict with another model from now on; safe from another thread."""
        table = Table(model, self._sample_time) if model is not None else None
        if table is not None:  # compiled before the first sample
            table.true_acceleration(table.advance(table.initial_state(), 0.0))
        self._table, self._state = table, None

    def advance(self, commands: Row, positions: Row, supply: Row) -> tuple[Row, Row]:
        """Velocity [m/s] and acceleration [m/s²] of the next samples.

        Parameters
        ----------
        commands, positions, supply : shape (n,) [-], [m], [Pa]; NaN where missing.
        """
        velocity, acceleration = np.full((2, len(commands)), np.nan, dtype=np.float32)
        table, state = self._table, self._state
        if table is None:
            return velocity, acceleration
        for k, (u, x, pressure) in enumerate(zip(commands.tolist(), positions.tolist(), supply.tolist(), strict=True)):
            here = math.isfinite(u) and math.isfinite(x)
            self._missing = 0 if here else self._missing + 1
            if self._missing > LONGEST_GAP or (state is None and not here):
                state = None
                continue
            if state is None:
                state, self._settled = table.initial_state(x), 0.0
            if here:
                state[POSITION], self._command = x, u
            if math.isfinite(pressure):
                table.set_supply_pressure(pressure)
            if self._settled > SETTLING:
                velocity[k], acceleration[k] = state[VELOCITY], table.true_acceleration(state)
            self._settled += self._sample_time
            try:
                state = table.advance(state, self._command)
            except ShakeError:
                state = None
            if state is not None and abs(state[VELOCITY]) > FASTEST:
                state = None
        if table is self._table:
            self._state = state
        return velocity, acceleration
