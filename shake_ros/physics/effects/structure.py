"""What acts on the moved mass, or moves with it, beyond the declared model: forces, specimen, coupling, base."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from shake_ros.compiled import njit
from shake_ros.physics.effects.effect import Effect
from shake_ros.physics.valve.simplified import motion_weights
from shake_ros.quantities import quantity


@dataclass(frozen=True)
class ConstantForce(Effect):
    """Steady external force.

    A steady force along the travel: a tilted table, a hanging cable, a counterweight.

        M v̇ = … + F_0

    Absent at F_0 = 0.
    """

    place: ClassVar[str] = "force"
    models: ClassVar[tuple[str, ...]] = ("full", "reduced")

    force: float = quantity("N", "force F_0 along +x", low=-1e5, high=1e5, default=0.0)


@dataclass(frozen=True)
class StiffnessToGround(Effect):
    """Spring between table and ground.

    A spring between table and ground: cables, bellows, a reaction frame left coupled.

        M v̇ = … − k (x + x_b)

    The ground does not move with a base that gives way (`BaseFlexibility`), so the spring sees the absolute
    position. Absent at k = 0.
    """

    place: ClassVar[str] = "force"
    depends_on: ClassVar[tuple[str, ...]] = ("position",)
    models: ClassVar[tuple[str, ...]] = ("full", "reduced", "axis")

    stiffness: float = quantity("N/m", "stiffness k", low=0.0, high=1e8, default=0.0)


@dataclass(frozen=True)
class SpecimenResonance(Effect):
    """Flexible specimen of one storey.

    A flexible specimen: part m_q of the moved mass stands on a spring and damper (one storey).

        q̈ = −a − 2 ζ ω q̇ − ω² q,  table force + m_q (2 ζ ω q̇ + ω² q),  rigid mass M − m_q

    q is the specimen's displacement relative to the table, a the table's absolute acceleration. Absent at m_q = 0.
    """

    place: ClassVar[str] = "structure"
    depends_on: ClassVar[tuple[str, ...]] = ("frequency",)
    models: ClassVar[tuple[str, ...]] = ("full", "reduced")

    mass: float = quantity("kg", "mass m_q that moves on the spring", low=0.0, high=1e5, default=0.0)
    frequency: float = quantity("Hz", "natural frequency on a table at rest", low=0.2, high=200.0, default=8.0)
    damping: float = quantity("-", "damping ratio ζ", low=1e-3, high=1.0, default=0.03)


@njit
def spring_force(p, mass, deflection, rate):
    """Force on the table of a mass that stands on the specimen's spring [N]."""
    omega = 2.0 * math.pi * p.specimen_resonance_frequency
    return mass * omega * (2.0 * p.specimen_resonance_damping * rate + omega * deflection)


@njit
def specimen_after(p, velocity, dt):
    """q [m] and q̇ [m/s] after a motion from rest.

    Parameters
    ----------
    velocity : of the table, even between samples, shape (n,) [m/s]. dt : [s].
    """
    omega = 2.0 * math.pi * p.specimen_resonance_frequency
    a, b, c = motion_weights(omega, p.specimen_resonance_damping, dt)
    q, rate = 0.0, 0.0
    for k in range(1, len(velocity)):
        rest = (velocity[k - 1] - velocity[k]) / dt / omega**2  # about which it rings
        away = q - rest
        q, rate = rest + a * away + b * rate, c * rate - omega**2 * b * away
    return q, rate


@dataclass(frozen=True)
class CouplingBacklash(Effect):
    """Backlash between piston rod and table.

    Backlash between piston rod and table: a worn clevis or spherical bearing.

    The rod moves by δ relative to the table; beyond half the gap g a stiff spring with a damper carries the force.

        F_c = k_g dz(δ) + c δ̇ in contact, m_r v̇_r = A_p P_L − friction − F_c, (M − m_r) v̇ = F_c
        k_g = k (1 + q), ζ_g = ζ + (1 − ζ) q/(1 + q), q = (g_s/g)²

    Friction acts on the rod (seals). Absent at g = 0, where rod and table are one body. A joint without backlash is as
    stiff as the rod and does not rattle, so the contact stiffens below g_s = 5 µm, critically damped in the end,
    and the limit of a small gap is the rigid joint of the declared model: no jump at the value at which the effect
    is absent. From 20 µm on k_g is k to within a few per cent. Verified against the same two bodies written a
    second time and Radau, and against the declared model as g → 0.
    """

    place: ClassVar[str] = "structure"
    depends_on: ClassVar[tuple[str, ...]] = ("load_pressure", "direction")

    gap: float = quantity("m", "total backlash g", low=0.0, high=1e-2, default=0.0)
    stiffness: float = quantity("N/m", "contact stiffness k", low=1e5, high=1e9, default=5e7)
    rod_mass: float = quantity("kg", "mass m_r on the piston's side of the backlash", low=1.0, high=300.0, default=30.0)
    damping: float = quantity("-", "damping ratio of the contact on the rod's mass", low=0.0, high=2.0, default=0.2)


STIFFENING_GAP = 5e-6  # g_s [m]
NO_GAP = 1e-7  # [m] below it rod and table count as one body; the joint would be 2500 times stiffer than its contact


@njit
def has_backlash(gap):
    """Whether rod and table are two bodies."""
    return gap > NO_GAP


@njit
def contact_force(p, rod_mass, deflection, rate):
    """Force of the rod on the table [N]; never pulls while contact is being lost."""
    gap, damping = p.coupling_backlash_gap, p.coupling_backlash_damping
    half = 0.5 * gap
    closing = (STIFFENING_GAP / gap) ** 2
    stiffness = p.coupling_backlash_stiffness * (1.0 + closing)
    damping += max(1.0 - damping, 0.0) * closing / (1.0 + closing)
    coefficient = 2.0 * damping * math.sqrt(stiffness * rod_mass)
    if deflection > half:
        return max(stiffness * (deflection - half) + coefficient * rate, 0.0)
    if deflection < -half:
        return min(stiffness * (deflection + half) + coefficient * rate, 0.0)
    return 0.0


@dataclass(frozen=True)
class BaseFlexibility(Effect):
    """Foundation that moves under the reaction.

    The reaction mass or foundation is compliant: position is measured to a base that moves itself.

        m_b ẍ_b = −F − k_b x_b − c ẋ_b,  v̇ = F/M − ẍ_b,  accelerometer: v̇ + ẍ_b

    with k_b = 1/compliance, m_b = k_b/(2π f)². Absent at compliance 0.
    """

    place: ClassVar[str] = "structure"
    depends_on: ClassVar[tuple[str, ...]] = ("frequency",)

    compliance: float = quantity("m/N", "static compliance of the base", low=0.0, high=1e-4, default=0.0)
    frequency: float = quantity("Hz", "natural frequency of the base", low=0.5, high=200.0, default=12.0)
    damping: float = quantity("-", "damping ratio of the base", low=1e-3, high=1.0, default=0.05)


@njit
def base_acceleration(p, displacement, velocity, force):
    """ẍ_b under the actuator force [m/s²]."""
    omega = 2.0 * math.pi * p.base_flexibility_frequency
    stretch = p.base_flexibility_compliance * force + displacement
    return -omega * (omega * stretch + 2.0 * p.base_flexibility_damping * velocity)


@dataclass(frozen=True)
class PayloadError(Effect):
    """Moved mass other than declared.

        M → M + Δm

    Absent at Δm = 0.
    """

    place: ClassVar[str] = "structure"

    mass: float = quantity("kg", "mass Δm beyond the declared one", low=-2e3, high=1e4, default=0.0)
