"""More hysteresis of the valve than its catalogue tells: dry friction on the spool or a torque motor losing strength.

The half-width adds to the declared f_hs of (3.19) and acts as it does: dry friction on the spool
(plant/spool_path.py), with the detailed valve and the reduced table a play of the command. Absent at 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from shake_ros.core.effects.effect import Effect
from shake_ros.core.quantities import quantity


@dataclass(frozen=True)
class SpoolHysteresis(Effect):
    """Hysteresis of the valve beyond the declared one."""

    place: ClassVar[str] = "valve"
    depends_on: ClassVar[tuple[str, ...]] = ("valve_opening", "direction")
    models: ClassVar[tuple[str, ...]] = ("full", "reduced")

    width: float = quantity("-", "additional hysteresis half-width", low=0.0, high=0.3, default=0.0)
