"""The numbers of one oil, as config/fluid/NAME.yaml holds them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from shake_ros.core.fluid import density, viscosity
from shake_ros.core.quantities import Parameters, ShakeError, quantity, strict_keys


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
        eta = viscosity.at_temperature(p.viscosity, p.viscosity_decay, temperature, p.viscosity_temperature)
        alpha = viscosity.pressure_coefficient(temperature, np.array(self.temperatures), np.array(self.coefficients))
        return float(viscosity.at_pressure(eta, alpha, pressure))

    def density(self, temperature: float, pressure: float) -> float:
        """Density by (2.21) [kg/m³]."""
        p = self.parameters
        return float(
            density.at_pressure_and_temperature(
                p.density,
                p.expansion,
                p.compressibility,
                pressure,
                temperature,
                p.reference_pressure,
                p.reference_temperature,
            )
        )
