"""What sensors that a table lacks would show of a motion, from config/experiment, beside what its own sensors show.

The models give the absolute acceleration a of the table and the pressures of its chambers. The other signals follow,
with the numbers of each model: the acceleration of a flexible specimen is a behind its spring and damper; the rod
carries all of the mass and what holds the table to the ground; a compliant base answers the force of the rod. Friction
is between piston and cylinder, so the load cell does not see it. A shear frame's reaction is left out of the force.

The offset of each further sensor is unknown, and so is the scale of pressures and forces of a table without a data
sheet, which have no unit of their own there.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import cont2discrete, lfilter

from shake_ros.fit.declared_model import FULL
from shake_ros.fit.recording_problem import RecordingProblem
from shake_ros.fit.records import MODEL_FLOOR, Record
from shake_ros.physics.plant.parameters import FULL_LAYOUT
from shake_ros.physics.plant.simulation import COLUMNS, SMOOTH, run_batch
from shake_ros.quantities import ShakeError, strict_keys, unknown_name
from shake_ros.settings import find, read_yaml
from shake_ros.signals.velocity_filter import filtered_velocity, independent_part, velocity_noise_gain

Array = NDArray[np.float64]
OWN_ERRORS = tuple(
    FULL_LAYOUT.index[f"effects.{name}"]
    for name in (
        "accelerometer_scale.error",
        "accelerometer_bias.bias",
        "accelerometer_lag.time_constant",
        "position_sensor_lag.time_constant",
    )
)
MASSES = "body.table_mass", "body.specimen_mass", "effects.payload_error.mass"
HOLDING = "stiffness_to_ground.stiffness", "constant_force.force"
KEYS = ("signal", "noise")


@dataclass(frozen=True)
class FurtherSensor:
    """A sensor that a table may lack."""

    name: str  # of config/experiment/sensors.yaml
    signal: str  # of SIGNALS
    noise: float  # standard deviation of a sample [unit of the signal]


def further_sensors(name: str = "sensors") -> list[FurtherSensor]:
    """The sensors of config/experiment/<name>.yaml or of a file.

    Raises
    ------
    ShakeError : unknown keys or signals, a noise that is not a positive number.
    """
    path = find("experiment", name)
    found = []
    for sensor, entry in read_yaml(path).items():
        content = strict_keys(entry, KEYS, f"{path}: {sensor}", KEYS, kind="key")
        if content["signal"] not in SIGNALS:
            raise unknown_name("signal", str(content["signal"]), SIGNALS, f"{path}: {sensor}")
        try:
            noise = float(content["noise"])
        except (TypeError, ValueError):
            noise = math.nan
        if not noise > 0.0:
            raise ShakeError(f"{path}: {sensor}: noise: expected a number above 0")
        found.append(FurtherSensor(str(sensor), content["signal"], noise))
    return found


@dataclass(frozen=True)
class TrueMotion:
    """What a model does, apart from errors of the sensors at hand. vector : of it. run : of COLUMNS, shape (n, 7)."""

    vector: Array
    run: Array
    sample_time: float

    def _value(self, name: str) -> float:
        return float(self.vector[FULL_LAYOUT.index[name]])

    @property
    def acceleration(self) -> Array:
        """Absolute, of the table [m/s²]."""
        return self.run[:, COLUMNS.index("acceleration")]

    @property
    def pressures(self) -> Array:
        """Of both chambers [Pa], shape (2, n)."""
        return self.run[:, [COLUMNS.index("pressure_a"), COLUMNS.index("pressure_b")]].T

    @property
    def specimen(self) -> Array:
        """Absolute acceleration of the specimen [m/s²]."""
        if not self._value("effects.specimen_resonance.mass"):
            return self.acceleration
        damped, stiff = self._oscillator("specimen_resonance")
        return self._filtered((damped, stiff), (1.0, damped, stiff), self.acceleration)

    @property
    def force(self) -> Array:
        """Of the rod on the table [N]."""
        swaying = self._value("effects.specimen_resonance.mass")
        rigid = sum(map(self._value, MASSES)) - swaying
        stiffness, steady = (self._value(f"effects.{name}") for name in HOLDING)
        held = stiffness * self.run[:, COLUMNS.index("position")] - steady
        return rigid * self.acceleration + swaying * self.specimen + held

    def base(self, derivatives: int) -> Array:
        """Displacement [m] of the base to the ground, or its first or second derivative."""
        compliance = self._value("effects.base_flexibility.compliance")
        if not compliance:
            return np.zeros(len(self.run))
        damped, stiff = self._oscillator("base_flexibility")
        numerator = (-stiff * compliance, *[0.0] * derivatives)
        return self._filtered(numerator, (1.0, damped, stiff), self.force)

    def _oscillator(self, effect: str) -> tuple[float, float]:
        """2ζω [1/s] and ω² [1/s²]."""
        omega = 2.0 * math.pi * self._value(f"effects.{effect}.frequency")
        return 2.0 * self._value(f"effects.{effect}.damping") * omega, omega**2

    def _filtered(self, numerator: object, denominator: object, values: Array) -> Array:
        """Values behind a transfer function, from rest, straight between the samples."""
        b, a, _ = cont2discrete((numerator, denominator), self.sample_time, method="foh")
        return np.asarray(lfilter(np.ravel(b), a, values))


SIGNALS: Mapping[str, Callable[[TrueMotion], Array]] = {
    "chamber_pressures": lambda m: m.pressures,
    "rod_force": lambda m: m.force,
    "acceleration": lambda m: m.acceleration,
    "specimen_acceleration": lambda m: m.specimen,
    "base_acceleration": lambda m: m.base(2),
    "displacement": lambda m: filtered_velocity(m.run[:, COLUMNS.index("velocity")] + m.base(1), m.sample_time),
}
WITHOUT_UNIT = ("chamber_pressures", "rod_force")  # in the gauge of a table without a data sheet


class WithSensors:
    """The residuals of a recording, and behind them the weighted signals that further sensors would show.

    Only differences between models have a meaning.

    Parameters
    ----------
    problem : of one recording.
    sensors : which.
    vector : of the model found, whose signals set the weights.
    """

    def __init__(self, problem: RecordingProblem, sensors: Sequence[FurtherSensor], vector: Array) -> None:
        self.problem, self.sensors = problem, tuple(sensors)
        (self.record,), self.smooth = problem.records, problem.smooth
        (motion,) = self._motions(vector[None, :])
        self._shown = [self._signal(s, motion) for s in sensors]

    def residuals(self, vectors: Array) -> Array:
        """Of the recording and of every sensor, shape (m, n)."""
        rows = [[self._weighted(i, motion) for i in range(len(self.sensors))] for motion in self._motions(vectors)]
        own = self.problem.residuals(vectors)
        return np.column_stack([own, *(np.array([row[i] for row in rows]) for i in range(len(self.sensors)))])

    def columns(self) -> dict[str, NDArray[np.intp]]:
        """Columns of the residuals that a table with one of the sensors would have, by the sensor's name."""
        first, found = self.problem.count + len(self.problem.model.priors), {}
        own = np.arange(first)
        for sensor, shown in zip(self.sensors, self._shown, strict=True):
            found[sensor.name] = np.concatenate([own, np.arange(first, first + shown.size)])
            first += shown.size
        return found

    def _motions(self, vectors: Array) -> list[TrueMotion]:
        """As FullModel.simulate runs a recording, of models whose own sensors have no errors."""
        record = self.record
        rows = vectors[:, : len(FULL_LAYOUT.names)].copy()
        rows[:, OWN_ERRORS] = 0.0
        runs = run_batch(
            *(rows, FULL.begun(rows, record), record.commands, record.sample_time),
            track=record.track,
            command_before=record.command_before,
            measured=record.beginning,
            columns=tuple(range(len(COLUMNS))),
            tolerance=SMOOTH,
        )
        return [TrueMotion(v, run, record.sample_time) for v, run in zip(rows, runs, strict=True)]

    def _signal(self, sensor: FurtherSensor, motion: TrueMotion) -> Array:
        """What is compared of a signal, shape (k, n)."""
        return np.atleast_2d(SIGNALS[sensor.signal](motion))[:, self.record.start :]

    def _weighted(self, number: int, motion: TrueMotion) -> Array:
        """A sensor's signal over its noise, less what an unknown offset and an unknown scale can take, shape (k n,)."""
        sensor, dt, parts = self.sensors[number], self.record.sample_time, []
        displaced = sensor.signal == "displacement"  # compared as its filtered derivative, like the position
        noise = sensor.noise * (velocity_noise_gain(dt) if displaced else 1.0)
        independent = independent_part(dt) if displaced else 1.0
        for values, shown in zip(self._signal(sensor, motion), self._shown[number], strict=True):
            weight = math.sqrt(independent) / math.hypot(noise, MODEL_FLOOR * float(np.std(shown)))
            free = [np.ones(len(shown))]
            if self.problem.model.nuisances and sensor.signal in WITHOUT_UNIT:
                free.append(shown)
            q, _ = np.linalg.qr(np.column_stack(free))
            parts.append(weight * (values - q @ (q.T @ values)))
        return np.concatenate(parts)


def lacking(sensors: Sequence[FurtherSensor], record: Record) -> list[FurtherSensor]:
    """Those of some sensors that the table of a record lacks; of an accelerometer that it has, a second one."""
    found = [s for s in sensors if s.signal != "chamber_pressures" or record.pressure is None]
    if record.acceleration is None:
        return found
    return [replace(s, name=f"second {s.name}") if s.signal == "acceleration" else s for s in found]
