"""Observer that carries the identified table and takes every sensor that is there: position, accelerometer, pressures.

As `model.observe` the whole compiled plant is advanced under the command that acted. What a sample shows corrects
it by an extended Kalman filter on

    e = (z_1, z_2, z_3, d, f, b, l):  z' of the reduced model (6.36) under the jerk d − β_2 f,

with d the disturbance of the pressures [m/s³], f an acceleration by a force that the model lacks, b the accelerometer's
bias [m/s²] and l what it shows behind its lag. The position is z_1, the accelerometer l + b (z_3 + b without a lag),
the chamber pressures z_3 − f: a force that the model lacks moves the table and is no pressure. d wanders; f and b fade
with their time constants, so that they stay bounded where no sensor shows them; without pressures f does not move, and
all that the model lacks counts as pressure. The covariance is part of the state and each sample takes the sensors that
it has, one after the other; one that is lost is left out and the rest take over at gains of their own, without a bump.
A reading counts at most `gate` standard deviations off what is expected. A sensor that is further off, or shows the
same number again and again, for `patience` is no longer believed, until it has changed and been within as long. Not in
the thesis.

Verified against: the filter's steady gain by the Riccati equation; a model equal to the plant; a sensor that is lost,
frozen or biased in the middle of a run.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from shake_ros.compiled import njit
from shake_ros.control.observer.law import (
    CARRIED,
    SENSORS,
    CarriedTable,
    carry_copy,
    copy_at,
    kicked,
    motion_now,
    pushed,
    seen_motion,
    sensed_position,
)
from shake_ros.control.observer.linear import LinearObserver
from shake_ros.physics.plant.cylinder import load_pressure
from shake_ros.physics.plant.integration import displace
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.physics.plant.reduced import transition
from shake_ros.physics.plant.states import PRESSURE_A, PRESSURE_B, VELOCITY
from shake_ros.quantities import quantity

UNKNOWNS = 7
D, F, B, L = 3, 4, 5, 6  # places in e behind z_1, z_2, z_3
AWAY, SAME, LAST, OUT = range(4)  # of a watch: samples off what is expected, of the same number, that, not believed
WATCHES = 4 + UNKNOWNS * UNKNOWNS  # place of the two watches behind d, f, b, l and the covariance
SIZE = WATCHES + 8  # of the state behind the copy
AT_START = (1e-5, 1e-3, 0.1, 20.0, 0.01, 0.1, 0.1)  # standard deviations of e at the start
MISLED = (1e-4, 0.03, 3.0, 50.0, 0.3, 0.3, 3.0)  # the same after a sensor that is not believed any more
POSITION_SENSOR = (1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
BEHIND_LAG = (0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0)
WITHOUT_LAG = (0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0)
PRESSURES = (0.0, 0.0, 1.0, 0.0, -1.0, 0.0, 0.0)


@dataclass(frozen=True)
class FusedObserver(CarriedTable, LinearObserver):
    """The name of the table, β and noise levels, which set the gains."""

    code: ClassVar[int] = 6
    sensors: ClassVar[tuple[str, ...]] = SENSORS
    derived: ClassVar[tuple[str, ...]] = (*CARRIED, "lag_share", "patient_samples")

    acceleration_noise: float = quantity("m/s^2", "standard deviation of an accelerometer sample", low=1e-6)
    pressure_noise: float = quantity("Pa", "standard deviation of a chamber pressure's sample", low=1.0)
    force_noise: float = quantity("m/s^2.5", "density of the force per mass that the model lacks", low=1e-9)
    force_memory: float = quantity("s", "time constant with which that force fades", low=1e-3, high=1e6)
    bias_noise: float = quantity("m/s^2.5", "density of the accelerometer's bias", low=1e-9)
    bias_memory: float = quantity("s", "time constant with which the bias fades", low=1e-3, high=1e6)
    gate: float = quantity("-", "standard deviations beyond which a reading is ignored", low=1.0, high=1e6)
    patience: float = quantity("s", "time beyond that, or at one value, after which a sensor is left out", low=1e-3)

    def derive(self, sample_time: float, model: TableParameters | None) -> dict[str, float]:
        """What the copy needs, and the share of its way that the accelerometer's lag goes in a sample."""
        assert model is not None
        lag = model.value("effects.accelerometer_lag.time_constant")
        share = -math.expm1(-sample_time / lag) if lag > 0.0 else 1.0
        own = {"lag_share": share, "patient_samples": max(round(self.patience / sample_time), 1)}
        return super().derive(sample_time, model) | own

    def started(
        self, estimate: NDArray[np.float64], command: float, sample_time: float, model: TableParameters | None
    ) -> NDArray[np.float64]:
        """The copy's state, see `copy_at`, without disturbance, force and bias."""
        assert model is not None
        own = np.zeros(SIZE)
        own[3] = estimate[2]
        own[4:WATCHES] = np.diag(np.square(AT_START)).ravel()
        return np.concatenate([copy_at(estimate, model, sample_time, command), own])

    def not_believed(self, state: NDArray[np.float64]) -> tuple[str, ...]:
        """The accelerometer, the pressures, or both."""
        out = state[len(state) - SIZE + WATCHES + OUT :: 4]
        return tuple(name for name, flag in zip(("acceleration", "pressures"), out, strict=True) if flag != 0.0)


