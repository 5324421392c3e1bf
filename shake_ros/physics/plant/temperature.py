"""The table at another oil temperature: the fluid's laws applied to the table's numbers, before a simulation.

    viscous friction ∝ η,  laminar leakage ∝ 1/η,  flow coefficient ∝ 1/√ρ,  laminar pressure ∝ η²/ρ,
    bulk modulus · (1 − γ (T − T_0)),  oil of the pipelines and the pilot stage ∝ η, ρ

η and ρ follow from fluid.py; the laminar pressure is the drop at which the jet of an
edge has its Reynolds number of transition, v d/ν with v = √(2Δp/ρ). γ is a few thousandths per kelvin (Eggerth's
formula gives 3.8e-3 between 20 and 50 °C at 100 bar). The result is a table like any other, so temperature costs a
simulation nothing. A table's file asks for it by its section `fluid`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from shake_ros.physics.fluid import OilParameters, density_at_temperature, viscosity_at_temperature
from shake_ros.physics.plant.parameters import INDEX, TableParameters
from shake_ros.quantities import Parameters, ShakeError, quantity

VISCOUS = ("friction.viscous", "friction.viscous_reverse")
LAMINAR = ("leakage.internal", "leakage.external")


@dataclass(frozen=True)
class OilState(Parameters):
    """The section `fluid` of a table's file beside the name of its oil: how warm it is."""

    temperature: float = quantity("K", "temperature T of the oil", low=233.15, high=423.15)
    reference_temperature: float = quantity("K", "T_0 at which the file's numbers hold", low=233.15, high=423.15)
    modulus_slope: float = quantity("1/K", "relative loss of bulk modulus per temperature γ", low=0.0, high=0.02)


def at_temperature(table: TableParameters, oil: OilParameters, state: OilState) -> TableParameters:
    """`table`, whose numbers hold at the state's reference temperature, at its temperature.

    Parameters
    ----------
    oil : viscosity and density of the fluid.

    Raises
    ------
    ShakeError : a temperature at which nothing of the bulk modulus would be left.
    """
    temperature, reference_temperature = state.temperature, state.reference_temperature
    stiffness = 1.0 - state.modulus_slope * (temperature - reference_temperature)
    if stiffness <= 0.0:
        raise ShakeError(f"temperature = {temperature:g} K: no bulk modulus left, slope {state.modulus_slope:g} 1/K")
    thickness = viscosity_at_temperature(1.0, oil.viscosity_decay, temperature, reference_temperature)
    rho, rho_0 = (
        density_at_temperature(oil.density, oil.expansion, t, oil.reference_temperature)
        for t in (temperature, reference_temperature)
    )
    factors = dict.fromkeys(VISCOUS, float(thickness)) | dict.fromkeys(LAMINAR, 1.0 / float(thickness))
    lighter = float(rho) / float(rho_0)
    factors |= {"valve.flow_coefficient": 1.0 / math.sqrt(lighter), "valve.density": lighter}
    factors["valve.laminar_pressure"] = float(thickness) ** 2 / lighter
    if table.value("pipelines.length") > 0.0:
        factors |= {"pipelines.viscosity": float(thickness), "pipelines.density": lighter}
    values = {name: factor * table.value(name) for name, factor in factors.items() if name in INDEX}
    values |= {f"bulk_modulus.{name}": value for name, value in table.bulk_modulus.scaled(stiffness).items()}
    return table.with_values({name: value for name, value in values.items() if value != table.value(name)})
