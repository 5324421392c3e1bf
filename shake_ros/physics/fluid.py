"""The hydraulic fluid: viscosity and density of one oil, and its flow through pipes and orifices.

Every function takes numbers or numpy arrays and is compiled, so that figures and the plant use the same code.

Viscosity falls exponentially with temperature and rises exponentially with pressure, (2.3)–(2.5), table 2.1.
Range: mineral oils, λ_1 = 0.036 … 0.057 1/K; the coefficient α of HLP 32 between 0 and 100 °C. Table 2.1 is headed
"10⁻² 1/Pa", which would double the viscosity at 20 Pa; 10⁻⁸ 1/Pa is meant (as in every table of mineral oils) and used.
Source: thesis, section 2.2. Verified against hand values and the ISO viscosity grade of the oil.

Density has two families of formulas, (2.7), (2.9), (2.18)–(2.21): the linearised equation of state about a point, (2.7)
with its special case (2.9), and the expressions of data sheets with a heat expansion factor β_T and a compressibility
κ_P, (2.18), (2.19), (2.21). κ_P (2.20) is the inverse of the isothermal bulk modulus. Range: a liquid, |ρ/ρ_0 − 1| of a
few per cent, where both agree to second order. Source: thesis, section 2.3. Verified against each other and by hand.

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
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from shake_ros.compiled import njit
from shake_ros.quantities import Parameters, ShakeError, quantity, strict_keys

STANDARD_GRAVITY = 9.80665  # [m/s²]
SHARP_EDGE = math.pi / (math.pi + 2.0)  # α_d of a sharp-edged orifice, potential flow (2.78)
LAMINAR = 2000.0  # Re up to which the flow is laminar
TURBULENT = 4000.0  # Re from which it is turbulent
AT_LAMINAR = 64.0 * LAMINAR  # f Re² at both ends of the transition
AT_TURBULENT = 0.3164 * TURBULENT**1.75
EXPONENT = math.log(AT_TURBULENT / AT_LAMINAR) / math.log(TURBULENT / LAMINAR)  # f Re² ~ Re^EXPONENT between them


@njit
def kinematic(eta, rho):
    """ν = η/ρ (2.3) [m²/s]."""
    return eta / rho


@njit
def viscosity_at_temperature(eta_0, lambda_1, temperature, reference_temperature):
    """Dynamic viscosity at a temperature (2.4) [Pa·s].

    >>> round(float(viscosity_at_temperature(0.04, 0.05, 333.15, 313.15)), 6)  # 0.04 exp(-1)
    0.014715
    """
    return eta_0 * np.exp(-lambda_1 * (temperature - reference_temperature))  # (2.4)


@njit
def viscosity_at_pressure(eta_0, alpha, pressure):
    """Dynamic viscosity at a pressure above atmospheric (2.5) [Pa·s]."""
    return eta_0 * np.exp(alpha * pressure)  # (2.5)


def viscosity_coefficient(temperature: float, temperatures: np.ndarray, coefficients: np.ndarray) -> float:
    """α of (2.5) at a temperature, linear between the rows of a table such as 2.1, held beyond its ends [1/Pa].

    Parameters
    ----------
    temperature : [K].
    temperatures : rising, shape (n,) [K].
    coefficients : shape (n,) [1/Pa].
    """
    return float(np.interp(temperature, temperatures, coefficients))


@njit
def linearised_density(
    rho_0, bulk_modulus, expansion, pressure, temperature, reference_pressure, reference_temperature
):
    """Equation of state linearised about (P_0, T_0) (2.7) [kg/m³]."""
    strain = (pressure - reference_pressure) / bulk_modulus - expansion * (temperature - reference_temperature)
    return rho_0 * (1.0 + strain)  # (2.7)


@njit
def density_at_constant_temperature(rho_0, bulk_modulus, pressure):
    """Density at a pressure above the one of ρ_0, temperature as there (2.9) [kg/m³]."""
    return rho_0 + rho_0 / bulk_modulus * pressure  # (2.9)


@njit
def density_at_temperature(rho_0, expansion, temperature, reference_temperature):
    """Density at atmospheric pressure (2.18) [kg/m³].

    >>> round(float(density_at_temperature(850.0, 0.65e-3, 315.0, 290.0)), 3)
    836.408
    """
    return rho_0 / (1.0 + expansion * (temperature - reference_temperature))  # (2.18)


@njit
def density_at_pressure(rho_0, compressibility, pressure, reference_pressure):
    """Density at the reference temperature (2.19) [kg/m³]."""
    return rho_0 / (1.0 - compressibility * (pressure - reference_pressure))  # (2.19)


@njit
def compressibility(bulk_modulus):
    """κ_P = (1/V_0)(∂V/∂P)_T without its sign: the inverse of the isothermal bulk modulus (2.20) [1/Pa]."""
    return 1.0 / bulk_modulus  # (2.20)


@njit
def density_at_both(
    rho_0, expansion, compressibility, pressure, temperature, reference_pressure, reference_temperature
):
    """Density from both data-sheet factors (2.21) [kg/m³]."""
    rho_t = density_at_temperature(rho_0, expansion, temperature, reference_temperature)
    return rho_t * (1.0 + compressibility * (pressure - reference_pressure))  # (2.21)


@dataclass(frozen=True)
class OilParameters(Parameters):
    """Data sheet of an oil."""

    density: float = quantity("kg/m^3", "density ρ_0 at the reference temperature", low=500.0, high=2000.0)
    expansion: float = quantity("1/K", "heat expansion factor β_T", low=0.0, high=0.01)
    compressibility: float = quantity("1/Pa", "compressibility κ_P", low=0.0, high=1e-7)
    reference_temperature: float = quantity("K", "temperature T_0 of the density", low=200.0, high=500.0)
    reference_pressure: float = quantity("Pa", "pressure P_0 of the density", low=0.0, high=1e8)
    viscosity: float = quantity("Pa*s", "dynamic viscosity η_0", low=1e-5, high=10.0)
    viscosity_temperature: float = quantity("K", "temperature of η_0", low=200.0, high=500.0)
    viscosity_decay: float = quantity("1/K", "viscosity-temperature coefficient λ_1", low=0.0, high=0.2)


@dataclass(frozen=True)
class Oil:
    """An oil: its data sheet and the viscosity-pressure coefficient against temperature, shapes (n,) [K], [1/Pa]."""

    parameters: OilParameters
    temperatures: tuple[float, ...]
    coefficients: tuple[float, ...]

    @classmethod
    def from_mapping(cls, mapping: Mapping[str, Any], where: str) -> Oil:
        """Build from a YAML mapping with the keys oil and pressure_viscosity (lists temperature, coefficient)."""
        keys = ("oil", "pressure_viscosity")
        strict_keys(mapping, keys, where, keys, kind="key")
        table = mapping["pressure_viscosity"]
        try:
            temperatures = tuple(float(t) for t in table["temperature"])
            coefficients = tuple(float(a) for a in table["coefficient"])
        except (KeyError, TypeError, ValueError):
            raise ShakeError(f"{where}: pressure_viscosity: expected lists temperature and coefficient") from None
        if not temperatures or len(temperatures) != len(coefficients) or np.any(np.diff(temperatures) <= 0.0):
            raise ShakeError(f"{where}: pressure_viscosity: expected rising temperatures with a coefficient each")
        return cls(OilParameters.from_mapping(mapping["oil"], f"{where}: oil"), temperatures, coefficients)

    def viscosity(self, temperature: float, pressure: float) -> float:
        """Dynamic viscosity by (2.4) and (2.5); `pressure` above atmospheric [Pa·s]."""
        p = self.parameters
        eta = viscosity_at_temperature(p.viscosity, p.viscosity_decay, temperature, p.viscosity_temperature)
        alpha = viscosity_coefficient(temperature, np.array(self.temperatures), np.array(self.coefficients))
        return float(viscosity_at_pressure(eta, alpha, pressure))

    def density(self, temperature: float, pressure: float) -> float:
        """Density by (2.21) [kg/m³]."""
        p = self.parameters
        return float(
            density_at_both(
                p.density,
                p.expansion,
                p.compressibility,
                pressure,
                temperature,
                p.reference_pressure,
                p.reference_temperature,
            )
        )


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
