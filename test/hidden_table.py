"""Recordings of a table with effects that the declared model lacks, for tests of identification and discovery.

The declared part is that of benchmarks/plant/reference_model.py, the effects are written here a second time. Nothing
imports the package: classical Runge–Kutta of small fixed steps, friction with a sharper sign than the fit uses, noise
and steps of the sensors drawn here. A weak position loop keeps the table centred; the recorded command is the one that
acted.
"""

from __future__ import annotations

from math import exp, pi, tanh
from typing import NamedTuple

import numba
import numpy as np

from benchmarks.plant.reference_model import Constants, at_rest, constants

SAMPLE_TIME = 0.001
STEPS = 20  # Runge–Kutta steps a sample
POSITION_NOISE, POSITION_STEP = 8e-6, 0.300 / 2**16  # [m]
ACCELERATION_NOISE = 0.05  # [m/s²]
PRESSURE_NOISE = 3e4  # [Pa]
CENTRING = 2.0  # command per metre of displacement

# This table's own values, as far from the catalogue as tables are.
OWN = {
    "modulus": 9.0e8,
    "coulomb": 250.0,
    "rise": 300.0,
    "decay": 25.0,
    "viscous": 200.0,
    "internal": 6e-13,
    "external": 1e-13,
    "flow": 1.9e-7,
    "sharp": 4e-4,
}
TRUE = {  # the same as parameters of a table
    "friction.coulomb_level": OWN["coulomb"],
    "friction.stribeck_rise": OWN["rise"],
    "friction.stribeck_decay": OWN["decay"],
    "friction.viscous": OWN["viscous"],
    "bulk_modulus.modulus": OWN["modulus"],
    "leakage.internal": OWN["internal"],
    "leakage.external": OWN["external"],
    "valve.flow_coefficient": OWN["flow"],
}

SCALED = {  # exponents of a common factor that leaves the motion of a table as it is
    "body.table_mass": 1.0, "body.specimen_mass": 1.0, "supply.supply_pressure": 1.0, "supply.tank_pressure": 1.0,
    "valve.flow_coefficient": -0.5, "valve.laminar_pressure": 1.0, "bulk_modulus.modulus": 1.0,
    "bulk_modulus.reference_pressure": 1.0, "friction.coulomb_level": 1.0, "friction.stribeck_rise": 1.0,
    "friction.viscous": 1.0, "leakage.internal": -1.0, "leakage.external": -1.0,
}  # fmt: skip


class Hidden(NamedTuple):
    """What the table has beyond the declared model, SI; absent at these values."""

    dead_band: float = 0.0  # spool travel without flow, each way
    flow_asymmetry: float = 0.0  # excess of flow for positive opening
    null_shift: float = 0.0  # command
    back_pressure: float = 0.0  # rise of the tank pressure [Pa]
    drag: float = 0.0  # force per squared velocity [N s²/m²]
    flexible_mass: float = 0.0  # part of the moved mass that stands on a spring [kg]
    flexible_frequency: float = 6.0  # [Hz]
    flexible_damping: float = 0.03
    side_force: float = 0.0  # [N]


class Recorded(NamedTuple):
    """Arrays of shape (n,) at 1 kHz: command [-], position [m], acceleration [m/s²], load pressure [Pa]."""

    commands: np.ndarray
    position: np.ndarray
    acceleration: np.ndarray
    pressure: np.ndarray


@numba.njit(cache=True)
def passage(gap, drop, laminar):  # type: ignore[no-untyped-def]
    """Flow through an edge per flow coefficient [√Pa]."""
    return min(max(gap, 0.0), 1.0) * drop / (drop * drop + laminar * laminar) ** 0.25


@numba.njit(cache=True)
def rates(y, wanted, c, h, out):  # type: ignore[no-untyped-def]
    """Rates of x, v, P_A, P_B, spool, its rate, specimen q and q̇ into `out`; returns the acceleration."""
    x, v, p_a, p_b = y[0], y[1], y[2], y[3]
    s = y[4]
    s = s - h.dead_band if s > h.dead_band else (s + h.dead_band if s < -h.dead_band else 0.0)
    gain = c.flow * (1.0 + h.flow_asymmetry if y[4] > 0.0 else 1.0 - h.flow_asymmetry)
    tank, up, down = c.tank + h.back_pressure, s + c.underlap, c.underlap - s
    q_a = gain * (passage(up, c.supply - p_a, c.laminar) - passage(down, p_a - tank, c.laminar))
    q_b = gain * (passage(up, p_b - tank, c.laminar) - passage(down, c.supply - p_b, c.laminar))
    load = p_a - p_b
    bulk = c.modulus * (c.lambda_1 - c.lambda_2 * (tanh(c.mu * (load + c.edge)) - tanh(c.mu * (load - c.edge))))
    dry = (c.coulomb + c.rise * exp(-c.decay * abs(v))) * tanh(v / c.sharp)
    force = c.area * load - dry - c.viscous * v - h.drag * abs(v) * v + h.side_force
    omega = 2.0 * pi * h.flexible_frequency
    spring = 2.0 * h.flexible_damping * omega * y[7] + omega * omega * y[6]
    acceleration = (force + h.flexible_mass * spring) / (c.mass - h.flexible_mass)
    out[0], out[1] = v, acceleration
    out[2] = bulk / (c.half_volume + c.area * x) * (q_a - c.external * p_a - c.internal * load - c.area * v)
    out[3] = bulk / (c.half_volume - c.area * x) * (-q_b - c.external * p_b + c.internal * load + c.area * v)
    out[4], out[5] = y[5], c.omega**2 * (wanted - y[4]) - 2.0 * c.damping * c.omega * y[5]
    out[6], out[7] = y[7], -acceleration - spring
    return acceleration


