"""Followed values for the loop: bounded, slewed, reversible, unmoved by scatter; gains and β with the table."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.twin import release as benchmark
from shake_ros.control.laws import CONTROLLERS
from shake_ros.control.observer import OBSERVERS
from shake_ros.physics.plant.parameters import DELAY
from shake_ros.physics.plant.reduced import closed_form
from shake_ros.settings import load_table, load_variant
from shake_ros.twin.followed import load_twin
from shake_ros.twin.release import CLEAR, Release, for_table
from shake_ros.twin.twin import NO_MOTION, Twin, TwinWindow

FLOW, NULL = "valve.flow_coefficient", "effects.valve_null_shift.offset"
FILE = load_table("bergamo")
FACTOR, TIME = 1.5, 2.0


def made() -> tuple[Twin, Release]:
    twin = Twin(FILE, load_twin(), 1e-3)
    return twin, Release(twin, FACTOR, TIME)


def window(twin: Twin, values: dict[str, float], deviation: float = 0.01) -> TwinWindow:
    """What a window shows: values by name, others as in the file; deviation in their units."""
    shown = np.array([values.get(n, FILE.value(n) if n in FILE.fields else 0.0) for n in twin.names])
    spread = deviation * twin.scale
    return TwinWindow("", 0.0, 0, 1, "watching", "", shown, spread, spread, 1.0, NO_MOTION)


def test_a_value_goes_to_the_loop_with_the_time_constant_and_back_to_the_file() -> None:
    twin, release = made()
    flow = FILE.value(FLOW)
    assert release.know(window(twin, {FLOW: 0.8 * flow})) == (FLOW,)
    assert release.changes == {}
    assert release.step(TIME, on=True)
    assert release.changes == {FLOW: pytest.approx(flow * (0.8 + 0.2 / math.e))}
    while release.step(TIME, on=True):
        pass
    assert release.changes == {FLOW: 0.8 * flow}
    assert release.step(TIME, on=False)
    assert release.changes[FLOW] == pytest.approx(flow * (1.0 - 0.2 / math.e))
    while release.step(TIME, on=False):
        pass
    assert release.changes == {}


def test_values_stay_within_the_factor_of_the_file_and_one_that_is_zero_within_its_scale() -> None:
    twin, release = made()
    release.know(window(twin, {FLOW: 0.3 * FILE.value(FLOW), NULL: -1.0}))
    while release.step(TIME, on=True):
        pass
    scale = float(twin.scale[twin.names.index(NULL)])
    assert release.changes == {FLOW: FILE.value(FLOW) / FACTOR, NULL: pytest.approx(-(FACTOR - 1.0) * scale)}
    assert "(its bound)" in release.text((FLOW,))


def test_what_scatters_moves_nothing() -> None:
    twin, release = made()
    assert release.know(window(twin, {FLOW: 0.975 * FILE.value(FLOW)})) == ()
    assert release.know(window(twin, {FLOW: (1.0 - 1.1 * CLEAR * 0.01) * FILE.value(FLOW)})) == (FLOW,)


def test_the_dead_time_on_which_observer_and_controller_agree_is_not_released() -> None:
    twin, release = made()
    assert DELAY in twin.names
    assert DELAY not in release.names


@pytest.mark.parametrize("controller", ["three_variable_tuned", "feedforward_pi_tuned", "super_twisting_tuned"])
def test_gains_keep_the_velocity_that_an_error_commands(controller: str) -> None:
    now = FILE.with_values({FLOW: 0.8 * FILE.value(FLOW)})
    _, law = load_variant("controller", controller, CONTROLLERS)
    changed = for_table(law, FILE, now)
    beta, after = closed_form(FILE).beta, closed_form(now).beta
    ratio = (after.beta3 / after.beta1) / (beta.beta3 / beta.beta1)
    assert ratio == pytest.approx(0.8, abs=0.005)
    gains = [n for n in changed if n != "beta3"]
    assert gains and "limit" not in changed and "reaching_slope" not in changed
    for name in gains:
        assert changed[name] * ratio == pytest.approx(getattr(law, name))
    if "beta3" in changed:
        assert changed["beta3"] / law.beta3 == pytest.approx(after.beta3 / beta.beta3)


def test_the_numbers_of_an_observer_stay_where_the_table_is_as_it_was() -> None:
    _, observer = load_variant("observer", "fused_accelerometer", OBSERVERS)
    assert for_table(observer, FILE, FILE) == {n: getattr(observer, n) for n in for_table(observer, FILE, FILE)}
    assert set(for_table(observer, FILE, FILE)) == {"beta1", "beta2", "beta3", "beta4", "beta5"}


@pytest.mark.second_tier
def test_a_loop_whose_valve_gives_less_flow_tracks_again_once_it_is_released() -> None:
    settings = load_twin()
    settings = replace(settings, test=settings.test.replace(naming=4.0))
    case = benchmark.LOOPS["three variables with a model, fused observer"], {FLOW: 0.8}, settings
    before, faulty = (e for k, (e, _) in enumerate(benchmark.motions(*case, released=False)) if k in (2, 6))
    *_, (after, release) = benchmark.motions(*case, released=True)
    assert faulty > 5.0 * before
    assert after < 0.5 * faulty
    assert release.changes[FLOW] < 0.95 * FILE.value(FLOW)
