"""Flow through an orifice: turbulent with a constant discharge coefficient, or laminar at first, (2.73)–(2.78).

With ξ(Re) = k_1/Re + k_2 (2.75) and Re = v d/ν the loss (2.74) is quadratic in the velocity,

    Δp = (ρ/2) (k_2 v² + k_1 (ν/d) v),

so the flow follows without iteration: linear in Δp near zero (laminar), with the root of Δp far from it. α_d of (2.78)
is 1/√k_2 there. Range: sharp edges; α_d = π/(π+2) for a small hole in a large wall. Source: thesis, section 2.6.3.
Verified against (2.78), the laminar limit and the residual of (2.74).
"""

from __future__ import annotations

import math

from shake_ros.core.compiled import njit

STANDARD_GRAVITY = 9.80665  # [m/s²]
SHARP_EDGE = math.pi / (math.pi + 2.0)  # α_d of a sharp-edged orifice, potential flow (2.78)


@njit
def energy_loss(upstream_pressure, upstream_velocity, downstream_pressure, downstream_velocity, density, descent):
    """Bernoulli's loss between two sections, `descent` = z_1 − z_2 [m] (2.73) [Pa]."""
    kinetic = 0.5 * density * (upstream_velocity**2 - downstream_velocity**2)
    return upstream_pressure - downstream_pressure + kinetic + density * STANDARD_GRAVITY * descent  # (2.73)


@njit
def loss(factor, velocity, density):
    """Δp = ξ ρ v²/2 (2.74) [Pa]."""
    return 0.5 * factor * density * velocity * velocity  # (2.74)


@njit
def loss_factor(reynolds_number, k_1, k_2):
    """ξ(Re) = k_1/Re + k_2 (2.75) [-]."""
    return k_1 / reynolds_number + k_2  # (2.75)


@njit
def area(diameter):
    """A = π d²/4 (2.76) [m²]."""
    return 0.25 * math.pi * diameter * diameter  # (2.76)


@njit
def flow(pressure_drop, diameter, viscosity, density, k_1, k_2):
    """Flow with the laminar–turbulent transition of (2.75), solved for v in (2.77) [m³/s].

    Parameters
    ----------
    pressure_drop : [Pa].
    diameter : [m].
    viscosity : dynamic [Pa·s].
    density : [kg/m³].
    k_1, k_2 : of (2.75) [-].
    """
    laminar = k_1 * viscosity / (density * diameter)
    drive = 8.0 * k_2 * abs(pressure_drop) / density
    velocity = drive / (laminar + math.sqrt(laminar * laminar + drive)) / (2.0 * k_2)
    return area(diameter) * velocity if pressure_drop > 0.0 else -area(diameter) * velocity  # (2.77)


@njit
def turbulent_flow(pressure_drop, opening_area, density, discharge_coefficient):
    """Q = α_d A √(2 Δp/ρ) (2.78) [m³/s].

    >>> round(float(turbulent_flow(1e6, 1e-6, 800.0, 0.6)), 9)  # 0.6e-6·50
    3e-05
    """
    size = discharge_coefficient * opening_area * math.sqrt(2.0 * abs(pressure_drop) / density)  # (2.78)
    return size if pressure_drop > 0.0 else -size
