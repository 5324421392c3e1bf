"""One oil: viscosity and density against pressure and temperature, and the numbers of config/fluid/NAME.yaml.

Viscosity falls exponentially with temperature and rises exponentially with pressure, (2.3)–(2.5), table 2.1.
Range: mineral oils, λ_1 = 0.036 … 0.057 1/K; the coefficient α of HLP 32 between 0 and 100 °C. Table 2.1 is headed
"10⁻² 1/Pa", which would double the viscosity at 20 Pa; 10⁻⁸ 1/Pa is meant (as in every table of mineral oils) and used.
Source: thesis, section 2.2. Verified against hand values and the ISO viscosity grade of the oil.

Density has two families of formulas, (2.7), (2.9), (2.18)–(2.21): the linearised equation of state about a point, (2.7)
with its special case (2.9), and the expressions of data sheets with a heat expansion factor β_T and a compressibility
κ_P, (2.18), (2.19), (2.21). κ_P (2.20) is the inverse of the isothermal bulk modulus. Range: a liquid, |ρ/ρ_0 − 1| of a
few per cent, where both agree to second order. Source: thesis, section 2.3. Verified against each other and by hand.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from shake_ros.core.compiled import njit
from shake_ros.core.quantities import Parameters, ShakeError, quantity, strict_keys


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
