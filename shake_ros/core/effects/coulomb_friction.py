"""Dry friction where the declared model has none at all (the reduced model (6.36)).

    force −F_c sign(v), with the smooth sign of friction/tustin.py

Absent at F_c = 0. In the full model the declared Tustin law carries it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from shake_ros.core.effects.effect import Effect
from shake_ros.core.quantities import quantity


@dataclass(frozen=True)
class CoulombFriction(Effect):
    """Dry friction of a model declared without."""

    place: ClassVar[str] = "friction"
    depends_on: ClassVar[tuple[str, ...]] = ("direction",)
    models: ClassVar[tuple[str, ...]] = ("reduced",)

    force: float = quantity("m/s^2", "Coulomb force per moved mass", low=0.0, high=1e3, default=0.0)
