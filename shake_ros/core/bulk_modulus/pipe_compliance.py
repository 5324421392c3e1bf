"""A pipe that widens under pressure lowers the bulk modulus of the oil in it, (2.33)–(2.35).

E_p, called the pipeline's bulk modulus in print, is Young's modulus of the wall: w p/E_p is the relative growth of the
bore of a closed tube after Lamé. Range: elastic walls; thin where s/d_o < 0.1. The thin-wall w = d_i/s leaves out that
the wall is held along its axis and is 5 % above the thick-wall value at ν = 0.3.
Source: thesis, section 2.4.2. Verified against Lamé's stresses.
"""

from __future__ import annotations

from shake_ros.core.compiled import njit


@njit
def effective_modulus(oil_modulus, wall_modulus, w):
    """E = Ē/(1 + w Ē/E_p) (2.33) [Pa]."""
    return oil_modulus / (1.0 + oil_modulus / wall_modulus * w)  # (2.33)


@njit
def thick_wall(outer_diameter, inner_diameter, poisson):
    """w of a thick-walled pipe (2.34) [-]."""
    ratio = (outer_diameter / inner_diameter) ** 2
    return (2.0 * ratio * (1.0 + poisson) + 3.0 * (1.0 - 2.0 * poisson)) / (ratio - 1.0)  # (2.34)


@njit
def thin_wall(inner_diameter, wall_thickness):
    """w of a thin-walled pipe (2.35) [-]."""
    return inner_diameter / wall_thickness  # (2.35)
