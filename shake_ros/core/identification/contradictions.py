"""Does a declared table contradict the recordings? Velocity gain and hydraulic frequency tell before any fit.

Both follow from the declared numbers in closed form, and from the recordings by the linear table nearest to their
response (first_guess.py). A missing effect moves them by tens of per cent; a wrong area, volume or mass by factors.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence

from shake_ros.core.identification.identified import velocity_gain
from shake_ros.core.identification.linear_table import linear_table, slow_gain
from shake_ros.core.identification.recordings import Record
from shake_ros.core.identification.sensor_pair import ALIKE, SensorPair
from shake_ros.core.plant.linearisation import oil_column_frequency
from shake_ros.core.plant.parameters import TableParameters
from shake_ros.core.quantities import ShakeError

GAIN, FREQUENCY = 1.5, 1.6  # factors beyond which no usual effect explains the difference
WITHIN = 1.3  # factor by which the recordings must be seen beyond a hydraulic frequency that counts
GAIN_FROM = ("valve.flow_coefficient", "body.piston_area", "supply.supply_pressure")
FREQUENCY_FROM = ("bulk_modulus.modulus", "body.cylinder_volume", "body.table_mass", "body.piston_area")


def contradictions(
    table: TableParameters,
    records: Sequence[Record],
    unknown: Collection[str] = (),
    sensors: SensorPair = ALIKE,
) -> list[str]:
    """A line for each quantity in which declared numbers and recordings are far apart.

    Parameters
    ----------
    records : commands per unit. unknown : numbers of the table that are not declared; what follows from one of them
    cannot contradict anything. sensors : what position and acceleration tell of each other.
    """
    try:
        measured = linear_table(records, sensors)
    except ShakeError:  # what cannot be told apart cannot contradict
        return []
    gain = measured.gain if sensors.position_lag else slow_gain(records)  # such a lag takes off what is slow as well
    pairs = (
        ("velocity per command", "m/s", GAIN_FROM, velocity_gain(table), gain, GAIN),
        (
            "hydraulic frequency",
            "Hz",
            FREQUENCY_FROM,
            oil_column_frequency(table) / (2.0 * math.pi),
            measured.omega / (2.0 * math.pi),
            FREQUENCY,
        ),
    )
    found = []
    for name, unit, origin, declared, seen, most in pairs[: 2 if WITHIN * measured.omega < measured.seen_to else 1]:
        if any(number in unknown for number in origin) or max(declared / seen, seen / declared) < most:
            continue
        numbers = ", ".join(f"{number} = {table.value(number):g}" for number in origin)
        found.append(
            f"{name}: declared {declared:.3g} {unit} (from {numbers}), the recordings show {seen:.3g} {unit}: "
            "is one of these numbers wrong?"
        )
    return found
