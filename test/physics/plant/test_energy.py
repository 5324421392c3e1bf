"""Energy balance over a strong motion: what the supply gives is lost, stored or in motion."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import simpson

from benchmarks.plant import reference_model as reference
from shake_ros.physics.bulk_modulus.lee import Lee
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.physics.plant.simulation import run
from shake_ros.settings import load_table

Array = NDArray[np.float64]
FINE = 2e-4  # sample time at which the outputs are integrated [s]


def quake(duration: float) -> np.ndarray:
    """A valve command like that of an earthquake: band-limited noise under an envelope, seeded, at 1/FINE."""
    draw = np.random.default_rng(4)
    t = FINE * np.arange(round(duration / FINE))
    frequencies = np.linspace(0.3, 8.0, 60)
    waves = np.sin(2.0 * np.pi * np.outer(t, frequencies) + draw.uniform(0.0, 2.0 * np.pi, 60))
    motion = waves @ (1.0 / np.sqrt(frequencies))
    envelope = np.sin(np.pi * t / duration) ** 2
    return 0.6 * envelope * motion / np.max(np.abs(envelope * motion))


def parts(table: TableParameters, result: np.ndarray, modulus: Callable[[Array], Array | float]) -> dict[str, float]:
    """Energies over the run from the outputs alone [J], with flows and friction from the equation sheet."""
    c = reference.constants()
    x, v, p_a, p_b, spool = (result[:, i] for i in (0, 1, 3, 4, 6))

    def flow(opened: np.ndarray, drop: np.ndarray) -> np.ndarray:
        return c.flow * np.clip(opened + c.underlap, 0.0, 1.0) * drop * (drop**2 + c.laminar**2) ** -0.25

    from_supply_a, to_tank_a = flow(spool, c.supply - p_a), flow(-spool, p_a - c.tank)
    to_tank_b, from_supply_b = flow(spool, p_b - c.tank), flow(-spool, c.supply - p_b)
    friction = (c.coulomb + c.rise * np.exp(-c.decay * np.abs(v))) * np.tanh(v / c.sharp) + c.viscous * v

    def over_time(power: np.ndarray) -> float:
        return float(simpson(power, dx=FINE))

    def compressed(pressure: np.ndarray, volume: np.ndarray) -> float:
        """∫ P (V/E) dP: work stored in the oil of a chamber, along the run."""
        rate = np.gradient(pressure, FINE, edge_order=2)
        return over_time(pressure * volume / modulus(pressure) * rate)

    throttled = (
        from_supply_a * (c.supply - p_a)
        + to_tank_a * (p_a - c.tank)
        + to_tank_b * (p_b - c.tank)
        + from_supply_b * (c.supply - p_b)
    )
    leaked = c.internal * (p_a - p_b) ** 2 + c.external * (p_a**2 + p_b**2)
    mass = table.moved_mass
    return {
        "supplied": over_time(c.supply * (from_supply_a + from_supply_b) - c.tank * (to_tank_a + to_tank_b)),
        "throttled": over_time(throttled),
        "leaked": over_time(leaked),
        "rubbed": over_time(friction * v),
        "compressed": compressed(p_a, c.half_volume + c.area * x) + compressed(p_b, c.half_volume - c.area * x),
        "moving": 0.5 * mass * (v[-1] ** 2 - v[0] ** 2),
    }


LEE = {"largest_modulus": 1.8e9, "largest_pressure": 280e5, "a1": 0.5, "a2": 90.0, "a3": 3.0}


@pytest.fixture(scope="module", params=["constant", "lee"])
def balance(request: pytest.FixtureRequest) -> dict[str, float]:
    table = load_table("bergamo")
    if request.param == "constant":
        return parts(table, run(table, quake(10.0), FINE), lambda pressure: reference.constants().modulus)
    table = table.with_sections(bulk_modulus=Lee(**LEE))
    return parts(table, run(table, quake(10.0), FINE), lambda pressure: 0.9e9 * np.log10(90.0 * pressure / 280e5 + 3.0))


def test_ten_seconds_of_strong_motion_close_the_balance_to_a_thousandth(balance: dict[str, float]) -> None:
    spent = sum(value for name, value in balance.items() if name != "supplied")
    assert balance["supplied"] > 1e3
    assert spent == pytest.approx(balance["supplied"], rel=1e-3)


def test_losses_are_losses(balance: dict[str, float]) -> None:
    assert min(balance["throttled"], balance["leaked"], balance["rubbed"]) > 0.0


def test_the_mechanical_side_closes_alone() -> None:
    table = load_table("bergamo")
    result = run(table, quake(2.0), FINE)
    v, load = result[:, 1], result[:, 3] - result[:, 4]
    c = reference.constants()
    friction = (c.coulomb + c.rise * np.exp(-c.decay * np.abs(v))) * np.tanh(v / c.sharp) + c.viscous * v
    delivered = simpson(c.area * load * v, dx=FINE)
    taken = simpson(friction * v, dx=FINE) + 0.5 * c.mass * v[-1] ** 2
    assert delivered == pytest.approx(taken, rel=1e-3)
