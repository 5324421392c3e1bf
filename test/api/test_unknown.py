"""A table without a data sheet: recordings in volts with offsets of their own give its full physics."""

from __future__ import annotations

from functools import cache
from math import pi, sqrt
from pathlib import Path

import numpy as np
import pytest
import yaml
from hidden_table import ACCELERATION_NOISE, OWN, SAMPLE_TIME, Hidden, constants, record
from scipy.signal import lfilter

import shake_ros as sr
from shake_ros.api.identify import Identification
from shake_ros.control.laws import CONTROLLERS
from shake_ros.control.laws.runner import Controller
from shake_ros.control.observer import OBSERVERS
from shake_ros.control.observer.runner import Observer
from shake_ros.declared import unknown_model
from shake_ros.fit.nuisances.prepared import Prepared, null_shift, prepared
from shake_ros.fit.nuisances.sensor_pair import advanced, sensor_pair
from shake_ros.fit.records import Record
from shake_ros.quantities import ShakeError
from shake_ros.settings import load_table, load_variant

VOLTS = 10.0
SHIFTS = {"first": 0.004, "second": -0.006, "held": 0.001}  # of the valve's null [-]
BIASES = {"first": 0.05, "second": -0.1, "held": 0.02}  # of the accelerometer [m/s²]
LATE = 0.0025  # anti-aliasing filter of the accelerometer [s]
TABLE = constants(**OWN)


def laboratory(name: str, seed: int, seconds: float = 4.0) -> sr.Recordings:
    """A recording as a laboratory has it: volts, null shift, bias, a late accelerometer."""
    made = record(seed, seconds, Hidden(null_shift=SHIFTS[name]))
    acceleration = advanced(made.acceleration, -LATE / SAMPLE_TIME) + BIASES[name]
    time = np.arange(len(made.commands)) * SAMPLE_TIME
    return sr.recording(name, time, VOLTS * made.commands, made.position, acceleration=acceleration)


@cache
def fitted() -> Identification:
    runs = laboratory("first", 1) + laboratory("second", 2)
    return sr.identify(sr.model("unknown"), runs, laboratory("held", 3), progress=False)


def told(name: str) -> tuple[float, float]:
    (found,) = [e for e in fitted().identified_estimates if e.name == name]
    assert found.std_error is not None
    return found.value, found.std_error


def test_free_run_of_what_was_found_explains_a_validation_recording() -> None:
    error = fitted().fit.validation["held"]
    assert error["velocity"] < 0.01
    assert error["acceleration"] < 0.05


@pytest.mark.parametrize(
    ("quantity", "true", "within"),
    [
        ("velocity_gain", TABLE.flow * sqrt(0.5 * (TABLE.supply - TABLE.tank)) / TABLE.area, 0.02),
        (
            "hydraulic_frequency",
            sqrt(2.0 * TABLE.modulus / (TABLE.half_volume * TABLE.mass)) * TABLE.area / (2.0 * pi),
            0.02,
        ),
        ("saturation_acceleration", (TABLE.supply - TABLE.tank) * TABLE.area / TABLE.mass, 0.05),
        ("breakaway_friction_per_mass", (TABLE.coulomb + TABLE.rise) / TABLE.mass, 0.1),
    ],
)
def test_quantity_without_gauge_is_found(quantity: str, true: float, within: float) -> None:
    value, error = told(quantity)
    assert value == pytest.approx(true, rel=within)
    assert error < within * true


def test_offsets_of_each_recording_are_found_and_are_no_effects() -> None:
    found = {n.recording: n for n in fitted().data.nuisances}
    common = fitted().table.value("effects.valve_null_shift.offset")
    for name, shift in SHIFTS.items():
        assert found[name].null_shift + common == pytest.approx(shift, abs=1e-3)
        assert found[name].acceleration_bias == pytest.approx(BIASES[name], abs=0.01)
    assert fitted().data.full_scale == VOLTS
    assert fitted().data.sensors.delay == pytest.approx(LATE, abs=2e-4)


def test_table_that_was_found_loads_like_any_other(tmp_path: Path) -> None:
    out = fitted().report(tmp_path / "out")
    table = load_table(str(out / "table.yaml"))
    assert "A valve command of 1 is 10 of the recorded unit" in (out / "table.yaml").read_text(encoding="utf-8")
    Observer(*load_variant("observer", "model", OBSERVERS), 0.001, table)
    Controller(*load_variant("controller", "super_twisting_model", CONTROLLERS), 0.001, table)
    run = sr.simulate(table, 0.1 * np.sin(2.0 * pi * np.arange(1000) / 1000.0))
    assert np.all(np.isfinite(run.recording.acceleration))


def test_lag_of_a_slow_accelerometer_is_distinguished_from_its_filter() -> None:
    made = record(4, 5.0)
    slow, weight = np.zeros(len(made.acceleration)), SAMPLE_TIME / (0.006 + SAMPLE_TIME)
    for k in range(1, len(slow)):
        slow[k] = slow[k - 1] + weight * (made.acceleration[k] - slow[k - 1])
    late = advanced(slow, -LATE / SAMPLE_TIME)
    found = sensor_pair([Record("slow", SAMPLE_TIME, made.commands, made.position, late)])
    assert found.lag == pytest.approx(0.006, rel=0.15)
    assert found.delay == pytest.approx(LATE, abs=8e-4)
    assert found.base is None