@njit
def advance_covariance(covariance, p, command, pressed, dt):  # type: ignore[no-untyped-def]
    """P ← Φ P Φᵀ + Q of e over a sample, in place; f only changes where there are pressures (`pressed`)."""
    opening = abs(command)
    phi, gamma = transition(p.beta1 + p.beta5 * opening, p.beta2 + p.beta4 * opening, dt)
    step = np.zeros((UNKNOWNS, UNKNOWNS))
    for i in range(3):
        for j in range(3):
            step[i, j] = phi[i, j]
        step[i, D] = gamma[i]
        step[i, F] = -p.beta2 * gamma[i]
    step[D, D] = 1.0
    step[F, F] = 1.0 - dt / p.force_memory
    step[B, B] = 1.0 - dt / p.bias_memory
    step[L, L] = 1.0 - p.lag_share
    for j in range(UNKNOWNS):  # behind the lag: the acceleration at the sample's end
        step[L, j] += p.lag_share * step[2, j]
    covariance[:] = step @ covariance @ step.T
    force = p.force_noise * p.force_noise * dt if pressed else 0.0  # moves f and, as a force, the acceleration
    covariance[2, 2] += p.jerk_noise * p.jerk_noise * dt + force
    covariance[2, F] += force
    covariance[F, 2] += force
    covariance[F, F] += force
    covariance[D, D] += p.disturbance_noise * p.disturbance_noise * dt
    covariance[B, B] += p.bias_noise * p.bias_noise * dt


@njit
def correct(found, covariance, shown, away, noise, gate, watch, patient):  # type: ignore[no-untyped-def]
    """e and P after one reading, in place.

    Parameters
    ----------
    found : (7,) e.
    shown : (7,) what the sensor shows of e.
    away : reading minus what the copy and e = 0 show.
    noise : standard deviation of the reading.
    gate : standard deviations of the difference that count at most.
    watch : (4,) of the sensor, changed in place; empty for one that is always believed.
    patient : samples.

    Returns
    -------
    whether the sensor is not believed from now on.
    """
    gained, size = np.zeros(UNKNOWNS), noise * noise
    for i in range(UNKNOWNS):
        away -= shown[i] * found[i]
        for j in range(UNKNOWNS):
            gained[i] += covariance[i, j] * shown[j]
    for i in range(UNKNOWNS):
        size += shown[i] * gained[i]
    if watch.shape[0] > 0:
        bound = gate * math.sqrt(size)
        watch[AWAY] = min(watch[AWAY] + 1.0, patient) if abs(away) > bound else max(watch[AWAY] - 1.0, 0.0)
        before = watch[OUT]
        if watch[AWAY] >= patient or watch[SAME] >= patient:
            watch[OUT] = 1.0
        elif watch[AWAY] == 0.0 and watch[SAME] == 0.0:
            watch[OUT] = 0.0
        if watch[OUT] != 0.0:
            return before == 0.0
        away = min(max(away, -bound), bound)
    for i in range(UNKNOWNS):
        found[i] += gained[i] / size * away
        for j in range(UNKNOWNS):
            covariance[i, j] -= gained[i] * gained[j] / size
    return False


