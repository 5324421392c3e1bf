"""Lubricant film that builds up while sliding and decays late: friction lags the velocity (after (3.45)–(3.51)).

    τ ḣ = min((|v|/v_b)^(2/3), 1) − h,  dry force → dry force · (1 − k h)

v_b is the velocity of the full film. Absent at k = 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from shake_ros.core.compiled import njit
from shake_ros.core.effects.effect import Effect
from shake_ros.core.quantities import quantity


@dataclass(frozen=True)
class FilmFriction(Effect):
    """Dry friction that a slowly built film lowers."""

    place: ClassVar[str] = "friction"
    depends_on: ClassVar[tuple[str, ...]] = ("velocity", "time")

    relief: float = quantity(
        "-", "part k of the dry friction that a full film takes away", low=-2.0, high=0.95, default=0.0
    )
    full_film_velocity: float = quantity("m/s", "velocity v_b of the full film", low=1e-3, high=2.0, default=0.25)
    time_constant: float = quantity("s", "time constant τ of the film", low=1e-3, high=60.0, default=0.05)


@njit
def film_rate(film, velocity, full_film_velocity, time_constant):
    """dh/dt [1/s]."""
    steady = min((abs(velocity) / full_film_velocity) ** (2.0 / 3.0), 1.0)
    return (steady - film) / time_constant
