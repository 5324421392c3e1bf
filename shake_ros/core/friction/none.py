"""No friction at all: F = 0. For frictionless bearings, and as the reference of a comparison."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from shake_ros.core.friction.law import FrictionLaw

CODE = 1


@dataclass(frozen=True)
class NoFriction(FrictionLaw):
    """No parameters."""

    code: ClassVar[int] = CODE
