"""Options of the plant beside the effects: cavitation, pipelines, a shear frame as the specimen; stiff cases."""

from __future__ import annotations

import math

import numpy as np
import pytest
import yaml
from scipy.integrate import solve_ivp

from benchmarks.plant import reference_model as reference
from shake_ros.physics.fluid import Oil
from shake_ros.physics.friction import FRICTIONS
from shake_ros.physics.plant.options import chamber_pressure, foot_force, half_line_volume, line_flow_rate, storey_rates
from shake_ros.physics.plant.parameters import FULL_LAYOUT, TableParameters
from shake_ros.physics.plant.simulation import run
from shake_ros.physics.plant.states import CONTINUOUS, STOREY
from shake_ros.physics.plant.temperature import OilState, at_temperature
from shake_ros.physics.valve.ports import opening
from shake_ros.quantities import ShakeError
from shake_ros.settings import find, load_table, load_variant, read_yaml

SAMPLE = 1e-3


@pytest.fixture(scope="module")
def table() -> TableParameters:
    return load_table("bergamo")


def record(**values):
    """Bergamo's table with options, as the kernels take it."""
    options = {name.replace("_", ".", 1): value for name, value in values.items()}
    return FULL_LAYOUT.records(load_table("bergamo").with_values(options).vector())[0]


def nrmse(reference, result):
    return float(np.std(result - reference) / np.std(reference))


def test_an_option_that_is_not_used_does_not_stand_in_the_file(table):
    assert not set(FULL_LAYOUT.optional) & set(table.to_mapping())
    changed = table.with_values({"frame.storeys": 3})
    again = FULL_LAYOUT.table(changed.to_mapping(), "saved")
    assert again.frame.storeys == 3
    np.testing.assert_array_equal(again.vector(), changed.vector())


# --- cavitation -------------------------------------------------------------------------------------------------


def heavy(table, **values):
    """A heavy specimen whose momentum empties a chamber when the valve closes at speed."""
    changed = table.with_values({"body.specimen_mass": 3000.0, **values})
    return run(changed, np.where(np.arange(600) < 150, 1.0, 0.0), SAMPLE)


def test_no_chamber_falls_to_the_limit_or_below(table):
    assert heavy(table)[:, 3:5].min() < 0.0  # without the option the liquid bears tension
    bounded = heavy(table, **{"cavitation.pressure": 2e4, "cavitation.width": 6e4})
    assert np.all(np.isfinite(bounded))
    assert 2e4 <= bounded[:, 3:5].min() < 8e4


def test_above_the_range_nothing_changes(table):
    u = 0.3 * np.sin(2.0 * np.pi * 2.0 * np.arange(500) * SAMPLE)
    with_it = table.with_values({"cavitation.pressure": 2e4, "cavitation.width": 6e4})
    np.testing.assert_array_equal(run(with_it, u, SAMPLE), run(table, u, SAMPLE))


def test_pressure_is_smooth_at_the_range_and_bounded_below():
    limit, width = 2e4, 6e4
    p = record(cavitation_pressure=limit, cavitation_width=width)
    edge = limit + width
    step = 1.0
    slope = (chamber_pressure(p, edge) - chamber_pressure(p, edge - step)) / step
    assert slope == pytest.approx(1.0, abs=1e-4)
    assert chamber_pressure(p, -1e12) == limit


def test_a_void_closes_before_the_pressure_rises_again(table):
    """The oil that is missing has to come back before the chamber carries a pressure again."""
    options = {"cavitation.pressure": 2e4, "cavitation.width": 6e4}
    tight = run(
        table.with_values({"body.specimen_mass": 3000.0, **options}),
        np.where(np.arange(600) < 150, 1.0, 0.0),
        SAMPLE,
        tolerance=1e-9,
    )
    assert nrmse(tight[:, 2], heavy(table, **options)[:, 2]) < 1e-2
    low = np.flatnonzero(tight[:, 3:5].min(axis=1) < 8e4)
    assert len(low) > 5


