"""A model with the table's effect follows better than one without it; the same model twice gives the same twice."""

from __future__ import annotations

import numpy as np

from shake_ros.control.laws import CONTROLLERS
from shake_ros.control.laws.runner import Controller
from shake_ros.control.observer import OBSERVERS
from shake_ros.control.observer.runner import Observer
from shake_ros.control.trials import benefit
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.settings import load_table, load_variant

SAMPLE_TIME = 0.001
DECLARED = load_table("bergamo")
DEAD_BAND = DECLARED.with_values({"effects.spool_deadband.width": 0.03})


def loops(model: TableParameters) -> tuple[Observer, Controller]:
    observer, observer_parameters = load_variant("observer", "model", OBSERVERS)
    law, law_parameters = load_variant("controller", "super_twisting_tuned", CONTROLLERS)
    return (
        Observer(observer, observer_parameters, SAMPLE_TIME, model),
        Controller(law, law_parameters, SAMPLE_TIME, model),
    )


def sine(seconds: float) -> np.ndarray:
    """10 mm at 2 Hz that starts from rest."""
    t = np.arange(0.0, seconds, SAMPLE_TIME)
    w, rise = 4.0 * np.pi, np.minimum(t, 1.0) ** 2
    x = 0.01 * rise * np.sin(w * t)
    v = np.gradient(x, SAMPLE_TIME)
    return np.column_stack([x, v, np.gradient(v, SAMPLE_TIME)])


def test_model_with_the_dead_band_of_the_table_follows_better_than_one_without() -> None:
    found = benefit(DEAD_BAND, DECLARED, DEAD_BAND, loops, sine(2.5), "sine", delay=1).errors()
    assert found["after"]["position"] < 0.5 * found["before"]["position"]
    assert found["after"]["acceleration"] < 0.5 * found["before"]["acceleration"]


def test_loop_that_rings_under_the_extended_model_is_reported_with_the_cure() -> None:
    # 12 ms of dead time and one of the loop, known: the present loop waits for them, at gains made for one
    late = DECLARED.with_values({"effects.command_delay.delay": 0.012})
    model = DECLARED.with_values({"effects.command_delay.delay": 0.013})
    found = benefit(late, DECLARED, model, loops, sine(1.5), "sine", delay=1, neighbours=[late], seconds=1.5)
    assert found.ringing["after"] > 1.0
    (warning,) = found.warnings()
    assert "rings" in warning
    assert "close_loop --tune" in warning


def test_same_model_before_and_after_gives_the_same_run() -> None:
    found = benefit(DECLARED, DECLARED, DECLARED, loops, sine(0.5), "sine", delay=1)
    np.testing.assert_array_equal(found.before.truth, found.after.truth)
