"""Tables around a declared one: its parameters multiplied by seeded factors, with a dead time of their own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from shake_ros.core.plant.parameters import TableParameters
from shake_ros.core.quantities import Parameters, ShakeError, quantity

DEAD_TIME = "effects.command_delay.delay"


@dataclass(frozen=True)
class Spread(Parameters):
    """Bounds of the factors, drawn evenly between them; those of one group share a draw."""

    bulk_modulus_low: float = quantity("-", "least factor of the bulk modulus", low=0.05, high=1.0)
    bulk_modulus_high: float = quantity("-", "largest factor of the bulk modulus", low=1.0, high=20.0)
    friction_low: float = quantity("-", "least factor of all friction levels", low=0.0, high=1.0)
    friction_high: float = quantity("-", "largest factor of all friction levels", low=1.0, high=100.0)
    supply_low: float = quantity("-", "least factor of the supply pressure", low=0.05, high=1.0)
    supply_high: float = quantity("-", "largest factor of the supply pressure", low=1.0, high=4.0)
    leakage_low: float = quantity("-", "least factor of both leakages", low=0.0, high=1.0)
    leakage_high: float = quantity("-", "largest factor of both leakages", low=1.0, high=100.0)
    delay_low: float = quantity("s", "least dead time of the command", low=0.0, high=0.05)
    delay_high: float = quantity("s", "largest dead time of the command", low=0.0, high=0.05)


GROUPS: Mapping[str, tuple[str, ...]] = {
    "bulk_modulus": ("bulk_modulus.modulus",),  # or what another law has in its place, `BulkModulusLaw.scaled`
    "friction": ("friction.coulomb_level", "friction.stribeck_rise", "friction.viscous"),
    "supply": ("supply.supply_pressure",),
    "leakage": ("leakage.internal", "leakage.external"),
}


def perturbed(table: TableParameters, spread: Spread, count: int, seed: int) -> list[TableParameters]:
    """Tables with factors of the same seed; the first k of n are those that a call for k gives.

    Raises
    ------
    ShakeError : delay_low above delay_high, or a factor that takes a parameter out of its bounds.
    """
    if spread.delay_low > spread.delay_high:
        raise ShakeError(f"spread: delay_low = {spread.delay_low:g} is above delay_high = {spread.delay_high:g} s")
    drawn = np.random.Generator(np.random.Philox(key=seed)).uniform(size=(count, len(GROUPS) + 1))
    result = []
    for row in drawn:
        values = {}
        for share, (group, names) in zip(row, GROUPS.items(), strict=False):
            low, high = getattr(spread, f"{group}_low"), getattr(spread, f"{group}_high")
            factor = low + (high - low) * float(share)
            if group == "bulk_modulus":
                values.update({f"{group}.{name}": v for name, v in table.bulk_modulus.scaled(factor).items()})
            else:
                values.update({name: table.value(name) * factor for name in names})
        values[DEAD_TIME] = spread.delay_low + (spread.delay_high - spread.delay_low) * float(row[-1])
        result.append(table.with_values(values))
    return result
