"""What every effect has: parameters whose defaults are the values at which it is absent, its place, its dependence."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from shake_ros.quantities import Parameters

PLACES = ("valve", "flow", "supply", "compressibility", "friction", "force", "structure", "sensor", "timing")


@dataclass(frozen=True)
class Effect(Parameters):
    """Base of the effects a declared model may lack.

    The first field is the effect's strength: at its default the effect is absent, whatever the others are.
    """

    place: ClassVar[str]
    depends_on: ClassVar[tuple[str, ...]] = ()
    models: ClassVar[tuple[str, ...]] = ("full",)
