"""Armstrong's seven parameters: pre-sliding, Stribeck curve with memory, rising static friction, (3.39)–(3.41).

    stuck    F = k_t z                                                          (3.39)
    sliding  F = [F_C + F_v |v| + F_s(γ, t_d) / (1 + (v(t−τ_L)/x_st)²)] sign(v)  (3.40)
    F_s(γ, t_d) = F_sa + (F_s∞ − F_sa) t_d/(t_d + γ)                             (3.41)

The two regimes are one: z is the elastic displacement of the contact, which follows the piston and is held within
±(dry level)/k_t, so that break-away needs no eighth parameter and is exact for motion one way. (3.40) prints the
denominator without the square, which would let friction jump with the direction; Armstrong's own has it.
The delayed speed v(t−τ_L) is carried as a first-order lag of time constant τ_L. t_d is the time spent stuck; F_sa is
the Stribeck part at the moment of stopping, which the lagged speed keeps below its full value after a quick stop.

Source: thesis (3.39)–(3.41), citing Armstrong-Hélouvry. Verified against the steady curve and (3.41) after a given
dwell.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from shake_ros.compiled import njit
from shake_ros.physics.friction.law import FrictionLaw
from shake_ros.quantities import quantity

ARMSTRONG = 10
STUCK = 1.0 - 1e-9  # share of the level below which the contact sticks


@dataclass(frozen=True)
class Armstrong(FrictionLaw):
    """Parameters of (3.39)–(3.41)."""

    code: ClassVar[int] = ARMSTRONG
    has_memory: ClassVar[bool] = True

    coulomb_level: float = quantity("N", "Coulomb friction force F_C", low=0.0, high=1e5, live=True)
    stribeck_rise: float = quantity("N", "Stribeck friction F_s∞ after a long rest", low=0.0, high=1e5, live=True)
    stribeck_velocity: float = quantity("m/s", "Stribeck velocity x_st", low=1e-6, high=1.0, live=True)
    viscous: float = quantity("N*s/m", "viscous coefficient F_v", low=0.0, high=1e6, live=True)
    contact_stiffness: float = quantity("N/m", "stiffness k_t of the contact before sliding", low=1e4, high=1e10)
    memory_time: float = quantity("s", "time constant τ_L of the frictional memory", low=1e-4, high=1.0)
    rise_time: float = quantity("s", "temporal parameter γ of the rising static friction", low=1e-3, high=1e4)


@njit
def contact_level(p, velocity, lagged_speed, rise):
    """Dry level F_C + F_s/(1 + (v(t−τ_L)/x_st)²) of (3.40) with F_s = `rise` [N]; the velocity itself plays no part."""
    relative = lagged_speed / p.friction_stribeck_velocity
    return p.friction_coulomb_level + rise / (1.0 + relative * relative)


@njit
def contact_deflection(p, start, displacement, velocity_start, velocity, lagged_start, lagged_speed, rise):
    """Elastic displacement z after a displacement of the piston one way (3.39) [m]."""
    largest = contact_level(p, velocity, lagged_speed, rise) / p.friction_contact_stiffness
    return min(max(start + displacement, -largest), largest)


@njit
def memory_rate(p, velocity, lagged_speed):
    """Rate of the lagged speed [m/s²]."""
    return (abs(velocity) - lagged_speed) / p.friction_memory_time


@njit
def steady_memory(p, velocity):
    """The lagged speed under a velocity that lasts [m/s]."""
    return abs(velocity)


@njit
def risen(p, at_stop, dwell):
    """F_s(γ, t_d) (3.41) [N]."""
    return at_stop + (p.friction_stribeck_rise - at_stop) * dwell / (dwell + p.friction_rise_time)


@njit
def dwelt(p, z, lagged_speed, duration, dwell, at_stop, rise):
    """Dwell time t_d [s], F_sa [N] and F_s [N] after a step that ended with z; t_d = 0 while sliding."""
    reached = contact_level(p, 0.0, lagged_speed, rise)
    if abs(p.friction_contact_stiffness * z) >= STUCK * reached:
        return 0.0, at_stop, rise
    if dwell == 0.0:
        at_stop = reached - p.friction_coulomb_level
    dwell += duration
    return dwell, at_stop, risen(p, at_stop, dwell)
