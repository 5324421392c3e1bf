"""The law that a record asks for: one compiled function per quantity, chosen by the law's number.

The number is compared within a step, nothing is looked up by name; the declared law, Tustin's, is asked for first.
One compilation serves all laws.
"""

from __future__ import annotations

from shake_ros.core.compiled import njit
from shake_ros.core.friction import (
    armstrong,
    bo_pavelescu,
    coulomb_viscous_static,
    hess_soom,
    lugre,
    marton_lantos,
    modified_lugre,
    new_modified_lugre,
    none,
    tustin,
)
from shake_ros.core.friction.law import FIRST_DYNAMIC

tustin_level, direction = tustin.level, tustin.direction


@njit
def is_dynamic(p):
    """Whether the law has a contact state z."""
    return p.friction_kind >= FIRST_DYNAMIC


@njit
def has_memory(p):
    """Whether the law has a continuous state beside z: Armstrong's lagged speed or the film."""
    kind = p.friction_kind
    return kind == armstrong.CODE or kind == modified_lugre.CODE or kind == new_modified_lugre.CODE


@njit
def has_film(p):
    """Whether that state is a film."""
    kind = p.friction_kind
    return kind == modified_lugre.CODE or kind == new_modified_lugre.CODE


@njit
def curve_level(p, velocity):
    """Dry level of a law that is a curve F(v) [N]."""
    kind = p.friction_kind
    if kind == tustin.CODE:
        return tustin_level(velocity, p.friction_coulomb_level, p.friction_stribeck_rise, p.friction_stribeck_decay)
    if kind == coulomb_viscous_static.CODE:
        return coulomb_viscous_static.level(p, velocity)
    if kind == hess_soom.CODE:
        return hess_soom.level(p, velocity)
    if kind == bo_pavelescu.CODE:
        return bo_pavelescu.level(p, velocity)
    if kind == marton_lantos.CODE:
        return marton_lantos.level(p, velocity)
    return 0.0


@njit
def curve_direction(p, velocity):
    """Smooth sign of the velocity of a law that is a curve [-]."""
    if p.friction_kind == none.CODE:
        return 0.0
    return direction(velocity, p.friction_transition_velocity)


@njit
def viscous_coefficient(p, velocity):
    """Coefficient which times v is the viscous part [N·s/m]."""
    kind = p.friction_kind
    if kind == tustin.CODE:
        return p.friction_viscous
    if kind == coulomb_viscous_static.CODE:
        return coulomb_viscous_static.viscous_coefficient(p, velocity)
    if kind > armstrong.CODE:
        return lugre.viscous_coefficient(p, velocity)
    return p.friction_viscous


@njit
def inertia(p, velocity):
    """Mass by which the law acts on the piston, (3.52) [kg]."""
    return new_modified_lugre.inertia(p, velocity) if p.friction_kind == new_modified_lugre.CODE else 0.0


@njit
def contact_level(p, velocity, memory, rise):
    """Dry level of a law with a contact state: g(v, h), or Armstrong's level under F_s = `rise` [N]."""
    if p.friction_kind == armstrong.CODE:
        return armstrong.level(p, memory, rise)
    return lugre.level(p, velocity, memory if has_film(p) else 0.0)


@njit
def contact_deflection(p, z, displacement, velocity_start, velocity, memory_start, memory, rise):
    """Contact state z after a displacement one way [m]."""
    if p.friction_kind == armstrong.CODE:
        return armstrong.deflection(p, z, displacement, memory, rise)
    if has_film(p):
        return lugre.deflection(p, z, displacement, velocity_start, velocity, memory_start, memory)
    return lugre.deflection(p, z, displacement, velocity_start, velocity, 0.0, 0.0)


@njit
def micro_damping(p, velocity, share):
    """σ_1 ż with the contact force over its level = `share` [N]."""
    return 0.0 if p.friction_kind == armstrong.CODE else lugre.micro_damping(p, velocity, share)


@njit
def memory_rate(p, velocity, memory):
    """Rate of the lagged speed [m/s²] or of the film [1/s]."""
    if p.friction_kind == armstrong.CODE:
        return armstrong.memory_rate(p, velocity, memory)
    return modified_lugre.memory_rate(p, velocity, memory) if has_film(p) else 0.0


@njit
def steady_memory(p, velocity):
    """The memory under a velocity that lasts: |v| [m/s] or h_ss [-]."""
    if p.friction_kind == armstrong.CODE:
        return abs(velocity)
    return modified_lugre.steady_film(p, velocity) if has_film(p) else 0.0


@njit
def steady_force(p, velocity):
    """Friction force under a velocity that lasts, the Stribeck curve of any law [N]."""
    viscous = viscous_coefficient(p, velocity) * velocity
    if not is_dynamic(p):
        return curve_level(p, velocity) * curve_direction(p, velocity) + viscous
    if velocity == 0.0:
        return 0.0
    level = contact_level(p, velocity, steady_memory(p, velocity), p.friction_stribeck_rise)
    return (level if velocity > 0.0 else -level) + viscous
