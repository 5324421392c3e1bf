"""The linear table nearest to a response has the gain, frequency and delay of the plant; a late command is moved."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from foreign_run import foreign_run
from numpy.typing import NDArray
from scipy.signal import butter, lsim, sosfilt

from shake_ros.fit.identified import velocity_gain
from shake_ros.fit.nuisances.prepared import prepared
from shake_ros.fit.nuisances.sensor_pair import BaseMode, SensorPair, sensor_pair
from shake_ros.fit.records import Record
from shake_ros.fit.start.data_checks import contradictions
from shake_ros.fit.start.linear_table import DELAY_LEFT, earlier, in_time, lead, linear_table, moved_ahead, response
from shake_ros.fit.start.unknown_model import FirstGuess
from shake_ros.quantities import ShakeError
from shake_ros.settings import load_table

RATE, GAIN, HYDRAULIC, DAMPING = 500.0, 0.6, 15.0, 0.12
SHARE, FREQUENCY, SPECIMEN_DAMPING = 0.3, 5.0, 0.04
BASE, SLOW = BaseMode(compliance_mass=1.4e-6, frequency=20.0, damping=0.05), 0.003  # and lag of the accelerometer [s]


def matrices(share: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """State space of oil column, rigid mass and specimen: states p, v, x, deflection, its rate; input the command."""
    omega, omega_s = 2.0 * math.pi * HYDRAULIC, 2.0 * math.pi * FREQUENCY
    pull = np.array([0.0, 0.0, 0.0, omega_s**2, 2.0 * SPECIMEN_DAMPING * omega_s])  # of the specimen, per its mass
    acceleration = (np.array([1.0, 0.0, 0.0, 0.0, 0.0]) + share * pull) / (1.0 - share)
    a = np.array(
        [
            [-2.0 * DAMPING * omega, -(omega**2), 0.0, 0.0, 0.0],
            acceleration,
            [0.0, 1.0, 0.0, 0.0, 0.0],
            [0.0, 0.0, 0.0, 0.0, 1.0],
            -acceleration - pull,
        ]
    )
    return a, np.array([[GAIN * omega**2], [0.0], [0.0], [0.0], [0.0]])


def record(share: float, seed: int) -> Record:
    """24 s under band-limited noise, with a transducer's noise."""
    rng = np.random.default_rng(seed)
    n = round(24.0 * RATE)
    command = 0.1 * sosfilt(butter(2, [0.8, 22.0], "bandpass", fs=RATE, output="sos"), rng.standard_normal(n))
    a, b = matrices(share)
    system = (a, b, np.eye(5)[2:3], np.zeros((1, 1)))
    _, position, _ = lsim(system, command, np.arange(n) / RATE, interp=False)
    return Record(f"run{seed}", 1.0 / RATE, command, np.ravel(position) + 2e-6 * rng.standard_normal(n))


def test_a_specimen_shows_in_the_response() -> None:
    found = linear_table([record(SHARE, 1), record(SHARE, 2)])
    assert found.specimen is not None
    assert found.specimen.frequency == pytest.approx(FREQUENCY, rel=0.05)  # lines are 0.25 Hz apart
    assert found.specimen.share == pytest.approx(SHARE, rel=0.15)
    assert found.omega == pytest.approx(2.0 * math.pi * HYDRAULIC, rel=0.05)
    assert found.gain == pytest.approx(GAIN, rel=0.05)


def test_none_shows_where_none_is() -> None:
    found = linear_table([record(0.0, 3), record(0.0, 4)])
    assert found.specimen is None
    assert found.omega == pytest.approx(2.0 * math.pi * HYDRAULIC, rel=0.03)
    assert found.damping == pytest.approx(DAMPING, abs=0.03)


def behind_slow_transducer(lag: float) -> list[Record]:
    """Recordings of a table without a specimen whose position transducer lags [s]."""
    slow = list[Record]()
    for seed in (3, 4):
        prompt = record(0.0, seed)
        time = prompt.sample_time * np.arange(len(prompt.position))
        _, shown, _ = lsim(([1.0], [lag, 1.0]), prompt.position, time)
        slow.append(replace(prompt, position=shown))
    return slow


def test_slow_position_transducer_contradicts_no_declared_gain() -> None:
    lag, table = 0.12, load_table("bergamo")
    slow, flow = behind_slow_transducer(lag), "valve.flow_coefficient"
    right = table.with_values({flow: table.value(flow) * GAIN / velocity_gain(table)})
    unknown = ("bulk_modulus.modulus",)  # its hydraulic frequency is another
    assert contradictions(right, slow, unknown, SensorPair(position_lag=lag)) == []
    (line,) = contradictions(right, slow, unknown)  # what the lag would be taken for
    assert line.startswith("velocity per command: declared 0.6 m/s")


def test_slow_position_transducer_is_no_part_of_it() -> None:
    lag = 0.06
    slow = behind_slow_transducer(lag)
    found = FirstGuess(slow, SensorPair(position_lag=lag)).linear
    assert found.specimen is None
    assert found.omega == pytest.approx(2.0 * math.pi * HYDRAULIC, rel=0.05)
    assert found.gain == pytest.approx(GAIN, rel=0.05)
    assert linear_table(slow).gain < 0.8 * GAIN  # what the lag would be taken for


def test_response_is_that_of_the_state_space() -> None:
    omega = 2.0 * math.pi * np.array([1.0, 4.5, 5.2, 9.0, 14.0])
    a, b = matrices(SHARE)
    exact = [np.linalg.solve(1j * w * np.eye(5) - a, b)[1, 0] for w in omega]
    numbers = np.array(
        [GAIN, 0.0, 2 * math.pi * HYDRAULIC, DAMPING, 0.0, SHARE, 2 * math.pi * FREQUENCY, SPECIMEN_DAMPING]
    )
    assert response(numbers, omega) == pytest.approx(np.array(exact), rel=1e-9)


