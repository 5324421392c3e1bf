"""The specimen: a shear frame on the table, and the load in the table's record.

A shear frame has n equal storeys of mass m on columns of stiffness k with dampers c.

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

import numpy as np
from numpy.typing import NDArray

from shake_ros.core.compiled import kernel, njit
from shake_ros.core.quantities import Parameters, quantity

LARGEST_STOREYS = 10


@dataclass(frozen=True)
class ShearFrame(Parameters):
    """Frame of equal storeys."""

    storeys: int = quantity("-", "number of storeys n", low=0, high=LARGEST_STOREYS, default=0)
    mass: float = quantity("kg", "mass m of a storey", low=0.1, high=1e5, default=50.0)
    stiffness: float = quantity("N/m", "stiffness k of a storey's columns", low=1.0, high=1e10, default=2.0e5)
    damping: float = quantity("N*s/m", "damper c of a storey", low=0.0, high=1e7, default=100.0)


def natural_frequencies(frame: ShearFrame) -> NDArray[np.float64]:
    """Undamped natural frequencies on a table at rest, ascending, shape (n,) [rad/s].

    >>> natural_frequencies(ShearFrame(storeys=1, mass=1.0, stiffness=4.0)).round(6)
    array([2.])
    """
    j = np.arange(1, frame.storeys + 1)
    return 2.0 * np.sqrt(frame.stiffness / frame.mass) * np.sin((2 * j - 1) * np.pi / (4 * frame.storeys + 2))


@kernel
def foot_force(y, first, stiffness, damping):
    """Force of the frame on the table; `first` is the index of the first storey's displacement in `y` [N]."""
    return stiffness * y[first] + damping * y[first + 1]


@kernel
def storey_rates(y, first, storeys, mass, stiffness, damping, acceleration, rates):
    """Rates of the storeys' displacements and velocities into `rates`, under the table's acceleration [m/s²]."""
    below = stiffness * y[first] + damping * y[first + 1]
    for i in range(storeys):
        at = first + 2 * i
        above = 0.0
        if i + 1 < storeys:
            above = stiffness * (y[at + 2] - y[at]) + damping * (y[at + 3] - y[at + 1])
        rates[at] = y[at + 1]
        rates[at + 1] = -acceleration + (above - below) / mass
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
