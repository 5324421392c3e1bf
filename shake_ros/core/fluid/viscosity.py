"""Viscosity falls exponentially with temperature and rises exponentially with pressure, (2.3)–(2.5), table 2.1.

Range: mineral oils, λ_1 = 0.036 … 0.057 1/K; the coefficient α of HLP 32 between 0 and 100 °C. Table 2.1 is headed
"10⁻² 1/Pa", which would double the viscosity at 20 Pa; 10⁻⁸ 1/Pa is meant (as in every table of mineral oils) and used.
Source: thesis, section 2.2. Verified against hand values and the ISO viscosity grade of the oil.
"""

from __future__ import annotations

import numpy as np

from shake_ros.core.compiled import njit


@njit
def kinematic(eta, rho):
    """ν = η/ρ (2.3) [m²/s]."""
    return eta / rho


@njit
def at_temperature(eta_0, lambda_1, temperature, reference_temperature):
    """Dynamic viscosity at a temperature (2.4) [Pa·s].

    >>> round(float(at_temperature(0.04, 0.05, 333.15, 313.15)), 6)  # 0.04 exp(-1)
    0.014715
    """
    return eta_0 * np.exp(-lambda_1 * (temperature - reference_temperature))  # (2.4)


@njit
def at_pressure(eta_0, alpha, pressure):
    """Dynamic viscosity at a pressure above atmospheric (2.5) [Pa·s]."""
    return eta_0 * np.exp(alpha * pressure)  # (2.5)


def pressure_coefficient(temperature: float, temperatures: np.ndarray, coefficients: np.ndarray) -> float:
    """α of (2.5) at a temperature, linear between the rows of a table such as 2.1, held beyond its ends [1/Pa].

    Parameters
    ----------
    temperature : [K].
    temperatures : rising, shape (n,) [K].
    coefficients : shape (n,) [1/Pa].
    """
    return float(np.interp(temperature, temperatures, coefficients))