@njit
def forget(own, covariance):  # type: ignore[no-untyped-def]
    """What a sensor that is not believed any more has taught of d, f and b goes; the rest finds its way anew."""
    own[:3] = 0.0
    covariance[:] = 0.0
    for i in range(UNKNOWNS):
        covariance[i, i] = MISLED[i] ** 2


@njit
def see(watch, reading):  # type: ignore[no-untyped-def]
    """Count in a watch for how many samples a sensor has shown the same number."""
    watch[SAME] = watch[SAME] + 1.0 if reading == watch[LAST] else 0.0
    watch[LAST] = reading


@njit
def observe(state, p, model, measured, command, dt, work, estimate):  # type: ignore[no-untyped-def]
    """One sample, in place.

    Parameters
    ----------
    state : (STATES + history + SIZE,) array: the copy's states, its past commands, d [m/s³], f, b, l [m/s²], the
        covariance, and the watches of accelerometer and pressures
    model : the copy's record.
    p, measured, command, dt, work, estimate : as in `sliding_mode.observe`
    """
    last = state.shape[0] - SIZE
    own = state[last:]
    covariance = own[4 : 4 + UNKNOWNS * UNKNOWNS].reshape((UNKNOWNS, UNKNOWNS))
    carry_copy(model, state, last, command, p.dead_samples, p.dead_fraction, dt, work)
    pushed(state, p.pressure_per_acceleration * dt * own[0])
    kicked(state, own[1], dt)
    own[1] *= 1.0 - dt / p.force_memory
    own[2] *= 1.0 - dt / p.bias_memory
    pressed = math.isfinite(measured[2] + measured[3]) and own[WATCHES + 4 + OUT] == 0.0
    advance_covariance(covariance, p, command, pressed, dt)
    motion_now(model, state, work, estimate)
    own[3] += p.lag_share * (estimate[2] + own[1] - own[3])
    found, patient, misled = np.zeros(UNKNOWNS), p.patient_samples, False
    away = measured[0] - sensed_position(model, state)
    correct(found, covariance, POSITION_SENSOR, away, p.position_noise, 0.0, own[SIZE:], patient)
    if math.isfinite(measured[1]):
        watch = own[WATCHES : WATCHES + 4]
        see(watch, measured[1])
        expected = (1.0 + model.accelerometer_scale_error) * own[3] + model.accelerometer_bias_bias + own[2]
        shown = BEHIND_LAG if p.lag_share < 1.0 else WITHOUT_LAG
        misled = correct(found, covariance, shown, measured[1] - expected, p.acceleration_noise, p.gate, watch, patient)
    if math.isfinite(measured[2] + measured[3]):
        watch, pressure = own[WATCHES + 4 : SIZE], load_pressure(model, measured[2], measured[3])
        see(watch, pressure)
        per_pressure = 1.0 / (p.pressure_per_acceleration * (1.0 + model.body_area_ratio))  # of P_L [m/s²/Pa]
        away = per_pressure * (pressure - load_pressure(model, state[PRESSURE_A], state[PRESSURE_B]))
        noise = per_pressure * p.pressure_noise * math.sqrt(1.0 + model.body_area_ratio**2)
        if correct(found, covariance, PRESSURES, away, noise, p.gate, watch, patient):
            misled = True
    displace(state, found[0])
    state[VELOCITY] += found[1]
    pushed(state, p.pressure_per_acceleration * (found[2] - found[F]))
    own[0] += found[D]
    own[1] += found[F]
    own[2] += found[B]
    own[3] += found[L]
    if misled:
        forget(own, covariance)
    push = p.pressure_per_acceleration * dt * own[0]
    seen_motion(p, model, state, last, push, own[1], dt, work, estimate)
