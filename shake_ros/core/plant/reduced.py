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

from shake_ros.core.compiled import njit
from shake_ros.core.plant.parameters import TableLayout
from shake_ros.core.quantities import Parameters, quantity

SERIES_TERMS = 60


@dataclass(frozen=True)
class ReducedParameters(Parameters):
    """The coefficients of (6.36), (6.37)."""

    beta1: float = quantity("1/s^2", "jerk per velocity, minus the square of the hydraulic frequency", high=0.0)
    beta2: float = quantity("1/s", "jerk per acceleration, damping", high=0.0)
    beta3: float = quantity("m/s^3", "jerk per command", low=1e-6)
    beta4: float = quantity("1/s", "jerk per acceleration and opening", high=0.0)
    beta5: float = quantity("1/s^2", "jerk per velocity and opening", high=0.0)


# Nothing tells mass, areas or pressures apart here, so every force of an effect counts per moved mass: newton becomes
# m/s². The slowdown of a valve is relative to a declared one; here the valve's own lag takes its place.
REDUCED_LAYOUT = TableLayout(
    "reduced", {"dynamics": ReducedParameters}, forces_per_mass=True, without=("effects.slow_valve.slowdown",)
)


def closed_form(
    *,
    bulk_modulus: float,
    piston_area: float,
    cylinder_volume: float,
    moving_mass: float,
    flow_coefficient: float,
    pressure_difference: float,
    leakage: float,
    viscous_friction: float,
    underlap: float,
) -> ReducedParameters:
    """β_1 … β_5 from the quantities of the table, with the constants that (6.25)–(6.34) lose.

    With P_L = P_A − P_B, V_A = V_B = V_t/2 and ΔP = P_s − P_T, equations (6.5), (6.6), (6.12), (6.13) give
    Ṗ_L = (4E/V_t) (K u − K |u| P_L/(2ΔP) − C_e P_L − A_p v), K = C_v √(ΔP/2); the root is expanded at P_L = 0.
    An underlapped valve leaks through its open centre as well: C_e grows by d_s K/ΔP.

    Parameters
    ----------
    bulk_modulus : E [Pa]
    piston_area : A_p [m²]
    cylinder_volume : V_t, both chambers together [m³]
    moving_mass : M [kg]
    flow_coefficient : C_v of (3.17) [m³/(s·√Pa)]
    pressure_difference : supply minus tank [Pa]
    leakage : C_il + C_el/2 [m³/(s·Pa)]
    viscous_friction : f_v [N·s/m]
    underlap : d_s, 0 for a critical centre [-]

    Examples
    --------
    >>> beta = closed_form(bulk_modulus=1e9, piston_area=1e-3, cylinder_volume=2e-4, moving_mass=500.0,
    ...     flow_coefficient=1e-7, pressure_difference=2e7, leakage=0.0, viscous_friction=0.0, underlap=0.0)
    >>> round(beta.beta1), round(-beta.beta3 / beta.beta1, 4)  # −4·1e9·1e-6/(2e-4·500); 1e-7·√1e7/1e-3
    (-40000, 0.3162)
    """
    flow_gain = flow_coefficient * math.sqrt(pressure_difference / 2.0)
    leak = leakage + max(underlap, 0.0) * flow_gain / pressure_difference
    stiffness = 4.0 * bulk_modulus / cylinder_volume
    lost = stiffness * flow_gain / (2.0 * pressure_difference)
    return ReducedParameters(
        # (6.35) with 4 E for 2 E, K for C_d w √ΔP/(2√ρ), f_v and C_e as there
        beta1=-stiffness * (piston_area**2 + leak * viscous_friction) / moving_mass,
        beta2=-stiffness * leak - viscous_friction / moving_mass,
        beta3=stiffness * piston_area * flow_gain / moving_mass,
        beta4=-lost,
        beta5=-lost * viscous_friction / moving_mass,
    )


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
