"""Oil that warms within a recording, against the table at the temperature that it has reached."""

from __future__ import annotations

import numpy as np
import pytest

from shake_ros.fit.declared_model import FULL
from shake_ros.fit.free_parameters import FreeParameters, free_parameter
from shake_ros.fit.least_squares import fit
from shake_ros.fit.recording_problem import RecordingProblem
from shake_ros.fit.records import Record
from shake_ros.physics.effects.hydraulics import OilWarming
from shake_ros.physics.fluid import Oil
from shake_ros.physics.plant.parameters import records
from shake_ros.physics.plant.right_hand_side import active_states, right_hand_side
from shake_ros.physics.plant.simulation import initial_state, run
from shake_ros.physics.plant.states import CLOCK, PRESSURE_A, SPOOL, STATES, VELOCITY
from shake_ros.physics.plant.temperature import OilState, at_temperature
from shake_ros.settings import find, load_table, read_yaml

TABLE = load_table("bergamo").with_values({"friction.viscous": 400.0, "leakage.external": 2e-12})
EFFECT = OilWarming()


def warm(kelvin):
    """The declared table, whose numbers hold at 15 °C, that much warmer."""
    path = find("fluid", "hlp_46")
    oil = Oil.from_mapping(read_yaml(path), str(path)).parameters
    oil = oil.replace(expansion=EFFECT.expansion, viscosity_decay=EFFECT.viscosity_decay, reference_temperature=288.15)
    return at_temperature(TABLE, oil, OilState(288.15 + kelvin, 288.15, EFFECT.modulus_slope))


def rates_of(table, clock):
    """Rates of a moving table at a time of its recording, shape (6,)."""
    p, rates = records(table.vector())[0], np.zeros(STATES)
    y = initial_state(table.vector())
    y[VELOCITY], y[PRESSURE_A], y[SPOOL], y[CLOCK] = 0.3, 1.3e7, 0.2, clock
    right_hand_side(p, y, y, 0.2, 0.0, active_states(p), rates)
    return rates[:6]


@pytest.mark.parametrize(("rate", "clock"), [(0.1, 100.0), (-0.05, 60.0), (2.0, 1e3)])
def test_rates_are_those_of_the_table_at_the_temperature_reached(rate: float, clock: float) -> None:
    drifting = TABLE.with_values({"effects.oil_warming.rate": rate})
    reached = warm(min(rate * clock, 60.0))
    np.testing.assert_allclose(rates_of(drifting, clock), rates_of(reached, clock), rtol=1e-9)
    assert not np.allclose(rates_of(drifting, clock)[2:4], rates_of(TABLE, clock)[2:4], rtol=1e-3)


def test_a_slow_drift_runs_through_the_tables_of_its_temperatures() -> None:
    u = 0.3 * np.sin(2.0 * np.pi * 4.0 * np.arange(1500) * 1e-3)
    drifting = run(TABLE.with_values({"effects.oil_warming.rate": 20.0}), u, 1e-3)[:, 2]
    cold, hot = (run(warm(kelvin), u, 1e-3)[:, 2] for kelvin in (0.0, 28.75))
    last = slice(1375, 1500)  # the half period in which the drift passes 28.75 K in its middle
    off = [float(np.std((drifting - other)[last]) / np.std(drifting[last])) for other in (cold, hot)]
    assert off[0] > 0.1
    assert off[1] < 0.15 * off[0]


def test_a_piece_of_a_recording_is_as_warm_as_the_recording_was_there() -> None:
    """A drift goes on in a recording that begins later by the clock."""
    table = TABLE.with_values({"effects.oil_warming.rate": 0.5})
    u = 0.3 * np.sin(2.0 * np.pi * 3.0 * np.arange(600) * 1e-3)
    later = Record("piece", 1e-3, u, np.zeros(600), begin=20.0)
    at_start = Record("piece", 1e-3, u, np.zeros(600), begin=0.0)
    warmed, cold, reached = (
        FULL.run(one, record)[:, 2] for record, one in ((later, table), (at_start, table), (at_start, warm(10.0)))
    )
    assert np.std(warmed - reached) < 0.1 * np.std(warmed - cold)


def test_a_fit_finds_the_drift_that_a_recording_was_made_with() -> None:
    """0.2 K/s beside a modulus and a leakage that are free as well, within four standard errors."""
    time, noise = np.arange(12000) * 1e-3, np.random.default_rng(1).standard_normal((2, 12000))
    u = sum(a * np.sin(2.0 * np.pi * f * time) for a, f in ((0.15, 3.0), (0.1, 7.3), (0.05, 17.0)))
    out = run(TABLE.with_values({"effects.oil_warming.rate": 0.2}), u, 1e-3)
    record = Record("warm", 1e-3, u, out[:, 0] + 8e-6 * noise[0], out[:, 2] + 0.02 * noise[1])
    scales = {"bulk_modulus.modulus": 1e8, "leakage.external": 1e-12, "effects.oil_warming.rate": 0.02}
    free = FreeParameters(TABLE, [free_parameter(n, {"scale": s}, "here") for n, s in scales.items()])
    found = fit(RecordingProblem([record]), free, free.start(), evaluations=15)
    deviation = np.sqrt(np.linalg.inv(found.jacobian.T @ found.jacobian)[-1, -1]) * 0.02
    assert deviation < 0.01
    assert abs(0.02 * found.x[-1] - 0.2) < 4.0 * deviation
