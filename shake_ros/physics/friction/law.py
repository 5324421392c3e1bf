"""What every friction law has: a number of its own by which compiled code knows it, and parameters of one vocabulary.

A law is written in three quantities that the plant puts together with the friction effects, see `__init__.py`:

    F = level · s + F_micro + f_v(v) v

`level` [N] is the dry force at this velocity; s [-] is how much of it acts and in which direction: the smooth
sign of the velocity for a curve F(v), the bristle force over the level for a law with a contact state; F_micro [N]
is the damping of the bristles and f_v the viscous coefficient. Laws of one concept use one name, so all laws share
the fields of one record.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from shake_ros.quantities import Parameters, quantity

FIRST_DYNAMIC = 10  # laws with a contact state have this number or a higher one


@dataclass(frozen=True)
class FrictionLaw(Parameters):
    """Base of the friction laws."""

    code: ClassVar[int]
    has_memory: ClassVar[bool] = False  # a continuous state beside the contact's: film, lagged speed


NONE = 1


@dataclass(frozen=True)
class NoFriction(FrictionLaw):
    """No parameters."""

    code: ClassVar[int] = NONE


@dataclass(frozen=True)
class CurveWithStaticLevel(FrictionLaw):
    """Base of the laws that are a curve from a break-away force down to the Coulomb force."""

    coulomb_level: float = quantity("N", "Coulomb friction force F_C", low=0.0, high=1e5, live=True)
    static_level: float = quantity("N", "break-away force F_s", low=0.0, high=1e5, live=True)
    stribeck_velocity: float = quantity("m/s", "Stribeck velocity v_s", low=1e-6, high=1.0, live=True)
    viscous: float = quantity("N*s/m", "viscous coefficient F_v", low=0.0, high=1e6, live=True)
    transition_velocity: float = quantity("m/s", "width of the smooth sign at rest", low=1e-6, high=0.1)
