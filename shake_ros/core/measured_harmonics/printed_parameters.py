"""The parameters of the full model as table 6.9 of the thesis prints them, in the names of a table.

The print gives the friction's levels as forces, the Stribeck velocity and λ_1, λ_2 of the thesis's soft zone; a table
has the rise above the Coulomb level, the decay 1/v_s, and the soft zone's relative depth. P_0 is printed without a
unit; it is read in bar.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from shake_ros.core.quantities import Parameters, quantity


@dataclass(frozen=True)
class PrintedParameters(Parameters):
    """One column of table 6.9; the column without a soft zone has λ_1 = 1 and λ_2 = 0."""

    internal_leakage: float = quantity("m^3/(s*Pa)", "C_i", low=0.0, high=1e-6)
    external_leakage: float = quantity("m^3/(s*Pa)", "C_e", low=0.0, high=1e-6)
    coulomb_force: float = quantity("N", "F_c", low=0.0, high=1e6)
    static_force: float = quantity("N", "F_s", low=0.0, high=1e6)
    viscous: float = quantity("N*s/m", "F_v", low=0.0, high=1e6)
    stribeck_velocity: float = quantity("m/s", "v_s", low=1e-6, high=10.0)
    modulus: float = quantity("Pa", "E_0", low=1e6, high=1e11)
    reference_pressure: float = quantity("Pa", "P_0", low=1e3, high=1e8)
    slope: float = quantity("-", "m", low=0.0, high=300.0)
    air_fraction: float = quantity("-", "α", low=0.0, high=0.3)
    polytropic_exponent: float = quantity("-", "κ", low=0.3, high=2.0)
    lambda_1: float = quantity("-", "λ_1", low=0.01, high=100.0)
    lambda_2: float = quantity("-", "λ_2", low=0.0, high=100.0)
    sharpness: float = quantity("1/Pa", "μ", low=1e-7, high=1e-4)
    threshold: float = quantity("Pa", "P_Lt", low=1e4, high=1e7)

    def values(self) -> dict[str, float]:
        """The same by dotted names of a table.

        λ_1 multiplies the liquid's modulus and its slope; the air's share stays as it is, which at the printed α is
        below 2 % of the compliance from 10 bar on.
        """
        depth = 2.0 * self.lambda_2 / self.lambda_1 * math.tanh(self.sharpness * self.threshold)  # (6.20)
        return {
            "leakage.internal": self.internal_leakage,
            "leakage.external": self.external_leakage,
            "friction.coulomb_level": self.coulomb_force,
            "friction.stribeck_rise": self.static_force - self.coulomb_force,
            "friction.stribeck_decay": 1.0 / self.stribeck_velocity,
            "friction.viscous": self.viscous,
            "bulk_modulus.modulus": self.lambda_1 * self.modulus,
            "bulk_modulus.reference_pressure": self.reference_pressure,
            "effects.pressure_dependent_bulk_modulus.slope": self.lambda_1 * self.slope,
            "effects.entrained_air.fraction": self.air_fraction,
            "effects.entrained_air.polytropic_exponent": self.polytropic_exponent,
            "effects.soft_zone.depth": depth,
            "effects.soft_zone.threshold": self.threshold,
            "effects.soft_zone.sharpness": self.sharpness,
        }
