"""The reduced third-order model of the table: position, velocity, acceleration (6.33–6.37).

ż_1 = z_2, ż_2 = z_3, ż_3 = β_1 z_2 + β_2 z_3 + β_3 u + |u| (β_4 z_3 + β_5 z_2) + d.

Under a zero-order hold u is constant between two samples, so the model is linear there, with
a = β_1 + β_5 |u| and b = β_2 + β_4 |u|, and is advanced exactly, the |u| terms included. The printed β give poles at
104 rad/s with 1.5 % damping, which a forward Euler step at 1 kHz makes unstable (spectral radius 1.0039).

Verified against: scipy's matrix exponential; the closed form against the finite differences of (6.3)–(6.14).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from shake_ros.compiled import njit
from shake_ros.physics.bulk_modulus import moduli
from shake_ros.physics.plant.cylinder import (
    Sides,
    areas,
    oil_spring,
    pressure_left,
    rest_pressures,
    steady_speeds,
    underlap_left,
    volumes,
)
from shake_ros.physics.plant.parameters import TableLayout, TableParameters
from shake_ros.quantities import Parameters, quantity

SERIES_TERMS = 60


@dataclass(frozen=True)
class ReducedParameters(Parameters):
    """The coefficients of (6.36), (6.37)."""

    beta1: float = quantity(
        "1/s^2", "jerk per velocity, minus the square of the hydraulic frequency", high=0.0, live=True
    )
    beta2: float = quantity("1/s", "jerk per acceleration, damping", high=0.0, live=True)
    beta3: float = quantity("m/s^3", "jerk per command", low=1e-6, live=True)
    beta4: float = quantity("1/s", "jerk per acceleration and opening", high=0.0, live=True)
    beta5: float = quantity("1/s^2", "jerk per velocity and opening", high=0.0, live=True)


# Nothing tells mass, areas or pressures apart here, so every force of an effect counts per moved mass: newton becomes
# m/s². The slowdown of a valve is relative to a declared one; here the valve's own lag takes its place.
REDUCED_LAYOUT = TableLayout(
    "reduced", {"dynamics": ReducedParameters}, forces_per_mass=True, without=("effects.slow_valve.slowdown",)
)


@dataclass(frozen=True)
class ClosedForm:
    """β of a table, and (v_+ − v_−)/(v_+ + v_−) by which its steady velocity differs with the direction [-].

    The latter is the reduced model's `effects.asymmetric_flow_gain.asymmetry`; zero for equal areas.
    """

    beta: ReducedParameters
    asymmetry: float

    def table(self) -> TableParameters:
        """The reduced table."""
        effect = {"effects.asymmetric_flow_gain.asymmetry": self.asymmetry}
        return TableParameters(REDUCED_LAYOUT, {"dynamics": self.beta}).with_values(effect if self.asymmetry else {})


def closed_form(table: TableParameters) -> ClosedForm:
    """β_1 … β_5 from the quantities of a table, with the constants that (6.25)–(6.34) lose.

    About mid-stroke, with the oil spring k and the steady velocity v = g u of (3.17), F = A_A P_L of (3.26) obeys
    Ḟ = k (g u − |u| g F/(2 A_A Δ) − v) − ζ F: for equal areas that is Ṗ_L = (4E/V_t) (K u − K |u| P_L/(2ΔP) − C_e P_L −
    A_p v) of (6.5), (6.6), (6.12), (6.13) with K = C_v √(ΔP/2), C_e = C_il + C_el/2 + d_s K/ΔP. The root is expanded at
    P_L = 0, the two pressures share F as their chambers yield, dP_A : dP_B = A_A/V_A : −A_B/V_B, and g, Δ are means of
    both directions. E is the law's at the pressures of rest. `valve.gain`, the valve's lag and dry friction are left
    out, and with unequal areas the change of both pressures' level at a reversal.

    Examples
    --------
    >>> from shake_ros.settings import load_table
    >>> beta = closed_form(load_table("bergamo")).beta  # −4·1.16e9·9.4562e-4²/(2.4586e-4·650); 1.81e-7·√1.025e7/A_p
    >>> round(beta.beta1), round(-beta.beta3 / beta.beta1, 4)
    (-25963, 0.6128)
    """
    mass, supply = table.moved_mass + table.value("effects.payload_error.mass"), table.supply
    rest = rest_pressures(supply.supply_pressure, supply.tank_pressure, table.body.area_ratio)
    e_a, e_b = (float(e) for e in moduli(table.bulk_modulus, np.array(rest)))
    area, volume, viscous = areas(table), volumes(table), table.value("friction.viscous")
    k = oil_spring(table, Sides(e_a, e_b))
    yields = Sides(e_a * area.a / volume.a, e_b * area.b / volume.b)  # dP per unit of F, times k
    lost = table.leakage.internal * (yields.a + yields.b) ** 2
    for own, pressure in zip(yields, rest, strict=True):
        lost += own**2 * (table.leakage.external + open_centre(table, pressure))
    zeta = lost / k
    speeds, left = steady_speeds(table), pressure_left(table)
    gain = 0.5 * (speeds.out + speeds.back)
    droop = 0.25 * (speeds.out / left.a + speeds.back / left.b) / table.body.piston_area  # −∂v/∂F per opening
    return ClosedForm(
        # (6.35) with 4 E for 2 E, K for C_d w √ΔP/(2√ρ), f_v and C_e as there
        ReducedParameters(
            beta1=-(k + zeta * viscous) / mass,
            beta2=-zeta - viscous / mass,
            beta3=k * gain / mass,
            beta4=-k * droop,
            beta5=-k * droop * viscous / mass,
        ),
        (speeds.out - speeds.back) / (speeds.out + speeds.back),
    )


def open_centre(table: TableParameters, pressure: float) -> float:
    """Loss of flow per pressure of a chamber through the underlapped centre of the valve (3.17) [m³/(s·Pa)]."""
    flow = underlap_left(table) * table.value("valve.flow_coefficient")
    drops = table.supply.supply_pressure - pressure, pressure - table.supply.tank_pressure
    return flow * sum(0.5 / math.sqrt(drop) for drop in drops)


@njit
def transition(a, b, dt):  # type: ignore[no-untyped-def]
    """Exact transition of (6.36) over one hold.

    With w = (z_2, z_3), ẇ = M w + (0, j): M² = b M + a I (Cayley–Hamilton), so every power of M is even I + odd M and
    exp(M dt) and its two integrals are scalar series; a = 0 needs no special case.

    Parameters
    ----------
    a, b : β_1 + β_5 |u| [1/s²] and β_2 + β_4 |u| [1/s] during the hold
    dt : length of the hold [s]

    Returns
    -------
    phi : (3, 3) array, z_{k+1} = phi z_k + gamma j
    gamma : (3,) array, response to a jerk j held over the step
    """
    even, odd = 1.0, 0.0
    term = 1.0
    e_p, e_q, f_p, f_q, g_q = 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(SERIES_TERMS):
        e_p += term * even
        e_q += term * odd
        f_p += term * even * dt / (k + 1.0)
        f_q += term * odd * dt / (k + 1.0)
        g_q += term * odd * dt * dt / ((k + 1.0) * (k + 2.0))
        even, odd = a * odd, even + b * odd
        term *= dt / (k + 1.0)
        if k > 3 and abs(term * even) < 1e-18 * abs(e_p) and abs(term * odd) < 1e-18 * abs(e_q):
            break
    phi = np.zeros((3, 3))
    gamma = np.empty(3)
    phi[0, 0] = 1.0
    phi[0, 1] = f_p
    phi[0, 2] = f_q
    phi[1, 1] = e_p
    phi[1, 2] = e_q
    phi[2, 1] = a * e_q
    phi[2, 2] = e_p + b * e_q
    gamma[0] = g_q
    gamma[1] = f_q
    gamma[2] = f_p + b * f_q
    return phi, gamma


@njit
def advance(state, p, u, disturbance, dt):  # type: ignore[no-untyped-def]
    """One exact step of (6.36) under a held command and a held disturbance d [m/s³]; returns a new (3,) array.

    `p` is any record that has β_1 … β_5 by name.
    """
    opening = abs(u)
    phi, gamma = transition(p.beta1 + p.beta5 * opening, p.beta2 + p.beta4 * opening, dt)
    jerk = p.beta3 * u + disturbance
    following = np.empty(3)
    for i in range(3):
        following[i] = phi[i, 0] * state[0] + phi[i, 1] * state[1] + phi[i, 2] * state[2] + gamma[i] * jerk
    return following
