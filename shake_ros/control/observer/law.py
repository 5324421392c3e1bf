"""What every observer has; and the copy of a table that some carry: started at an estimate, advanced, read as motion.

The copy's state is that of `plant.table.Table`: the states of plant/states.py and behind them the latest commands,
newest first, which a dead time needs. Everything compiled works in place.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from shake_ros.compiled import njit
from shake_ros.physics.plant.dormand_prince import STAGE, workspace
from shake_ros.physics.plant.integration import (
    acceleration_now,
    advance_late,
    advance_sample,
    displace,
    hold,
    position_sensor,
)
from shake_ros.physics.plant.parameters import TableParameters, dead_time
from shake_ros.physics.plant.right_hand_side import active_states
from shake_ros.physics.plant.simulation import TOLERANCE, moving_state
from shake_ros.physics.plant.states import BASE, BASE_RATE, POSITION, PRESSURE_A, PRESSURE_B, STATES, VELOCITY
from shake_ros.quantities import Parameters, choice, quantity

SENSORS = ("acceleration", "pressure_a", "pressure_b")  # beside the position, in the order of `measured`


@dataclass(frozen=True)
class ObserverParameters(Parameters):
    """Base of the observers' parameters."""

    code: ClassVar[int]  # number by which compiled code knows the observer, above zero
    sensors: ClassVar[tuple[str, ...]] = ()  # of `SENSORS`: what it takes beside the position where it is there
    carries_table: ClassVar[bool] = False  # whether it needs the table that `model` names
    derived: ClassVar[tuple[str, ...]] = ()  # names of what `derive` gives

    def derive(self, sample_time: float, model: TableParameters | None) -> dict[str, float]:
        """What the compiled step reads beside the parameters, by name."""
        return {}

    def started(
        self, estimate: NDArray[np.float64], command: float, sample_time: float, model: TableParameters | None
    ) -> NDArray[np.float64]:
        """The state that continues from an estimate (3,) under the command that stands."""
        return np.array(estimate, dtype=np.float64)

    def not_believed(self, state: NDArray[np.float64]) -> tuple[str, ...]:
        """Names of sensors that are there and not taken, since they are far off what is expected or frozen."""
        return ()


CARRIED = ("pressure_per_acceleration", "dead_samples", "dead_fraction", "ahead")  # what a carried table adds


@dataclass(frozen=True, kw_only=True)
class CarriedTable(ObserverParameters):
    """Base of the observers that carry a table."""

    carries_table: ClassVar[bool] = True
    derived: ClassVar[tuple[str, ...]] = CARRIED

    model: str = choice("table configuration of the model")
    loop_delay: float = quantity("s", "dead time of the feedback beyond the model's", low=0.0, high=0.1, default=0.0)
    predict: bool = choice("whether the estimate is that of the instant at which the command acts", default=False)

    def derive(self, sample_time: float, model: TableParameters | None) -> dict[str, float]:
        """Pressure that one chamber gains and the other loses per acceleration; the dead time; whether to predict."""
        assert model is not None
        mass = model.moved_mass + model.value("effects.payload_error.mass")
        numbers = mass / model.body.acting_area, *dead_time(model, sample_time), float(self.predict)
        return super().derive(sample_time, model) | dict(zip(CARRIED, numbers, strict=True))

    def started(
        self, estimate: NDArray[np.float64], command: float, sample_time: float, model: TableParameters | None
    ) -> NDArray[np.float64]:
        """The copy's state, see `copy_at`, and a disturbance of zero behind it."""
        assert model is not None
        return np.append(copy_at(estimate, model, sample_time, command), 0.0)


def work() -> NDArray[np.float64]:
    """Array in which the compiled functions work; any number of observers may share it."""
    return np.asarray(workspace())


def copy_at(
    estimate: NDArray[np.float64], model: TableParameters, sample_time: float, command: float
) -> NDArray[np.float64]:
    """State of a copy that is at position, velocity and acceleration (3,) under a command that has stood.

    The spool has followed the command, and the load pressure is the one that makes the acceleration, as far as
    supply and tank allow.
    """
    position, velocity, acceleration = (float(value) for value in estimate[:3])
    y = moving_state(model.vector(), position, velocity, acceleration, command or None)
    whole, _ = dead_time(model, sample_time)
    return np.concatenate([y, np.full(whole + 2, command)])


@njit
def carry_copy(p, y, end, command, whole, fraction, dt, work):  # type: ignore[no-untyped-def]
    """One sample under a held command; the commands stand in y[STATES:end]."""
    acting = min(max(command, -1.0), 1.0)
    advance_late(p, y, y[STATES:end], acting, int(whole), fraction, 0.0, dt, work, False, TOLERANCE)


@njit
def sensed_position(p, y):  # type: ignore[no-untyped-def]
    """What the model's position sensor shows, without noise and steps [m]."""
    half = 0.5 * p.sensors_position_range
    return min(max(position_sensor(p, y), -half), half)


@njit
def motion_now(p, y, work, motion):  # type: ignore[no-untyped-def]
    """Absolute position [m], velocity [m/s] and acceleration [m/s²] of the copy into `motion`, (3,)."""
    motion[0] = y[POSITION] + y[BASE]
    motion[1] = y[VELOCITY] + y[BASE_RATE]
    motion[2] = acceleration_now(p, y, work[STAGE])


@njit
def pushed(y, push):  # type: ignore[no-untyped-def]
    """Add a pressure [Pa] to chamber A and take it from B, in place."""
    y[PRESSURE_A] += push
    y[PRESSURE_B] -= push


@njit
def kicked(y, kick, dt):  # type: ignore[no-untyped-def]
    """Place and velocity after an acceleration [m/s²] beside the model's, in place."""
    displace(y, 0.5 * dt * dt * kick)
    y[VELOCITY] += dt * kick


@njit
def seen_motion(p, model, y, end, push, kick, dt, work, motion):  # type: ignore[no-untyped-def]
    """Motion of the copy now; where the observer predicts, when the next command begins to act, the dead time from now.

    Parameters
    ----------
    p, model : records of the observer and of the copy.
    y : state whose commands stand in y[STATES:end]; not changed.
    push : load pressure that a disturbance adds to P_A and takes from P_B each sample [Pa].
    kick : acceleration by a force that the model lacks [m/s²].
    motion : as in `motion_now`
    """
    if p.ahead > 0.0:
        later, past, samples, fraction = y[:STATES].copy(), y[STATES:end], int(p.dead_samples), p.dead_fraction
        for i in range(samples + 1):
            part = 1.0 if i < samples else fraction
            if part <= 1e-9:
                break
            if i < samples:
                late, timely = past[samples - i], past[samples - i - 1]
                advance_sample(model, later, late, timely, fraction, 0.0, dt, work, False, TOLERANCE)
            else:
                hold(model, later, past[0], 0.0, fraction * dt, active_states(model), work, False, TOLERANCE)
            pushed(later, part * push)
            kicked(later, kick, part * dt)
        motion_now(model, later, work, motion)
    else:
        motion_now(model, y, work, motion)
    motion[2] += kick
