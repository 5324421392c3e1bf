"""Signals of further sensors, against the states of a simulation that has them."""

import numpy as np
import pytest

import shake_ros as sr
from shake_ros.experiment_design.further_sensors import SIGNALS, WithSensors
from shake_ros.fit.recording_problem import RecordingProblem
from shake_ros.fit.records import Record
from shake_ros.physics.plant.states import BASE_RATE, POSITION, SPECIMEN_RATE, VELOCITY
from shake_ros.physics.plant.table import Table
from shake_ros.signals.velocity_filter import filtered_velocity

DT, COUNT = 1e-3, 2000
SPECIMEN = {"mass": 80.0, "frequency": 9.0, "damping": 0.05}
BASE = {"compliance": 2e-8, "frequency": 12.0, "damping": 0.05}


def with_effects(**effects):
    values = {f"effects.{name}.{key}": value for name, field in effects.items() for key, value in field.items()}
    return sr.model("full").table.with_values(values)


def stepped(table):
    """Command, states and accelerations of a table, sample by sample."""
    command = 0.05 * np.sin(2.0 * np.pi * 4.0 * DT * np.arange(COUNT))
    plant = Table(table, DT)
    state, states, accelerations = plant.initial_state(), [], []
    for u in command:
        states.append(state)
        accelerations.append(plant.true_acceleration(state))
        state = plant.advance(state, u)
    return command, np.array(states), np.array(accelerations)


def motion_of(table, command, states):
    record = Record("run", DT, command, states[:, POSITION], moved=False)
    return WithSensors(RecordingProblem([record]), (), table.vector())._motions(table.vector()[None, :])[0]


def near(signal, truth):
    return np.sqrt(np.mean((signal - truth)[200:] ** 2)) < 0.02 * np.std(truth[200:])


def test_the_specimen_and_the_rod_are_those_of_the_states():
    table = with_effects(specimen_resonance=SPECIMEN)
    command, states, acceleration = stepped(table)
    motion = motion_of(table, command, states)
    specimen = acceleration + np.gradient(states[:, SPECIMEN_RATE], DT)
    assert near(SIGNALS["specimen_acceleration"](motion), specimen)
    assert near(SIGNALS["rod_force"](motion), (650.0 - 80.0) * acceleration + 80.0 * specimen)


def test_the_base_and_the_way_to_the_ground_are_those_of_the_states():
    table = with_effects(base_flexibility=BASE)
    command, states, _ = stepped(table)
    motion = motion_of(table, command, states)
    assert near(SIGNALS["base_acceleration"](motion), np.gradient(states[:, BASE_RATE], DT))
    assert near(motion.base(1), states[:, BASE_RATE])
    velocity = filtered_velocity(states[:, VELOCITY] + states[:, BASE_RATE], DT)
    assert near(SIGNALS["displacement"](motion), velocity)


@pytest.mark.parametrize(
    "effect", ["accelerometer_scale.error", "accelerometer_bias.bias", "accelerometer_lag.time_constant"]
)
def test_an_error_of_the_own_sensor_is_none_of_a_further_one(effect):
    table = sr.model("full").table
    wrong = table.with_values({f"effects.{effect}": 0.1})
    command, states, acceleration = stepped(table)
    motion = motion_of(wrong, command, states)
    assert near(SIGNALS["acceleration"](motion), acceleration)
