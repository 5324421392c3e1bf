"""Flow of oil through round pipes and orifices, and its storage in a volume, (2.60)–(2.78).

Pipes, (2.60)–(2.72): below Re = 2000 the flow is laminar (Hagen–Poiseuille, f = 64/Re), above 4000 turbulent in a
smooth pipe (Blasius, f = 0.3164/Re^0.25, up to Re = 1e5). Between them the thesis gives no law; here f Re² is a power
of Re through both ends, so that the pressure drop is continuous, rises with the flow and has an explicit inverse.
Source: thesis, sections 2.5, 2.6. Verified against the integral of the velocity profile (2.67) and against each other.

Orifices, (2.73)–(2.78): turbulent with a constant discharge coefficient, or laminar at first. With ξ(Re) = k_1/Re + k_2
(2.75) and Re = v d/ν the loss (2.74) is quadratic in the velocity,

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
LAMINAR = 2000.0  # Re up to which the flow is laminar
TURBULENT = 4000.0  # Re from which it is turbulent
AT_LAMINAR = 64.0 * LAMINAR  # f Re² at both ends of the transition
AT_TURBULENT = 0.3164 * TURBULENT**1.75
EXPONENT = math.log(AT_TURBULENT / AT_LAMINAR) / math.log(TURBULENT / LAMINAR)  # f Re² ~ Re^EXPONENT between them


@njit
def pressure_rate(bulk_modulus, volume, inflow, volume_rate):
    """Ṗ = (E/V)(ΣQ − V̇) (2.60), with V̇ = 0 (2.61) [Pa/s].

    Parameters
    ----------
    bulk_modulus : [Pa].
    volume : [m³].
    inflow : ΣQ_in − ΣQ_out [m³/s].
    volume_rate : [m³/s].
    """
    return bulk_modulus / volume * (inflow - volume_rate)  # (2.60)


@njit
def reynolds(velocity, diameter, viscosity, density):
    """Re = ρ v d_h/η (2.62) [-]."""
    return density * abs(velocity) * diameter / viscosity  # (2.62)


@njit
def hydraulic_diameter(area, perimeter):
    """d_h = 4A/S (2.63) [m]."""
    return 4.0 * area / perimeter  # (2.63)


@njit
def velocity_profile(radius, pipe_radius, viscosity, pressure_gradient):
    """Laminar velocity at a radius under dp/dx (2.67) [m/s]."""
    return -(pipe_radius * pipe_radius - radius * radius) / (4.0 * viscosity) * pressure_gradient  # (2.67)


@njit
def mean_velocity(pipe_radius, viscosity, pressure_gradient):
    """Laminar mean velocity under dp/dx, half of the largest (2.68) [m/s]."""
    return -pipe_radius * pipe_radius / (8.0 * viscosity) * pressure_gradient  # (2.68)


@njit
def laminar_flow(pressure_drop, length, diameter, viscosity):
    """Hagen–Poiseuille's flow (2.69) [m³/s].

    >>> round(float(laminar_flow(1e5, 1.0, 0.01, 0.04)), 9)  # π 0.005⁴ 1e5 / (8·0.04)
    0.000613592
    """
    radius = 0.5 * diameter
    return math.pi * radius**4 / (8.0 * viscosity) * pressure_drop / length  # (2.69)


@njit
def laminar_factor(reynolds_number):
    """f = 64/Re (2.71) [-]."""
    return 64.0 / reynolds_number  # (2.71)


@njit
def blasius_factor(reynolds_number):
    """f = 0.3164/Re^0.25 (2.72) [-]."""
    return 0.3164 / reynolds_number**0.25  # (2.72)


@njit
def friction_factor(reynolds_number):
    """f at any Re > 0: laminar (2.71), turbulent (2.72), a power law between [-]."""
    if reynolds_number <= LAMINAR:
        return laminar_factor(reynolds_number)
    if reynolds_number >= TURBULENT:
        return blasius_factor(reynolds_number)
    return AT_LAMINAR * (reynolds_number / LAMINAR) ** EXPONENT / reynolds_number**2


@njit
def pressure_drop(flow, length, diameter, viscosity, density):
    """P_1 − P_2 along a round pipe (2.70), of the sign of the flow [Pa]."""
    if flow == 0.0:
        return 0.0
    velocity = flow / (0.25 * math.pi * diameter * diameter)
    f = friction_factor(reynolds(velocity, diameter, viscosity, density))
    return f * length / diameter * density * velocity * abs(velocity) / 2.0  # (2.70)


@njit
def pipe_flow(pressure_drop, length, diameter, viscosity, density):
    """Flow through a round pipe under a pressure drop, the inverse of (2.70) [m³/s]."""
    drive = 2.0 * abs(pressure_drop) * diameter**3 * density / (length * viscosity * viscosity)  # f Re²
    if drive <= AT_LAMINAR:
        reynolds_number = drive / 64.0
    elif drive >= AT_TURBULENT:
        reynolds_number = (drive / 0.3164) ** (1.0 / 1.75)
    else:
        reynolds_number = LAMINAR * (drive / AT_LAMINAR) ** (1.0 / EXPONENT)
    size = 0.25 * math.pi * diameter * viscosity / density * reynolds_number
    return size if pressure_drop > 0.0 else -size


@njit
def energy_loss(upstream_pressure, upstream_velocity, downstream_pressure, downstream_velocity, density, descent):
    """Bernoulli's loss between two sections, `descent` = z_1 − z_2 [m] (2.73) [Pa]."""
    kinetic = 0.5 * density * (upstream_velocity**2 - downstream_velocity**2)
    return upstream_pressure - downstream_pressure + kinetic + density * STANDARD_GRAVITY * descent  # (2.73)


@njit
def orifice_loss(factor, velocity, density):
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
def orifice_flow(pressure_drop, diameter, viscosity, density, k_1, k_2):
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
def orifice_turbulent_flow(pressure_drop, opening_area, density, discharge_coefficient):
    """Q = α_d A √(2 Δp/ρ) (2.78) [m³/s].

    >>> round(float(orifice_turbulent_flow(1e6, 1e-6, 800.0, 0.6)), 9)  # 0.6e-6·50
    3e-05
    """
    size = discharge_coefficient * opening_area * math.sqrt(2.0 * abs(pressure_drop) / density)  # (2.78)
    return size if pressure_drop > 0.0 else -size
