"""Oil shut into a cylinder is a spring, and the moved mass swings on it, (2.22)–(2.27), (2.36).

    k = E (A_1²/V_1 + A_2²/V_2),  ω = sqrt(k/M)

Over a constant total volume k is least where A_1/V_1 = A_2/V_2: for equal areas in the middle of the stroke.
(2.36) is printed for kgf, with W/g in place of M; SI is used here.
Source: thesis, sections 2.3.1, 2.4.3. Verified against finite compression and the poles of the linearised plant.
"""

from __future__ import annotations

import math

from shake_ros.core.compiled import njit


@njit
def stiffness(bulk_modulus, area_1, volume_1, area_2, volume_2):
    """k of two trapped volumes (2.25) [N/m]."""
    return bulk_modulus * (area_1 * area_1 / volume_1 + area_2 * area_2 / volume_2)  # (2.25)


@njit
def stiffness_of_total(bulk_modulus, area_1, volume_1, area_2, total_volume):
    """k with the second volume as the rest of a total V_T (2.26) [N/m]."""
    return stiffness(bulk_modulus, area_1, volume_1, area_2, total_volume - volume_1)  # (2.26)


@njit
def softest_volume(area_1, area_2, total_volume):
    """V_1 at which k of (2.26) is least, dk/dV_1 = 0 at a constant V_T [m³].

    (2.27) prints A_1²/V_1 = A_2²/V_2; the derivative of (2.26) gives A_1/V_1 = A_2/V_2. Equal areas satisfy both.
    """
    return total_volume * area_1 / (area_1 + area_2)  # (2.27)


@njit
def natural_frequency(stiffness, mass):
    """ω = sqrt(k/M) (2.36) [rad/s]."""
    return math.sqrt(stiffness / mass)  # (2.36)
