"""One record for every friction law, see core/packing.py."""

from __future__ import annotations

from typing import Any

from shake_ros.core.friction import FRICTIONS
from shake_ros.core.friction.law import FrictionLaw
from shake_ros.core.packing import record


def friction_record(law: FrictionLaw) -> Any:
    """The law alone as a record that the kernels of this folder take."""
    return record("friction", FRICTIONS, law)
