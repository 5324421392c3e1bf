"""The figures of friction, valve, table and effects draw what they say."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("matplotlib")

from shake_ros.physics.effects import EFFECTS
from shake_ros.physics.valve import VALVES, valve_response
from shake_ros.settings import load_table, load_variant
from shake_ros.thesis import figures, figures_laws


@pytest.mark.parametrize("name", ["curves", "lag", "presliding", "stick_slip"])
def test_friction_figures_have_curves_that_differ(name):
    figure = getattr(figures_laws, name)()
    lines = [line for axes in figure.axes for line in axes.lines]
    assert lines
    assert all(np.all(np.isfinite(line.get_ydata())) and np.ptp(line.get_ydata()) > 0.0 for line in lines)


def test_break_away_figure_falls():
    line = figures_laws.break_away().axes[0].lines[0]
    assert np.all(np.diff(line.get_ydata()) < 0.0)


def test_valve_steps_reach_their_ends_in_both_models():
    lines = figures_laws.steps().axes[0].lines
    ends = [line.get_ydata()[-1] for line in lines]
    assert ends[:5] == pytest.approx([10.0, 25.0, 50.0, 75.0, 100.0], abs=1.0)
    assert ends[5:] == pytest.approx(ends[:5], abs=1.0)


def test_every_effect_of_the_full_model_is_shown_at_a_strength_of_its_own():
    for name in {name for name, e in EFFECTS.items() if "full" in e.models} - {"unlisted"}:
        shown = EFFECTS[name](**figures.strength(name))
        assert shown != EFFECTS[name](), name


@pytest.mark.parametrize("name", ["soft_zone", "spool_deadband", "position_sensor_lag"])
def test_an_effect_changes_what_its_figure_shows(name):
    for frequency in (2.0, 5.0):
        _, before, after = figures.responses(name, frequency)
        assert np.std(after - before) > 0.01 * np.std(before)
    assert len(figures.effect_figure(name).axes) == 4


def test_figure_6_11_is_the_full_step_of_a_valve_of_150_hz() -> None:
    (axes,) = figures_laws.second_order_step().axes
    time, spool = axes.lines[0].get_data()
    assert abs(spool[-1] - 1.0) < 2e-3  # k_v = 1, within the hysteresis of table 6.4
    # (3.19): an overshoot of exp(−π D/√(1 − D²)) = 3.3 % after π/(ω √(1 − D²)) = 2.9 ms, but the spool stops at 1
    assert spool.max() <= 1.0 + 1e-9
    assert 1.0 < time[int(np.argmax(spool >= 0.9))] < 2.9


def test_flow_force_is_odd_without_load_and_the_retuned_spool_reaches_its_command() -> None:
    force, steps = figures_laws.flow_force().axes
    without_load = force.lines[1].get_ydata()
    np.testing.assert_allclose(without_load, -without_load[::-1], atol=1e-9)
    ends = [line.get_ydata()[-1] for line in steps.lines]
    np.testing.assert_allclose(ends[:5], 100.0 * np.array(figures_laws.settings("valve")["steps"]), rtol=0.02)
    jets, spring = (load_variant("valve", name, VALVES)[1] for name in ("detailed_flow_force", "detailed"))
    not_retuned = jets.replace(amplifier_gain=spring.amplifier_gain)
    spool = valve_response(not_retuned, np.full(240, 0.5), 5e-5, 2.06e7, 1e5)
    assert 0.85 < spool[-1] / 0.5 < 0.95  # short of its command


def test_drawn_describing_functions_part_from_the_linear_table_only_where_it_is_none() -> None:
    gain, phase = figures.describing_functions().axes
    linear, *sines = gain.lines
    at_low = [line.get_ydata()[0] for line in sines]
    assert at_low[1] == pytest.approx(linear.get_ydata()[0], rel=0.06)  # 10 %, 1 Hz: the velocity gain
    peaks = [float(np.max(line.get_ydata())) for line in sines]
    assert peaks[0] > 1.2 * peaks[-1]  # a larger amplitude damps the oil column more
    assert all(np.all(np.diff(line.get_ydata()) < 30.0) for line in phase.lines)


def test_oil_column_is_softest_in_mid_stroke_and_the_poles_agree() -> None:
    lines = figures.oil_spring().axes[0].lines
    table = load_table("bergamo")
    for closed, poles in zip(lines[::2], lines[1::2], strict=True):
        frequency = closed.get_ydata()
        assert int(np.argmin(frequency)) == len(frequency) // 2
        np.testing.assert_allclose(poles.get_ydata(), frequency, rtol=0.03)  # a moving table opens its chambers
        assert poles.get_ydata()[len(frequency) // 2] == pytest.approx(min(frequency), rel=5e-3)
    b, modulus = table.body, table.value("bulk_modulus.modulus")
    middle = np.sqrt(4.0 * modulus * b.piston_area**2 / (b.cylinder_volume * 650.0)) / (2.0 * np.pi)
    assert lines[2].get_ydata()[len(lines[2].get_ydata()) // 2] == pytest.approx(middle, rel=1e-3)
