"""The supply pressure sinks with the flow drawn from it: a small pump, a long line or an accumulator.

    τ Ṗ_s = P_s0 − R_s Q_s − P_s,  Q_s = flow through the edges that open to the supply

R_s Q_s is the steady droop; τ = R_s C_acc is the time in which an accumulator of capacity C_acc yields.
Absent at R_s = 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from shake_ros.core.compiled import njit
from shake_ros.core.effects.effect import Effect
from shake_ros.core.quantities import quantity


@dataclass(frozen=True)
class SupplyDroop(Effect):
    """Supply pressure that falls with the flow drawn."""

    place: ClassVar[str] = "supply"
    depends_on: ClassVar[tuple[str, ...]] = ("flow", "time")

    resistance: float = quantity("Pa*s/m^3", "steady droop per flow R_s", low=0.0, high=1e13, default=0.0)
    time_constant: float = quantity("s", "time constant τ of the droop", low=1e-3, high=10.0, default=0.02)


@njit
def pressure_rate(pressure, nominal, flow, resistance, time_constant):
    """dP_s/dt [Pa/s]."""
    return (nominal - resistance * flow - pressure) / time_constant
