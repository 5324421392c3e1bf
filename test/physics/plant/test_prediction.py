"""The table corrected towards its sensors: the free run without gains, a calibrated filter with its own."""

from __future__ import annotations

import numpy as np
import pytest
from hidden_table import OWN, SAMPLE_TIME, TRUE, record
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from shake_ros.fit.likelihood import Levels
from shake_ros.fit.model import TABLE, FreeModel, start_of
from shake_ros.fit.prediction import Predictor, start_state
from shake_ros.fit.records import Record
from shake_ros.fit.segment import Segment
from shake_ros.physics.plant.simulation import run
from shake_ros.settings import load_table

QUIET = Levels(force=1e-3, null_drift=1e-7, bias=1e-6, bias_drift=1e-7)


def segment(seed: int = 1, **own: float) -> Segment:
    made = record(seed, 3.0, **own)
    return Segment.of(Record("run", SAMPLE_TIME, made.commands, made.position, made.acceleration))


def true_model(**changed: float) -> FreeModel:
    values = TRUE | {"body.specimen_mass": 200.0, "friction.transition_velocity": OWN["sharp"]} | changed
    return start_of(load_table("bergamo").with_values(values), ())


def test_predictor_without_gains_is_the_free_run() -> None:
    model, piece = true_model(), segment()
    vector = model.vectors(model.x)[0]
    prediction = Predictor([piece], QUIET).filtered(vector)
    (made,) = prediction.runs
    made.gains[:] = 0.0
    made.whitening[:] = np.eye(2)
    left = prediction.residuals(vector[None, :])[0].reshape(-1, 2)
    free = run(model.table, piece.commands, piece.dt, state=start_state(vector[:TABLE], piece), tolerance=1e-6)
    start = piece.start
    assert left[:, 0] == pytest.approx(piece.position[start:] - free[start:, 0], abs=1e-6)
    assert left[:, 1] == pytest.approx(piece.acceleration[start:] - free[start:, 2], abs=0.03)


def test_innovations_of_the_true_table_are_white_and_as_large_as_the_filter_expects() -> None:
    model, piece = true_model(), segment()
    vector = model.vectors(model.x)[0]
    prediction = Predictor([piece], QUIET).filtered(vector)
    white = prediction.residuals(vector[None, :])[0].reshape(-1, 2)
    assert np.mean(white[:, 1] ** 2) == pytest.approx(1.0, abs=0.15)
    assert np.mean(white[:, 0] ** 2) < 1.1  # the transducer's linearity is counted as noise beside its own
    for channel in white.T:
        assert abs(np.mean(channel[1:] * channel[:-1])) < 0.1 * np.mean(channel**2) + 0.02


@pytest.mark.parametrize("lag", [0.002, 0.08])
def test_innovations_behind_a_slow_transducer_are_white_from_the_midst_of_a_motion(lag: float) -> None:
    made, rng = record(1, 5.0, noisy=False), np.random.default_rng(7)
    time, felt = np.arange(len(made.position)) * SAMPLE_TIME, made.acceleration
    path = CubicSpline(time, made.position)
    shown = solve_ivp(
        lambda t, q: (path(t) - q) / lag, time[[0, -1]], path(0.0)[None], t_eval=time, rtol=1e-9, atol=1e-12
    )
    position = shown.y[0] + 1e-5 * rng.standard_normal(len(time))
    whole = Record("run", SAMPLE_TIME, made.commands, position, felt + 0.05 * rng.standard_normal(len(time)))
    begin = 500 + int(np.argmax(np.abs(felt[500:2000])))
    piece = Segment.of(whole.part(slice(begin, begin + 3000)))
    model = true_model(**{"effects.position_sensor_lag.time_constant": lag})
    vector = model.vectors(model.x)[0]
    white = Predictor([piece], QUIET).filtered(vector).residuals(vector[None, :])[0].reshape(-1, 2)
    assert np.mean(white[:, 1] ** 2) == pytest.approx(1.0, abs=0.3)
    assert np.mean(white[:, 0] ** 2) < 1.1
    for channel in white.T:
        assert abs(np.mean(channel[1:] * channel[:-1])) < 0.1 * np.mean(channel**2) + 0.02


def test_residuals_under_the_gains_of_the_filter_are_its_own_innovations() -> None:
    model, piece = true_model(**{"friction.viscous": 900.0}), segment()
    vector = model.vectors(model.x)[0]
    prediction = Predictor([piece], Levels(force=0.3)).filtered(vector)
    (made,) = prediction.runs
    w, e = made.whitening[piece.start :], made.innovations[piece.start :]
    own = np.einsum("ncd,nd->nc", w, e)
    left = prediction.residuals(vector[None, :])[0].reshape(-1, 2)
    assert np.sqrt(np.mean((left - own) ** 2)) < 0.1  # of the noise: the filter integrates less finely


def test_likelihood_at_other_levels_is_foreseen_from_the_derivatives() -> None:
    model, piece = true_model(**{"friction.viscous": 900.0}), segment()
    vector = model.vectors(model.x)[0]
    prediction = Predictor([piece], Levels(force=0.3, bias=1e-6)).filtered(vector)
    for levels in (prediction.levels, Levels(force=0.6, bias=1e-6), Levels(0.5 + 1.0, 2.0, 0.3, 0.05)):
        own = float(np.sum(prediction.with_levels(levels).filtered(vector).log_likelihood()))
        assert prediction.relevelled(vector, levels) == pytest.approx(own, rel=5e-3)


def test_random_force_follows_a_force_that_no_command_determines() -> None:
    model, piece = true_model(), segment()
    vector = model.vectors(model.x)[0]
    quiet = Predictor([piece], QUIET).filtered(vector)
    pushed = true_model(**{"effects.constant_force.force": 650.0})
    other = pushed.vectors(pushed.x)[0]
    loud = Predictor([piece], Levels(force=0.5, memory=0.1, bias=1e-6)).filtered(other)
    (made,) = loud.runs
    force = made.path[piece.start :, list(made.codes).index(-1)]
    assert float(np.median(force)) == pytest.approx(-1.0, abs=0.35)  # it makes up for 650 N on 650 kg
    assert float(np.sum(quiet.log_likelihood())) > float(np.sum(loud.log_likelihood()))