# --- pipelines --------------------------------------------------------------------------------------------------


def test_a_line_comes_to_rest_where_friction_balances_the_pressures():
    length, d, rho, eta = 2.0, 0.012, 870.0, 0.028
    p = record(pipelines_length=length, pipelines_diameter=d, pipelines_density=rho, pipelines_viscosity=eta)
    area = math.pi * d**2 / 4.0
    slow = 500.0 * eta / (rho * d) * area  # Re = 500
    drop = 128.0 * eta * length * slow / (math.pi * d**4)  # Hagen–Poiseuille
    assert line_flow_rate(p, slow, drop, 0.0) == pytest.approx(0.0, abs=1e-9)
    fast = 8000.0 * eta / (rho * d) * area
    drop = 0.3164 / 8000.0**0.25 * length / d * rho / 2.0 * (fast / area) ** 2  # Blasius
    assert line_flow_rate(p, fast, drop, 0.0) == pytest.approx(0.0, abs=1e-9)
    assert line_flow_rate(p, 0.0, 1e5, 0.0) == pytest.approx(1e5 * area / (rho * length))


def test_a_line_closed_at_one_end_rings_at_its_own_frequency():
    length, d, rho, modulus = 2.0, 0.012, 870.0, 1.16e9
    line = record(pipelines_length=length, pipelines_diameter=d, pipelines_density=rho, pipelines_viscosity=1e-4)
    stiffness = modulus / half_line_volume(line)

    def rates(_t, y):
        return [-stiffness * y[1], line_flow_rate(line, y[1], y[0], 0.0)]

    t = np.linspace(0.0, 0.05, 2001)
    p = solve_ivp(rates, (0.0, 0.05), [1e5, 0.0], t_eval=t, rtol=1e-8, atol=1e-12).y[0]
    crossings = t[1:][np.diff(np.sign(p)) != 0]
    omega = math.pi / np.diff(crossings).mean()
    assert omega == pytest.approx(math.sqrt(2.0 * modulus / rho) / length, rel=0.02)


def test_very_short_pipelines_change_next_to_nothing_and_long_ones_soften_the_table(table):
    u = 0.3 * np.sin(2.0 * np.pi * 5.0 * np.arange(600) * SAMPLE)
    plain = run(table, u, SAMPLE)
    short = run(table.with_values({"pipelines.length": 0.02}), u, SAMPLE)
    long = run(table.with_values({"pipelines.length": 3.0}), u, SAMPLE)
    assert nrmse(plain[:, 1], short[:, 1]) < 0.02
    assert nrmse(plain[:, 2], long[:, 2]) > 5.0 * nrmse(plain[:, 2], short[:, 2])
    assert np.all(np.isfinite(long))


# --- temperature ------------------------------------------------------------------------------------------------


def test_a_warmer_table_is_softer_thinner_and_leaks_more(table):
    oil = Oil.from_mapping(read_yaml(find("fluid", "hlp_32")), "hlp_32").parameters
    warm = at_temperature(table, oil, OilState(333.15, 313.15, 3.8e-3))
    thinner = math.exp(-oil.viscosity_decay * 20.0)  # (2.4)
    assert warm.friction.viscous == pytest.approx(table.friction.viscous * thinner)
    assert warm.leakage.internal == pytest.approx(table.leakage.internal / thinner)
    assert warm.bulk_modulus.modulus == pytest.approx(table.bulk_modulus.modulus * (1.0 - 3.8e-3 * 20.0))
    assert 1.0 < warm.valve.flow_coefficient / table.valve.flow_coefficient < 1.02
    assert at_temperature(table, oil, OilState(313.15, 313.15, 3.8e-3)) == table
    lighter = (1.0 + 0.65e-3 * 25.0) / (1.0 + 0.65e-3 * 45.0)  # (2.18) from 15 °C
    assert warm.valve.flow_coefficient == pytest.approx(table.valve.flow_coefficient / math.sqrt(lighter))
    assert warm.valve.laminar_pressure == pytest.approx(table.valve.laminar_pressure * thinner**2 / lighter)
    piped = table.with_values({"pipelines.length": 2.0})
    thin = at_temperature(piped, oil, OilState(333.15, 313.15, 3.8e-3))
    assert thin.value("pipelines.viscosity") == pytest.approx(0.028 * thinner)
    assert thin.value("pipelines.density") == pytest.approx(870.0 * lighter)


