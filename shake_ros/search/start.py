"""Where a fit of a table without a data sheet begins: a coarse grid of oil springs and frictions, judged by prediction.

The slow velocity per command and the lag of slow motion can be read off the recordings; the spring of the oil and the
dry friction cannot, so each of a few is tried and the predictor's likelihood says which basins are fitted.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np

from shake_ros.core.identification.linear_table import slow_gain
from shake_ros.core.identification.nuisances import slow
from shake_ros.core.identification.recordings import Record
from shake_ros.core.plant.parameters import TableParameters

SPRINGS = (7.0, 14.0, 28.0, 50.0)  # natural frequency of table and oil [Hz]
FRICTIONS = (0.05, 0.5, 3.0)  # dry friction per moved mass [m/s²]
DAMPING = 0.2  # of the oil spring [-]
MODULUS = 7e8  # of oil with some air in a cylinder that gives [Pa]
RESERVE = 1.3  # acceleration at full pressure, in parts of the largest measured one, at least
FREE_STROKE = 4.0  # length of both chambers in parts of the range of motion


def lag_of(records: Sequence[Record]) -> float:
    """Time by which the slow velocity is behind the command [s], by the largest correlation."""
    lags = np.arange(-5e-3, 60e-3, 5e-4)
    found = np.zeros(len(lags))
    for r in records:
        u, v = (slow(x, r.sample_time)[r.start :] for x in (r.commands, r.velocity))
        time = np.arange(len(u)) * r.sample_time
        u, v = u - u.mean(), v - v.mean()
        found += [float(np.interp(time - lag, time, u) @ v) * r.sample_time for lag in lags]
    return float(lags[int(np.argmax(found))])


def starts(given: TableParameters, unknown: Sequence[str], records: Sequence[Record]) -> list[TableParameters]:
    """Tables of the grid: what is given stays as it is."""
    gain, lag = slow_gain(records), lag_of(records)
    reach = max(float(np.max(np.abs(r.position))) for r in records)
    largest = max(float(np.percentile(np.abs(acceleration_of(r)), 99.9)) for r in records)
    area, drop = given.body.piston_area, given.supply.supply_pressure - given.supply.tank_pressure
    found = []
    for spring, friction in itertools.product(SPRINGS, FRICTIONS):
        omega = 2.0 * math.pi * spring

        def of(name: str, guess: float) -> float:
            field = given.fields[name].metadata
            return float(np.clip(guess, field["low"], field["high"])) if name in unknown else given.value(name)

        volume = of("body.cylinder_volume", 2.0 * FREE_STROKE * reach * area)
        modulus = of("bulk_modulus.modulus", MODULUS)
        most = drop * area / (RESERVE * largest)
        mass = of("body.table_mass", min(4.0 * modulus * area**2 / (volume * omega**2), most))
        moved = mass + given.body.specimen_mass
        modulus = of("bulk_modulus.modulus", omega**2 * volume * moved / (4.0 * area**2))
        stiff = math.sqrt(modulus * moved / volume) / area
        behind = lag - 2.0 * DAMPING / omega
        valve = 2.0 * given.value("valve.damping") / given.value("valve.natural_frequency")
        values = {
            "body.table_mass": mass,
            "body.cylinder_volume": volume,
            "bulk_modulus.modulus": modulus,
            "valve.flow_coefficient": gain * area / math.sqrt(0.5 * drop),
            "leakage.internal": 2.0 * DAMPING * 0.5 / stiff,
            "friction.coulomb_level": friction * moved,
            "friction.stribeck_rise": 0.3 * friction * moved,
            "friction.viscous": 0.5 * moved,
            "effects.command_delay.delay": max(behind - valve, 0.0),
        }
        found.append(given.with_values({n: of(n, v) for n, v in values.items() if n in unknown}))
    return found


def acceleration_of(record: Record) -> np.ndarray:
    """The acceleration as measured, or the derivative of the velocity."""
    if record.acceleration is not None:
        return record.acceleration
    return np.asarray(np.gradient(record.velocity, record.sample_time))
