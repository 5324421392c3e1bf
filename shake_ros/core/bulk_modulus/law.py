"""What every law of the bulk modulus has: a number of its own, parameters, and what makes it stiffer as a whole.

A law's file has a compiled `bulk_modulus(p, pressure)`, the modulus at an absolute pressure above zero; `p` is the
record of a table or of the law alone, with fields `bulk_modulus_NAME`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from shake_ros.core.quantities import Parameters

STANDARD_PRESSURE = 1.0e5  # [Pa] at which free air is counted where a law has no pressure of its own for it


@dataclass(frozen=True)
class BulkModulusLaw(Parameters):
    """Base of the laws E(P)."""

    code: ClassVar[int]
    stiffness: ClassVar[tuple[str, ...]] = ("modulus",)  # fields that together are in proportion to the liquid's E
    compliance: ClassVar[tuple[str, ...]] = ()  # or to 1/E

    def scaled(self, factor: float) -> dict[str, float]:
        """Fields of the law with the liquid stiffer by a factor, by name."""
        stiffer = {name: factor * getattr(self, name) for name in self.stiffness}
        return stiffer | {name: getattr(self, name) / factor for name in self.compliance}
