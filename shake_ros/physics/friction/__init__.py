"""Friction of cylinder and guides: one file per published law, and the law that a record asks for.

Force opposes velocity. To add a law: write its file (parameters, its number, kernels as named below), add its row here;
the plant and the contract tests take it from this table. A law with a contact state has FIRST_DYNAMIC or a higher
number.

One compiled function per quantity is written from the table: nothing is looked up by name within a step, and one
compilation serves all laws. A law that is a curve F(v) has the kernel `curve_level`, one with a contact state
`contact_level`, `contact_deflection` and what else it needs of those below; a kernel that it does not have is taken
from the law it derives from, else what stands behind it here.
"""

from __future__ import annotations

from shake_ros.compiled import njit
from shake_ros.packing import dispatch, having
from shake_ros.physics.friction.armstrong import Armstrong
from shake_ros.physics.friction.bo_pavelescu import BoPavelescu
from shake_ros.physics.friction.coulomb_viscous_static import CoulombViscousStatic
from shake_ros.physics.friction.hess_soom import HessSoom
from shake_ros.physics.friction.law import FIRST_DYNAMIC, NONE, FrictionLaw, NoFriction
from shake_ros.physics.friction.lugre import LuGre
from shake_ros.physics.friction.marton_lantos import MartonLantos
from shake_ros.physics.friction.modified_lugre import ModifiedLuGre
from shake_ros.physics.friction.new_modified_lugre import NewModifiedLuGre
from shake_ros.physics.friction.tustin import Tustin, direction

FRICTIONS: dict[str, type[FrictionLaw]] = {
    "tustin": Tustin,
    "none": NoFriction,
    "coulomb_viscous_static": CoulombViscousStatic,
    "hess_soom": HessSoom,
    "bo_pavelescu": BoPavelescu,
    "marton_lantos": MartonLantos,
    "armstrong": Armstrong,
    "lugre": LuGre,
    "modified_lugre": ModifiedLuGre,
    "new_modified_lugre": NewModifiedLuGre,
}

__all__ = ["FRICTIONS", "FrictionLaw"]

KIND = "p.friction_kind"

has_memory = having(__name__, FRICTIONS, "has_memory", KIND)
curve_level = dispatch(__name__, FRICTIONS, "curve_level", KIND, "0.0")  # [N]
viscous_coefficient = dispatch(__name__, FRICTIONS, "viscous_coefficient", KIND, "p.friction_viscous")  # [N·s/m]
inertia = dispatch(__name__, FRICTIONS, "inertia", KIND, "0.0")  # (3.52), mass that acts on the piston [kg]
contact_level = dispatch(__name__, FRICTIONS, "contact_level", KIND)  # g(v, h), or Armstrong's under F_s = `rise` [N]
contact_deflection = dispatch(__name__, FRICTIONS, "contact_deflection", KIND)  # z after a displacement one way [m]
micro_damping = dispatch(__name__, FRICTIONS, "micro_damping", KIND, "0.0")  # σ_1 ż, contact force over level = `share`
memory_rate = dispatch(__name__, FRICTIONS, "memory_rate", KIND, "0.0")  # of the lagged speed [m/s²], the film [1/s]
steady_memory = dispatch(__name__, FRICTIONS, "steady_memory", KIND, "0.0")  # under a velocity that lasts


@njit
def is_dynamic(p):
    """Whether the law has a contact state z."""
    return p.friction_kind >= FIRST_DYNAMIC


@njit
def curve_direction(p, velocity):
    """Smooth sign of the velocity of a law that is a curve [-]."""
    return 0.0 if p.friction_kind == NONE else direction(p, velocity)


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