def test_a_tables_file_names_its_oil_and_how_warm_it_is(table, tmp_path):
    fluid = {"oil": "hlp_46", "temperature": 333.15, "reference_temperature": 313.15, "modulus_slope": 3.8e-3}
    path = tmp_path / "warm.yaml"
    path.write_text(yaml.safe_dump(table.to_mapping() | {"fluid": fluid}))
    oil = Oil.from_mapping(read_yaml(find("fluid", "hlp_46")), "hlp_46").parameters
    warm = at_temperature(table, oil, OilState(333.15, 313.15, 3.8e-3))
    assert load_table(str(path)) == warm
    path.write_text(yaml.safe_dump(table.to_mapping() | {"fluid": fluid | {"temperature": 313.15}}))
    assert load_table(str(path)) == table
    for wrong, said in (
        (fluid | {"oil": "hlp_47"}, "unknown fluid 'hlp_47'"),
        (fluid | {"temperature": 60.0}, "fluid: temperature = 60"),
        ({"oil": "hlp_46"}, "fluid: missing"),
    ):
        path.write_text(yaml.safe_dump(table.to_mapping() | {"fluid": wrong}))
        with pytest.raises(ShakeError, match=said):
            load_table(str(path))


# --- radial clearance -------------------------------------------------------------------------------------------


def test_radial_clearance_rounds_the_edge_and_leaks_at_null(table):
    assert opening(0.3, 0.0, 0.004) == pytest.approx(math.hypot(0.3, 0.004))
    assert opening(-1e-9, 0.0, 0.004) == pytest.approx(opening(1e-9, 0.0, 0.004), rel=1e-4)
    assert 0.0 < opening(-0.1, 0.0, 0.004) < 2e-4
    worn = table.with_values({"valve.underlap": 0.0, "valve.radial_clearance": 0.01})
    u = 0.2 * np.sin(2.0 * np.pi * 2.0 * np.arange(500) * SAMPLE)
    assert np.all(np.isfinite(run(worn, u, SAMPLE)))


# --- shear frame ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("storeys", [1, 2, 5, 10])
def test_natural_frequencies_of_a_frame_are_the_closed_form(storeys):
    frame = record(frame_storeys=storeys, frame_mass=40.0, frame_stiffness=1.5e5, frame_damping=0.0)
    states, rates, last = np.eye(CONTINUOUS), np.zeros((CONTINUOUS, CONTINUOUS)), STOREY + 2 * storeys
    for i in range(STOREY, last):
        storey_rates(frame, states[i], 0.0, rates[i])
    found = np.sort(np.abs(np.linalg.eigvals(rates[STOREY:last, STOREY:last].T).imag))[::2]
    j = np.arange(1, storeys + 1)
    closed = 2.0 * math.sqrt(1.5e5 / 40.0) * np.sin((2 * j - 1) * np.pi / (4 * storeys + 2))
    np.testing.assert_allclose(found, closed, rtol=1e-9)


def test_a_rigid_frame_is_a_mass_on_the_table(table):
    u = 0.2 * np.sin(2.0 * np.pi * 3.0 * np.arange(800) * SAMPLE)
    frame = {"frame.storeys": 2, "frame.mass": 75.0, "frame.stiffness": 2e8, "frame.damping": 2e5}
    rigid = run(table.with_values({"body.specimen_mass": 350.0}), u, SAMPLE)
    assert nrmse(rigid[:, 2], run(table.with_values(frame), u, SAMPLE)[:, 2]) < 0.01


