"""What a table's file may add in sections of their own: cavitation, pipelines, a shear frame as the specimen.

Cavitation: a chamber's pressure falls to a limit and stays there while a void opens, and rises when the void has
closed.

The integrated state is the pressure p̃ that the liquid would have if it could bear tension; below the limit it
measures the void, V_void = V (p_c − p̃)/E. The pressure that acts on piston, valve and leakage is

    P = p̃                                  for p̃ ≥ p_c + w
    P = p_c + w exp((p̃ − p_c − w)/w)       below,

once differentiable, never at or below p_c. So the oil that is missing in a chamber must flow in before its pressure
rises again, without a state or an event for the void. With a modulus that changes on the way the void is met
approximately. Above p_c + w nothing differs from a table without cavitation. Absent at w = 0. p_c is about the
pressure of saturated vapour, or some tenths of a bar where dissolved air comes out.

Pipelines between the valve and the chambers: the inertia of the oil, its friction, and the volume at the valve.

    (ρ L/A) Q̇ = P_1 − P_2 − Δp(Q),  Ṗ_valve = E/(A L/2) (Q_valve − Q)

One lump per line, the cylinder's half of the line's volume counting as dead volume; valid well below the frequency of
a pressure wave, a/(4 L). Δp is that of fluid.py, laminar or turbulent. Absent at length 0.
Source: thesis 2.6. Verified against the line's own frequency and the steady drop.

Shear frame: n equal storeys of mass m on columns of stiffness k with dampers c.

    m q̈_i = −m a − k (q_i − q_{i−1}) − c (q̇_i − q̇_{i−1}) + k (q_{i+1} − q_i) + c (q̇_{i+1} − q̇_i),  q_0 = 0
    force on the table = k q_1 + c q̇_1

q_i is a storey's displacement relative to the table, a the table's absolute acceleration. The storeys' mass comes on
top of `body.specimen_mass`, which is the frame's foot. Absent with no storeys; the single-storey effect
`specimen_resonance` takes its mass out of the specimen's instead. Verified against ω_j = 2 √(k/m)
sin((2j−1)π/(4n+2)).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from shake_ros.compiled import kernel, njit
from shake_ros.physics.fluid import pressure_drop
from shake_ros.physics.plant.states import LARGEST_STOREYS, STOREY
from shake_ros.quantities import Parameters, quantity


@dataclass(frozen=True)
class Cavitation(Parameters):
    """Lowest pressure of a chamber."""

    width: float = quantity("Pa", "range w above the limit in which cavitation sets in", low=0.0, high=1e6, default=0.0)
    pressure: float = quantity(
        "Pa", "absolute pressure p_c that no chamber falls below", low=0.0, high=1e6, default=0.0
    )


@kernel
def chamber_pressure(p, liquid_pressure):
    """P that acts in a chamber, from the pressure p̃ of its liquid, the state [Pa]."""
    limit, width = p.cavitation_pressure, p.cavitation_width
    if width <= 0.0 or liquid_pressure >= limit + width:
        return liquid_pressure
    return limit + width * math.exp((liquid_pressure - limit - width) / width)


@dataclass(frozen=True)
class Pipelines(Parameters):
    """Two equal lines between valve and cylinder."""

    length: float = quantity("m", "length L of each line", low=0.0, high=20.0, default=0.0)
    diameter: float = quantity("m", "inner diameter d", low=1e-3, high=0.2, default=0.012)
    density: float = quantity("kg/m^3", "density ρ of the oil", low=500.0, high=2000.0, default=870.0)
    viscosity: float = quantity("Pa*s", "dynamic viscosity η of the oil", low=1e-4, high=10.0, default=0.028)


@kernel
def line_flow_rate(p, flow, pressure_in, pressure_out):
    """Q̇ of a line [m³/s²]."""
    length, diameter = p.pipelines_length, p.pipelines_diameter
    inertance = p.pipelines_density * length / (0.25 * math.pi * diameter * diameter)
    lost = pressure_drop(flow, length, diameter, p.pipelines_viscosity, p.pipelines_density)
    return (pressure_in - pressure_out - lost) / inertance


@kernel
def half_line_volume(p):
    """Half the oil volume of a line [m³]."""
    return 0.125 * math.pi * p.pipelines_diameter * p.pipelines_diameter * p.pipelines_length


@dataclass(frozen=True)
class ShearFrame(Parameters):
    """Frame of equal storeys."""

    storeys: int = quantity("-", "number of storeys n", low=0, high=LARGEST_STOREYS, default=0)
    mass: float = quantity("kg", "mass m of a storey", low=0.1, high=1e5, default=50.0)
    stiffness: float = quantity("N/m", "stiffness k of a storey's columns", low=1.0, high=1e10, default=2.0e5)
    damping: float = quantity("N*s/m", "damper c of a storey", low=0.0, high=1e7, default=100.0)


@kernel
def foot_force(p, y):
    """Force of the frame on the table [N]."""
    return p.frame_stiffness * y[STOREY] + p.frame_damping * y[STOREY + 1]


@kernel
def storey_rates(p, y, acceleration, rates):
    """Rates of the storeys' displacements and velocities into `rates`, under the table's acceleration [m/s²]."""
    storeys, stiffness, damping = int(p.frame_storeys), p.frame_stiffness, p.frame_damping
    below = foot_force(p, y)
    for i in range(storeys):
        at = STOREY + 2 * i
        above = 0.0
        if i + 1 < storeys:
            above = stiffness * (y[at + 2] - y[at]) + damping * (y[at + 3] - y[at + 1])
        rates[at] = y[at + 1]
        rates[at + 1] = -acceleration + (above - below) / p.frame_mass
        below = above


@njit
def set_load(model, rigid, swaying, pitch):  # type: ignore[no-untyped-def]
    """Give a table's record another specimen, in place.

    Parameters
    ----------
    model : array of one record.
    rigid, swaying : masses that stand rigidly, and on a spring [kg].
    pitch : logarithm of the frequency of that spring in Hz
    """
    p = model[0]
    p.body_specimen_mass = rigid + swaying
    p.specimen_resonance_mass = swaying
    p.specimen_resonance_frequency = math.exp(pitch)