@numba.njit(cache=True)
def sample(y, wanted, c, h, steps, dt):  # type: ignore[no-untyped-def]
    """The state one sample later: classical Runge–Kutta, the spool's dry friction (3.19) after each step of it."""
    k1, k2, k3, k4 = np.empty(8), np.empty(8), np.empty(8), np.empty(8)
    step = dt / steps
    for _ in range(steps):
        rates(y, wanted, c, h, k1)
        rates(y + 0.5 * step * k1, wanted, c, h, k2)
        rates(y + 0.5 * step * k2, wanted, c, h, k3)
        rates(y + step * k3, wanted, c, h, k4)
        y = y + step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        y[5] = np.sign(y[5]) * max(abs(y[5]) - step * c.omega**2 * c.friction, 0.0)
        if abs(y[4]) > 1.0:
            y[4], y[5] = np.sign(y[4]), 0.0
    return y


@numba.njit(cache=True)
def closed_loop(excitation, position_noise, y, c, h, centring, steps, dt):  # type: ignore[no-untyped-def]
    """Command, measured position (with noise and steps), true acceleration and load pressure, shape (n, 4)."""
    out, rate = np.empty((len(excitation), 4)), np.empty(8)
    for k in range(len(excitation)):
        measured = round((y[0] + position_noise[k]) / POSITION_STEP) * POSITION_STEP
        u = min(max(excitation[k] - centring * measured, -1.0), 1.0)
        wanted = min(max(u + h.null_shift, -1.0), 1.0)
        out[k, 0], out[k, 1], out[k, 2] = u, measured, rates(y, wanted, c, h, rate)
        out[k, 3] = y[2] - y[3]
        y = sample(y, wanted, c, h, steps, dt)
    return out


def excitation(seed: int, seconds: float) -> np.ndarray:
    """Odd random-phase multi-sine of 0.4 … 15 Hz, falling with frequency, small in its first third, shape (n,)."""
    rng = np.random.default_rng(seed)
    time = np.arange(round(seconds / SAMPLE_TIME)) * SAMPLE_TIME
    frequency = np.arange(0.4, 15.0, 0.4)
    waves = np.sin(2.0 * pi * np.outer(time, frequency) + rng.uniform(0.0, 2.0 * pi, len(frequency)))
    u = waves @ (1.0 / (1.0 + frequency / 3.0))
    level = np.where(time < seconds / 3.0, 0.25, 1.0) * np.minimum(time / 0.2, 1.0)
    return 0.75 * level * u / np.max(np.abs(u))


def record(
    seed: int, seconds: float = 6.0, hidden: Hidden | None = None, *, noisy: bool = True, **own: float
) -> Recorded:
    """A recording; `own` changes constants of reference_model.Constants, `soft_zone_depth` among them."""
    table: Constants = constants(**{**OWN, **own})
    rng = np.random.default_rng(1000 + seed)
    u = excitation(seed, seconds)
    noise = POSITION_NOISE * rng.standard_normal(len(u)) if noisy else np.zeros(len(u))
    start = np.concatenate([at_rest(table), np.zeros(2)])
    out = closed_loop(u, noise, start, table, hidden or Hidden(), CENTRING, STEPS, SAMPLE_TIME)
    more = ACCELERATION_NOISE * rng.standard_normal(len(u)) if noisy else 0.0
    load = out[:, 3] + (PRESSURE_NOISE * rng.standard_normal(len(u)) if noisy else 0.0)
    return Recorded(out[:, 0].copy(), out[:, 1].copy(), out[:, 2] + more, load)


def open_loop(commands: np.ndarray, table: Constants, hidden: Hidden | None = None) -> np.ndarray:
    """True acceleration under given commands from rest, shape (n,) [m/s²]."""
    start, none = np.concatenate([at_rest(table), np.zeros(2)]), np.zeros(len(commands))
    return closed_loop(commands, none, start, table, hidden or Hidden(), 0.0, STEPS, SAMPLE_TIME)[:, 2]


__all__ = ["OWN", "SCALED", "TRUE", "Constants", "Hidden", "Recorded", "constants", "excitation", "open_loop", "record"]