def test_one_storey_equals_the_specimen_resonance_of_the_same_mass(table):
    u = 0.2 * np.sin(2.0 * np.pi * 6.0 * np.arange(800) * SAMPLE)
    omega = 2.0 * math.pi * 8.0
    effect = {"effects.specimen_resonance.mass": 100.0, "effects.specimen_resonance.frequency": 8.0}
    frame = {
        "body.specimen_mass": 100.0,
        "frame.storeys": 1,
        "frame.mass": 100.0,
        "frame.stiffness": 100.0 * omega**2,
        "frame.damping": 2.0 * 0.03 * omega * 100.0,
    }
    expected = run(table.with_values(effect), u, SAMPLE)
    assert nrmse(expected[:, 2], run(table.with_values(frame), u, SAMPLE)[:, 2]) < 1e-3


def test_foot_force_is_spring_and_damper():
    y = np.zeros(CONTINUOUS)
    y[STOREY : STOREY + 2] = 2e-3, 0.5
    assert foot_force(record(frame_storeys=1, frame_stiffness=1e5, frame_damping=10.0), y) == pytest.approx(205.0)


# --- friction laws in the plant ---------------------------------------------------------------------------------


def with_law(table, name):
    return table.with_sections(friction=load_variant("friction", name, FRICTIONS)[1])


def test_lugre_with_its_stiff_bristles_is_within_a_hundredth_of_radau(table):
    table = with_law(table, "lugre")
    sample = 5e-3
    commands = np.repeat([0.1, -0.1, 0.05, -0.2], 12)
    law = yaml.safe_load((reference.BERGAMO.parents[1] / "friction" / "lugre.yaml").read_text(encoding="utf-8"))
    assert float(law.pop("contact_stiffness")) == 1.14e8
    bristles = {key: float(value) for key, value in law.items() if key != "kind"} | {"contact_stiffness": 1.14e8}
    expected = reference.radau_with_bristles(commands, sample, reference.constants(), bristles)
    assert reference.nrmse(expected, run(table, commands, sample)[:, 2]) < 1e-2


@pytest.mark.parametrize("name", FRICTIONS)
def test_every_law_drives_the_table_and_does_not_depend_on_the_tolerance(table, name):
    table = with_law(table, name)
    u = 0.3 * np.sin(2.0 * np.pi * 2.0 * np.arange(700) * SAMPLE)
    tight = run(table, u, SAMPLE, tolerance=1e-8)
    assert np.all(np.isfinite(tight))
    assert nrmse(tight[:, 2], run(table, u, SAMPLE)[:, 2]) < 1e-2


def test_bergamo_with_lugre_survives_its_file(table):
    changed = with_law(table, "lugre")
    assert changed.to_mapping()["friction"]["kind"] == "lugre"
    again = FULL_LAYOUT.table(changed.to_mapping(), "saved")
    assert again.friction == changed.friction


def test_the_table_sticks_below_the_break_away_force(table):
    result = run(with_law(table, "lugre"), np.full(3000, 4e-3), SAMPLE)
    force = table.body.piston_area * (result[-1, 3] - result[-1, 4])
    assert 1000.0 < force < 2115.4
    assert abs(result[-1, 1]) < 1e-9


def test_the_table_sticks_and_slips_at_one_millimetre_per_second(table):
    """Commanded to creep, the oil's spring and the falling friction take turns."""
    table = table.with_values({"valve.hysteresis": 0.0})  # the spool where it is wanted
    velocity = run(with_law(table, "lugre"), np.full(6000, 4.2e-3), SAMPLE)[3000:, 1]
    assert velocity.mean() == pytest.approx(1.5e-3, abs=0.6e-3)
    assert int(np.sum((velocity[1:] > 3e-4) & (velocity[:-1] <= 3e-4))) > 20
    even = run(with_law(table, "tustin"), np.full(6000, 1.2e-3), SAMPLE)[3000:, 1]
    assert even.mean() == pytest.approx(1.0e-3, abs=0.6e-3)
    assert np.ptp(even) < 0.05 * even.mean()
