"""Modified LuGre: a lubricant film lowers the Stribeck level and builds up late, (3.45)–(3.51).

    g(v, h) = F_c + ((1−h) F_s − F_c) exp(−(|v|/v_s)^n)                                   (3.46)
    ḣ = (h_ss − h)/τ_h,  τ_h = τ_hp where h ≤ h_ss, τ_hn where h > h_ss, τ_h0 at rest      (3.47), (3.48)
    h_ss = k_f min(|v|, v_b)^(2/3),  k_f = (1 − F_c/F_s) v_b^(−2/3)                        (3.49), (3.50)

z and the force are those of lugre.py, (3.45), (3.51); the print drops σ_0 in (3.45). Rest is |v| below
`rest_velocity`, which an integrator needs since v = 0 is an instant only. Source: thesis (3.45)–(3.51). Verified
against Radau with z as a state.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from shake_ros.compiled import njit
from shake_ros.physics.friction.lugre import Bristles
from shake_ros.quantities import quantity


@dataclass(frozen=True)
class Film(Bristles):
    """Base of the laws with a film: parameters of (3.45)–(3.51), magnitudes."""

    has_memory: ClassVar[bool] = True

    full_film_velocity: float = quantity("m/s", "velocity v_b of the full film", low=1e-3, high=10.0)
    film_build_time: float = quantity("s", "time constant τ_hp of a growing film", low=1e-4, high=1e3)
    film_decay_time: float = quantity("s", "time constant τ_hn of a shrinking film", low=1e-4, high=1e3)
    film_dwell_time: float = quantity("s", "time constant τ_h0 of the film at rest", low=1e-4, high=1e4)
    rest_velocity: float = quantity("m/s", "speed below which the piston is at rest for the film", low=0.0, high=1e-2)


@dataclass(frozen=True)
class ModifiedLuGre(Film):
    """The law of (3.45)–(3.51)."""

    code: ClassVar[int] = 12


@njit
def steady_memory(p, velocity):
    """h_ss (3.49), (3.50) [-]."""
    if velocity >= 0.0:
        ratio = p.friction_coulomb_level / p.friction_static_level
    else:
        ratio = p.friction_coulomb_level_reverse / p.friction_static_level_reverse
    relative = min(abs(velocity) / p.friction_full_film_velocity, 1.0)
    return (1.0 - ratio) * relative ** (2.0 / 3.0)


@njit
def memory_rate(p, velocity, film):
    """ḣ (3.47), (3.48) [1/s]."""
    h_ss = steady_memory(p, velocity)
    if abs(velocity) < p.friction_rest_velocity:
        tau = p.friction_film_dwell_time
    elif film <= h_ss:
        tau = p.friction_film_build_time
    else:
        tau = p.friction_film_decay_time
    return (h_ss - film) / tau
