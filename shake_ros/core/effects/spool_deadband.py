"""A dead band of the spool: worn or overlapped lands let no flow through until the spool has moved `width`.

    x_e = sign(x_s) max(|x_s| − w, 0)
    d_e = d_s − c min(w, d_s)          for an underlap d_s > 0

Lands that are wider by more than the underlap close the centre of the valve (c = 1); a dead band of the valve's
electronics leaves it open (c = 0). Absent at w = 0. Merritt, Hydraulic Control Systems, chapter 5 (overlapped spool).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from shake_ros.core.compiled import njit
from shake_ros.core.effects.effect import Effect
from shake_ros.core.quantities import quantity


@dataclass(frozen=True)
class SpoolDeadband(Effect):
    """Dead band of the spool about its null."""

    place: ClassVar[str] = "valve"
    depends_on: ClassVar[tuple[str, ...]] = ("valve_opening",)
    models: ClassVar[tuple[str, ...]] = ("full", "reduced")

    width: float = quantity("-", "spool travel without flow on each side of null", low=0.0, high=0.3, default=0.0)
    closed: float = quantity("-", "part of the underlap that it closes", low=0.0, high=1.0, default=1.0)


@njit
def effective_spool(spool, width):
    """Spool position that the ports see [-]."""
    if spool > width:
        return spool - width
    if spool < -width:
        return spool + width
    return 0.0


@njit
def effective_underlap(underlap, width, closed):
    """Underlap of the ports that a dead band leaves [-].

    >>> effective_underlap(0.005, 0.02, 1.0), effective_underlap(0.005, 0.002, 0.5), effective_underlap(-0.01, 0.1, 1.0)
    (0.0, 0.004, -0.01)
    """
    return underlap - closed * min(width, max(underlap, 0.0))
