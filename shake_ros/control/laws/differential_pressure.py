"""Feedforward PI control (6.40) with differential-pressure stabilisation, or force balance.

    u = u_PI − K_dp s/(s + ω_dp) (P_L − w P_L,ref),  P_L = M â/A_p,  P_L,ref = M ẍ_ref/A_p

P_L is the pressure difference that moves the mass; the observer `fused` takes its acceleration from the measured
chamber pressures. K_dp acts as −K_dp M/A_p on the acceleration and so damps the oil column, −β_2 grows by β_3 K_dp
M/A_p; the wash-out ω_dp keeps it from answering to a static load. With w = 0 it resists every pressure (the usual ΔP
stabilisation, which also takes from the bandwidth), with w = 1 only what the reference does not ask for (force
balance). The wash-out is exact for a pressure that runs straight between samples. Verified against: the difference
equation by hand; the damping of the reduced model's eigenvalues.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from shake_ros.compiled import njit
from shake_ros.control.laws import feedforward_pi
from shake_ros.quantities import quantity


@dataclass(frozen=True, kw_only=True)
class DifferentialPressure(feedforward_pi.PIGains):
    """Gains of (6.40) and of the pressure's path."""

    code: ClassVar[int] = 9
    states: ClassVar[int] = 4

    pressure_gain: float = quantity("1/Pa", "K_dp, minus the command per load pressure", low=0.0, high=1e-5, live=True)
    washout: float = quantity("rad/s", "ω_dp below which the pressure is not fed back", low=0.0, high=1000.0, live=True)
    force_balance: float = quantity("-", "share w of the reference's own pressure", low=0.0, high=1.0, live=True)
    moved_mass: float = quantity("kg", "mass M of table and specimen", low=1.0, high=1e6, live=True)
    piston_area: float = quantity("m^2", "piston area A_p", low=1e-6, high=1.0)


@njit
def washed_out(before, value_before, value, corner, dt):  # type: ignore[no-untyped-def]
    """y of ẏ + ω y = ẇ after a sample in which w runs straight.

    >>> float(washed_out(2.0, 5.0, 6.0, 0.0, 0.001))
    3.0
    """
    if corner <= 0.0:
        return before + value - value_before
    fade = math.exp(-corner * dt)
    return fade * before + (value - value_before) * (1.0 - fade) / (corner * dt)


@njit
def step(state, p, reference, estimate, feedforward, dt):  # type: ignore[no-untyped-def]
    """One sample; as in `feedforward_pi.step`, state (∫e [m·s], started, pressure and washed-out pressure [Pa])."""
    pressure = p.moved_mass / p.piston_area * (estimate[2] - p.force_balance * reference[2])
    passed = pressure if state[1] == 0.0 else washed_out(state[3], state[2], pressure, p.washout, dt)
    integral, command = feedforward_pi.step(
        state[:1], p, reference, estimate, feedforward - p.pressure_gain * passed, dt
    )
    following = np.empty(4)
    following[0], following[1], following[2], following[3] = integral[0], 1.0, pressure, passed
    return following, command
