"""What recordings tell of a table whatever its area and pressure: quantities that the gauge drops out of.

Each is a function of the table; its standard error follows from the covariance of the fit by first-order propagation
(finite differences along each free parameter).
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from shake_ros.fit.least_squares import DIFFERENCE, Fit
from shake_ros.fit.uncertainty import Estimate, covariance
from shake_ros.physics.plant.cylinder import pressure_left, steady_speeds, underlap_left, volumes
from shake_ros.physics.plant.linearisation import oil_column_frequency
from shake_ros.physics.plant.parameters import TableParameters

REACH = 0.05  # from mid-stroke, at which the hydraulic frequency is given as well [m]


def moved(t: TableParameters) -> float:
    """Mass in motion [kg]."""
    return t.moved_mass + t.value("effects.payload_error.mass")


def pressure_drop(t: TableParameters) -> float:
    """Supply less return pressure [Pa]."""
    return t.supply.supply_pressure - t.supply.tank_pressure - t.value("effects.tank_back_pressure.pressure")


def velocity_gain(t: TableParameters) -> float:
    """Velocity per command without load, mean of both directions [m/s]."""
    out, back = steady_speeds(t)
    return t.value("valve.gain") * (0.5 * (out + back))


def damping(t: TableParameters) -> float:
    """Damping ratio of the oil column about rest by leakage, open centre and viscous friction [-]."""
    area, omega = 0.5 * t.body.acting_area, oil_column_frequency(t)
    centre = underlap_left(t) * t.value("valve.flow_coefficient") / math.sqrt(2.0 * pressure_drop(t))
    leakage = t.leakage.internal + 0.5 * t.leakage.external + centre
    return 0.5 * (moved(t) * omega * leakage / area**2 + t.value("friction.viscous") / (moved(t) * omega))


def effective_stroke(t: TableParameters) -> float:
    """Length of both chambers at their mean area, dead volumes included [m]."""
    return sum(volumes(t)) / (0.5 * t.body.acting_area)


QUANTITIES: dict[str, tuple[Callable[[TableParameters], float], str]] = {
    "velocity_gain": (velocity_gain, "m/s"),
    "hydraulic_frequency": (lambda t: oil_column_frequency(t) / (2.0 * math.pi), "Hz"),
    f"hydraulic_frequency_at_{1e3 * REACH:.0f}_mm": (lambda t: oil_column_frequency(t, REACH) / (2.0 * math.pi), "Hz"),
    "effective_stroke": (effective_stroke, "m"),
    "hydraulic_damping": (damping, "-"),
    "saturation_acceleration": (lambda t: min(pressure_left(t)) * t.body.piston_area / moved(t), "m/s^2"),
    "valve_frequency": (
        lambda t: t.value("valve.natural_frequency") * (1.0 - t.value("effects.slow_valve.slowdown")) / (2.0 * math.pi),
        "Hz",
    ),
    "valve_damping": (lambda t: t.value("valve.damping"), "-"),
    "valve_underlap": (lambda t: t.value("valve.underlap"), "-"),
    "valve_hysteresis": (lambda t: t.value("valve.hysteresis"), "-"),
    "command_delay": (lambda t: t.value("effects.command_delay.delay"), "s"),
    "coulomb_friction_per_mass": (lambda t: t.value("friction.coulomb_level") / moved(t), "m/s^2"),
    "breakaway_friction_per_mass": (
        lambda t: (t.value("friction.coulomb_level") + t.value("friction.stribeck_rise")) / moved(t),
        "m/s^2",
    ),
    "stribeck_velocity": (lambda t: 1.0 / max(t.value("friction.stribeck_decay"), 1e-9), "m/s"),
    "viscous_friction_per_mass": (lambda t: t.value("friction.viscous") / moved(t), "1/s"),
}


def identified(result: Fit, blocks: np.ndarray) -> tuple[Estimate, ...]:
    """The quantities of a fitted table with standard errors.

    Parameters
    ----------
    blocks : number of the block of time that each residual belongs to, shape (n,).

    Returns
    -------
    An estimate each; its standard error is None where no free parameter moves it, or one that moves it is at a bound.
    """
    spread = covariance(result, blocks)
    table = result.table
    steps = DIFFERENCE * np.maximum(1.0, np.abs(result.x))
    steps = np.where(result.x + steps > result.free.high, -steps, steps)
    shifted = [result.free.table(result.x + np.eye(len(steps))[i] * steps[i]) for i in range(len(steps))]
    found = []
    for name, (function, unit) in QUANTITIES.items():
        value = function(table)
        slope = np.array([(function(t) - value) / h for t, h in zip(shifted, steps, strict=True)])
        acting = slope != 0.0
        variance = float(slope[acting] @ spread[np.ix_(acting, acting)] @ slope[acting]) if acting.any() else math.nan
        found.append(Estimate(name, value, math.sqrt(variance) if variance >= 0.0 else None, unit))
    return tuple(found)
