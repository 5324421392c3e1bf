"""What every law of the bulk modulus has: a number of its own, parameters, what makes it stiffer; and a constant one.

A law's file has a compiled `bulk_modulus(p, pressure)`, the modulus at an absolute pressure above zero; `p` is the
record of a table or of the law alone, with fields `bulk_modulus_NAME`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from shake_ros.compiled import njit
from shake_ros.quantities import Parameters, quantity

STANDARD_PRESSURE = 1.0e5  # [Pa] at which free air is counted where a law has no pressure of its own for it


@dataclass(frozen=True, kw_only=True)
class BulkModulusLaw(Parameters):
    """Base of the laws E(P)."""

    code: ClassVar[int]
    stiffness: ClassVar[tuple[str, ...]] = ("modulus",)  # fields that together are in proportion to the liquid's E
    compliance: ClassVar[tuple[str, ...]] = ()  # or to 1/E

    def scaled(self, factor: float) -> dict[str, float]:
        """Fields of the law with the liquid stiffer by a factor, by name."""
        stiffer = {name: factor * getattr(self, name) for name in self.stiffness}
        return stiffer | {name: getattr(self, name) / factor for name in self.compliance}


@dataclass(frozen=True, kw_only=True)
class LawWithoutAir(BulkModulusLaw):
    """Base of the laws that count no free air."""

    reference_pressure: float = quantity(
        "Pa", "pressure P_0 at which an effect counts free air", low=0.0, high=1e8, default=STANDARD_PRESSURE
    )


@dataclass(frozen=True, kw_only=True)
class LiquidWithAir(BulkModulusLaw):
    """Base of the laws of a constant liquid with air."""

    modulus: float = quantity("Pa", "bulk modulus Ē of the liquid without air", low=1e6, high=1e11)
    fraction: float = quantity("-", "volume fraction α of free air at P_0", low=0.0, high=0.3)
    polytropic_exponent: float = quantity("-", "polytropic exponent κ of the air", low=0.3, high=2.0)
    reference_pressure: float = quantity("Pa", "initial pressure P_0", low=1e3, high=1e7)


CONSTANT = 0


@dataclass(frozen=True, kw_only=True)
class Constant(BulkModulusLaw):
    """The same E at every pressure: the `none` of this family, and the law of a table that names none."""

    code: ClassVar[int] = CONSTANT

    modulus: float = quantity("Pa", "bulk modulus E (θ_5 V_t/2)", low=1e6, high=1e11, live=True)
    reference_pressure: float = quantity("Pa", "pressure P_0 at which E holds", low=0.0, high=1e8)


@njit
def bulk_modulus(p, pressure):
    """E of `Constant` at any pressure [Pa]."""
    return p.bulk_modulus_modulus
