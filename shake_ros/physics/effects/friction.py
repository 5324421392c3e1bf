"""What friction may have beyond the declared law: by direction, place, deflection, film and speed."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from shake_ros.compiled import njit
from shake_ros.physics.effects.effect import Effect
from shake_ros.quantities import quantity


@dataclass(frozen=True)
class FrictionAsymmetry(Effect):
    """Dry friction that differs with direction.

    Friction that differs with the direction of motion: a one-sided seal, a tilted guide.

        dry force → dry force · (1 + a sign(v))

    On a force-driven axis the viscous part differs by the same share; there the offset carries what the dry part
    alone has. Absent at a = 0.
    """

    place: ClassVar[str] = "friction"
    depends_on: ClassVar[tuple[str, ...]] = ("direction",)
    models: ClassVar[tuple[str, ...]] = ("full", "reduced", "axis")

    asymmetry: float = quantity("-", "relative excess of dry friction for v > 0", low=-1.0, high=1.0, default=0.0)


@dataclass(frozen=True)
class PositionDependentFriction(Effect):
    """Dry friction that varies along the stroke.

    Friction that varies along the stroke: worn mid-stroke, a bent rod or a tight guide at one end.

        dry force → dry force + (c_1 x + c_2 x²) sign(v), held from below at zero dry force

    Absent at c_1 = c_2 = 0.
    """

    place: ClassVar[str] = "friction"
    depends_on: ClassVar[tuple[str, ...]] = ("position", "direction")
    models: ClassVar[tuple[str, ...]] = ("full", "reduced", "axis")

    gradient: float = quantity("N/m", "change of the dry friction per position c_1", low=-1e6, high=1e6, default=0.0)
    curvature: float = quantity("N/m^2", "change per squared position c_2", low=-1e8, high=1e8, default=0.0)


@njit
def dry_level(p, level, position):
    """Dry friction at a position, from its level at mid-stroke [N]."""
    gradient, curvature = p.position_dependent_friction_gradient, p.position_dependent_friction_curvature
    return max(level + (gradient + curvature * position) * position, 0.0)


@dataclass(frozen=True)
class PreslidingFriction(Effect):
    """Elastic pre-sliding displacement.

    Elastic displacement before sliding: the asperities act as a spring until they break away (Dahl, LuGre (3.42)).

        ds/dx = (1 − s sign(ẋ)) / z_s,  dry force = level · s,  |s| ≤ 1

    z_s is the sliding distance in which the force builds up: stiffness at rest = level / z_s. The law does not
    depend on rate, so s follows exactly from the displacement since the last step, s = ±1 + (s_0 ∓ 1)
    exp(−|Δx|/z_s), and stays harmless at any stiffness. Absent at z_s = 0, where s is the smooth sign of the
    velocity.
    """

    place: ClassVar[str] = "friction"
    depends_on: ClassVar[tuple[str, ...]] = ("position", "direction")
    models: ClassVar[tuple[str, ...]] = ("full", "axis")

    distance: float = quantity(
        "m", "displacement z_s in which the dry friction builds up", low=0.0, high=1e-2, default=0.0
    )


@njit
def deflection(start, displacement, distance):
    """Relative deflection s after a displacement, exact for motion one way [-]."""
    end = 1.0 if displacement > 0.0 else -1.0
    return end + (start - end) * math.exp(-abs(displacement) / distance)


@dataclass(frozen=True)
class FilmFriction(Effect):
    """Dry friction that a slowly built film lowers.

    Lubricant film that builds up while sliding and decays late: friction lags the velocity (after (3.45)–(3.51)).

        τ ḣ = min((|v|/v_b)^(2/3), 1) − h,  dry force → dry force · (1 − k h)

    v_b is the velocity of the full film. Absent at k = 0.
    """

    place: ClassVar[str] = "friction"
    depends_on: ClassVar[tuple[str, ...]] = ("velocity", "time")

    relief: float = quantity(
        "-", "share k of the dry friction that a full film removes", low=-2.0, high=0.95, default=0.0
    )
    full_film_velocity: float = quantity("m/s", "velocity v_b of the full film", low=1e-3, high=2.0, default=0.25)
    time_constant: float = quantity("s", "time constant τ of the film", low=1e-3, high=60.0, default=0.05)


@njit
def steady_film(p, velocity):
    """h of a steady velocity [-]."""
    return min((abs(velocity) / p.film_friction_full_film_velocity) ** (2.0 / 3.0), 1.0)


@njit
def film_rate(p, film, velocity):
    """dh/dt [1/s]."""
    return (steady_film(p, velocity) - film) / p.film_friction_time_constant


@njit
def film_after(p, velocity, dt):
    """h after a motion from rest.

    Parameters
    ----------
    velocity : held over each sample, shape (n,) [m/s]. dt : [s].
    """
    film, kept = 0.0, math.exp(-dt / p.film_friction_time_constant)
    for k in range(len(velocity)):
        steady = steady_film(p, velocity[k])
        film = steady + (film - steady) * kept
    return film


@dataclass(frozen=True)
class QuadraticDrag(Effect):
    """Drag quadratic in velocity.

    Drag that grows with the square of the velocity: oil pushed through passages, air on a large specimen.

        F_d = c |v| v

    Absent at c = 0.
    """

    place: ClassVar[str] = "friction"
    depends_on: ClassVar[tuple[str, ...]] = ("velocity",)
    models: ClassVar[tuple[str, ...]] = ("full", "reduced", "axis")

    coefficient: float = quantity("N*s^2/m^2", "drag coefficient c", low=0.0, high=1e6, default=0.0)


@dataclass(frozen=True)
class CoulombFriction(Effect):
    """Dry friction of a model declared without.

    Dry friction where the declared model has none at all (the reduced model (6.36)).

        force −F_c sign(v), with the smooth sign of friction/tustin.py

    Absent at F_c = 0. In the full model the declared Tustin law carries it.
    """

    place: ClassVar[str] = "friction"
    depends_on: ClassVar[tuple[str, ...]] = ("direction",)
    models: ClassVar[tuple[str, ...]] = ("reduced",)

    force: float = quantity("m/s^2", "Coulomb force per moved mass", low=0.0, high=1e3, default=0.0)