def test_command_per_unit_keeps_its_scale() -> None:
    made = record(5, 4.0, Hidden(null_shift=0.01))
    data = prepared([Record("plain", SAMPLE_TIME, made.commands, made.position, made.acceleration)], [])
    assert data.full_scale == 1.0
    assert data.note() == ""
    assert null_shift(data.estimation[0]) == pytest.approx(0.0, abs=2e-5)


@pytest.mark.parametrize(
    ("scale", "zero", "said"),
    [(8.0, 12.0, r"4 to 20 mA, whose zero is 12 mA\? .*COL\*0.125-1.5"), (5.0, 7.0, r"stands still at about 7\.0")],
)
def test_command_whose_zero_is_not_that_of_the_valve_is_refused(scale: float, zero: float, said: str) -> None:
    made = record(5, 4.0)
    commands = zero + scale * made.commands / np.max(np.abs(made.commands))
    with pytest.raises(ShakeError, match=said):
        prepared([Record("live", SAMPLE_TIME, commands, made.position, made.acceleration)], [])


def test_recording_at_ten_kilohertz_is_thinned_to_one() -> None:
    time = np.arange(20000) / 1e4
    x, u = 1e-3 * np.sin(10.0 * pi * time), np.round(np.sin(6.0 * pi * time), 2)
    (found,) = prepared([Record("fast", 1e-4, u, x, np.gradient(np.gradient(x, 1e-4), 1e-4))], []).estimation
    assert found.sample_time == pytest.approx(1e-3)
    assert np.max(np.abs(found.position - x[::10])) < 1e-5
    assert len(found.commands) == 2000


def test_bias_that_wanders_is_removed_and_reported() -> None:
    made = record(6, 8.0)
    at = np.arange(len(made.commands)) / len(made.commands)
    wander = 0.3 * np.sin(2.0 * at)

    def seen(bias: np.ndarray | float) -> Prepared:
        return prepared([Record("it", SAMPLE_TIME, made.commands, made.position, made.acceleration + bias)], [])

    still, moved = seen(0.1), seen(0.1 + wander)
    assert (still.nuisances[0].drift, still.drifts()) == (0.0, "")
    assert moved.nuisances[0].drift == pytest.approx(0.3, abs=0.02)
    assert moved.drifts() == f"drift of the accelerometer's bias removed [m/s²]: it {moved.nuisances[0].drift:.3g}"
    left = moved.estimation[0].acceleration - still.estimation[0].acceleration
    assert np.std(left) < 0.05 * np.std(wander)


@pytest.mark.parametrize(("slow", "lag"), [("position", 0.09), ("acceleration", 0.02)])
def test_lag_of_a_sensor_is_no_wandering_bias(slow: str, lag: float) -> None:
    made, gain, rng = record(6, 8.0, noisy=False), SAMPLE_TIME / lag, np.random.default_rng(1)
    signals = {"position": made.position, "acceleration": made.acceleration}
    signals[slow] = lfilter([gain], [1.0, gain - 1.0], signals[slow])
    signals["acceleration"] = signals["acceleration"] + ACCELERATION_NOISE * rng.standard_normal(len(made.commands))
    assert prepared([Record("it", SAMPLE_TIME, made.commands, **signals)], []).drifts() == ""


def test_recordings_without_acceleration_have_no_bias_and_no_delay() -> None:
    made = record(6, 3.0)
    data = prepared([Record("blind", SAMPLE_TIME, made.commands, made.position)], [])
    assert data.nuisances[0].acceleration_bias is None
    assert (data.sensors.delay, data.sensors.lag) == (0.0, 0.0)


def written(tmp_path: Path, **changes: object) -> str:
    """A configuration with some sections' entries changed, as `section__name`."""
    content = yaml.safe_load((Path(__file__).parents[2] / "config/table/unknown.yaml").read_text(encoding="utf-8"))
    for key, value in changes.items():
        section, _, name = key.partition("__")
        content[section][name] = value
    path = tmp_path / "known.yaml"
    path.write_text(yaml.safe_dump(content), encoding="utf-8")
    return str(path)


def test_number_with_a_deviation_is_a_prior_and_an_exact_one_stays(tmp_path: Path) -> None:
    model = unknown_model(written(tmp_path, body__table_mass={"value": 500.0, "sd": 25.0}, leakage__internal=1e-12))
    (prior,) = model.priors
    assert prior[1:] == (500.0, 25.0)
    assert model.may_move("body.table_mass")
    assert not model.may_move("leakage.internal")
    assert model.may_move("valve.damping")


def test_file_that_leaves_numbers_open_makes_the_full_model_the_unknown_one(tmp_path: Path) -> None:
    assert sr.model("full", written(tmp_path)).kind == "unknown"
    assert sr.model("full", "bergamo").kind == "full"


def test_stroke_is_known_only_where_it_is_declared(tmp_path: Path) -> None:
    assert sr.model("unknown").stroke is None
    assert sr.model("unknown", written(tmp_path, body__stroke=0.3)).stroke == 0.3
    assert sr.model("unknown", set={"stroke": 0.3}).stroke == 0.3


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"body__end_stop_stiffness": "unknown"}, "body.end_stop_stiffness: recordings do not determine it"),
        ({"body__table_mass": {"value": 500.0, "sd": 0.0}}, "sd = 0: expected a number above 0"),
        ({"body__table_mass": {"value": 500.0, "sd": "much"}}, "sd: expected a number"),
    ],
)
def test_what_no_recording_tells_is_refused_in_a_line(changes: dict[str, object], said: str, tmp_path: Path) -> None:
    with pytest.raises(ShakeError, match=said):
        unknown_model(written(tmp_path, **changes))
