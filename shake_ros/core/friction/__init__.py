"""Friction of cylinder and guides: one file per published law, force opposing velocity.

To add one: write its file (parameters, its number, kernels as `selected` names them), add its row here. `selected`, the
plant and the contract tests take it from this table. A law with a contact state has FIRST_DYNAMIC or a higher number.
"""

from __future__ import annotations

from shake_ros.core.friction.armstrong import Armstrong
from shake_ros.core.friction.bo_pavelescu import BoPavelescu
from shake_ros.core.friction.coulomb_viscous_static import CoulombViscousStatic
from shake_ros.core.friction.hess_soom import HessSoom
from shake_ros.core.friction.law import FrictionLaw
from shake_ros.core.friction.lugre import LuGre
from shake_ros.core.friction.marton_lantos import MartonLantos
from shake_ros.core.friction.modified_lugre import ModifiedLuGre
from shake_ros.core.friction.new_modified_lugre import NewModifiedLuGre
from shake_ros.core.friction.none import NoFriction
from shake_ros.core.friction.tustin import Tustin

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