def on_base(seed: int) -> Record:
    """24 s of a rigid mass whose base gives way, with a slow accelerometer, under band-limited noise.

    States: what the oil column pushes with per mass, velocity and position to the base, position and velocity of that.
    """
    omega, omega_b = 2.0 * math.pi * HYDRAULIC, 2.0 * math.pi * BASE.frequency
    push = np.array([1.0, 0.0, 0.0, 0.0, 0.0])
    recoil = -(omega_b**2) * np.array([BASE.compliance_mass, 0.0, 0.0, 1.0, 2.0 * BASE.damping / omega_b])
    a = np.array([-2.0 * DAMPING * omega * push, push - recoil, np.zeros(5), np.zeros(5), recoil])
    a[0, 1], a[2, 1], a[3, 4] = -(omega**2), 1.0, 1.0
    rng = np.random.default_rng(seed)
    time = np.arange(round(24.0 * RATE)) / RATE
    noise = rng.standard_normal((3, len(time)))
    command = 0.1 * sosfilt(butter(2, [0.8, 30.0], "bandpass", fs=RATE, output="sos"), noise[0])
    system = (a, GAIN * omega**2 * push[:, None], np.eye(5)[[0, 2]], np.zeros((2, 1)))
    _, out, _ = lsim(system, command, time, interp=False)
    _, felt, _ = lsim(([1.0], [SLOW, 1.0]), out[:, 0], time)
    return Record(f"run{seed}", 1.0 / RATE, command, out[:, 1] + 2e-6 * noise[1], felt + 0.01 * noise[2])


def test_a_base_that_gives_way_is_no_specimen_though_its_accelerometer_is_slow() -> None:
    records = [on_base(6), on_base(7)]
    sensors = sensor_pair(records)
    assert sensors.lag == pytest.approx(SLOW, rel=0.1)
    assert sensors.base is not None
    assert sensors.base.frequency == pytest.approx(BASE.frequency, rel=0.01)
    assert sensors.base.compliance_mass == pytest.approx(BASE.compliance_mass, rel=0.1)
    found = linear_table(records, sensors)
    assert found.specimen is None
    assert found.omega == pytest.approx(2.0 * math.pi * HYDRAULIC, rel=0.05)
    taken_for = linear_table(records, SensorPair(lag=sensors.lag)).specimen
    assert taken_for is not None and taken_for.frequency == pytest.approx(BASE.frequency, rel=0.1)


def test_a_turned_sign_is_said() -> None:
    good = record(0.0, 5)
    with pytest.raises(ShakeError, match="run5: the velocity goes against the command"):
        linear_table([Record("run5", good.sample_time, -good.commands, good.position)])


LATE = 6  # samples of 2 ms


def late(record: Record, samples: int) -> Record:
    commands = np.concatenate([np.zeros(samples), record.commands[:-samples]])
    return Record(record.name, record.sample_time, commands, record.position, record.acceleration)


@pytest.mark.parametrize("seed", [425, 422])
def test_lead_is_seen_to_a_fraction_of_a_sample(seed: int) -> None:
    before, after = lead([late(foreign_run(seed), LATE)]), lead([late(foreign_run(seed), LATE + 3)])
    assert before > 0.0
    assert after == pytest.approx(before + 0.006, abs=2e-4)


def test_late_command_is_moved_to_where_a_delay_is_left() -> None:
    recorded = late(foreign_run(422), LATE)
    data = in_time(prepared([recorded], [recorded]))
    assert DELAY_LEFT <= data.ahead - lead([recorded]) < DELAY_LEFT + 0.002
    assert lead(data.estimation) == 0.0
    assert data.ahead > 0.002 * LATE
    assert len(data.validation[0].commands) == len(foreign_run(422).commands) - round(data.ahead / 0.002)
    assert "moves before its recorded command" in data.promptness()


def test_command_is_left_alone_where_damping_explains_the_response_as_well_as_a_lead() -> None:
    time = np.arange(0.0, 30.0, 0.005)
    command = sum(0.1 * np.sin(2.0 * np.pi * f * time + f**2) for f in np.arange(0.75, 5.0, 0.5))  # far below 50 Hz
    velocity = np.convolve(command, np.full(4, 0.25))[: len(time)]
    noise = np.random.default_rng(1).normal(0.0, 1e-5, len(time))
    record = Record("slow", 0.005, command, np.cumsum(velocity) * 0.005 + noise, None)
    assert lead([record]) == 0.0


def test_command_and_accelerometer_that_are_late_alike_are_called_an_early_position() -> None:
    data = prepared([foreign_run(422)], [])
    late = [replace(r, delay=0.0087) for r in data.estimation]
    data = moved_ahead(replace(data, estimation=late), 0.0087)
    (change,) = [c for c in data.changes() if "ms" in c]
    assert change == "position earlier than command and accelerometer by 8.70 ms; both were moved to it"


def test_command_in_time_stays() -> None:
    data = prepared([foreign_run(425)], [])
    assert in_time(data) is data
    assert data.promptness() == ""


def test_earlier_by_whole_samples_is_the_command_to_the_bit() -> None:
    record = foreign_run(425)
    moved = earlier(record, 0.004)
    assert np.array_equal(moved.commands, record.commands[2:])
    assert moved.command_before == record.commands[1]
    assert np.array_equal(moved.position, record.position[:-2])
