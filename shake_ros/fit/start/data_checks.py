"""Checks before a fit: units, signs, swapped signals, two tables, too little motion, end stops, the data sheet.

Each finding is a line with the numbers behind it. Nothing is changed, for whoever recorded knows what it is, but for
stretches in which a table stands at its end stop or strikes it: no model foresees such an impact, and one in validation
data outweighs everything that a model gets right. Where the stroke is known they are left out, and what follows is
a recording of its own, since nothing shows the pressures after an impact.

Velocity gain and hydraulic frequency follow from the declared numbers in closed form, and from the recordings by the
linear table nearest to their response. A missing effect moves them by tens of per cent; a wrong area, volume or mass by
factors.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from shake_ros.fit.identified import velocity_gain
from shake_ros.fit.nuisances.prepared import slow
from shake_ros.fit.nuisances.sensor_pair import ALIKE, FEWEST, SensorPair, between_sensors, compared, turned
from shake_ros.fit.records import SHORTEST, Record
from shake_ros.fit.start.linear_table import linear_table, slow_gain
from shake_ros.physics.plant.linearisation import oil_column_frequency
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.quantities import ShakeError
from shake_ros.signals.stretches import stretches

GRAVITY = 9.80665  # [m/s²]
PROMPT = 5.0  # a filter or lag of the accelerometer hardly acts up to here [Hz]
AGREEMENT = 1.25  # factor between two sensors' sizes of the same motion up to which they agree
UNITS = {
    1.0 / GRAVITY: "acceleration in g? import it with the scale 9.80665",
    1e-3: "position in millimetres? import it with the scale 0.001",
    1e-2: "position in centimetres? import it with the scale 0.01",
    1e3: "acceleration in mm/s²? import it with the scale 0.001",
    1e-3 / GRAVITY: "position in millimetres and acceleration in g?",
}
DELAYS = np.arange(0.0, 0.03, 1e-3)  # of an accelerometer's filter [s]
FOLLOWS = 0.6  # correlation of the slow velocity with the command from which a table follows its valve
TWICE = 1.6  # factor between the velocity gains of two recordings from which these are of two tables
SHORT = 12.0  # of all recordings together: two of 5 s, one of them for validation, are less [s]
SLOWLY = 150.0  # rate below which sampling hides what the sensors do, and effects of theirs are named wrongly [Hz]
ONE_LINE = 0.95  # share of the command's power within 5 % of its strongest frequency that makes it a sine
GAIN, FREQUENCY = 1.5, 1.6  # factors beyond which no usual effect explains the difference
WITHIN = 1.3  # factor by which the recordings must be seen beyond a hydraulic frequency that counts
GAIN_FROM = ("valve.flow_coefficient", "body.piston_area", "supply.supply_pressure")
FREQUENCY_FROM = ("bulk_modulus.modulus", "body.cylinder_volume", "body.table_mass", "body.piston_area")
NEAR = 0.002  # part of the stroke by which a zero of the position may be wrong
ANOTHER_UNIT = 30.0  # factor between the force of a load pressure and that of inertia that no friction explains


def data_checks(records: Sequence[Record]) -> list[str]:
    """A line for each thing that speaks against these recordings of one table; drives are valve commands."""
    found = [line for record in records for line in (*_acceleration(record), *_swapped(record))]
    return found + _two_tables(records) + _too_little(records)


def _acceleration(record: Record) -> list[str]:
    """Whether accelerometer and position agree on the motion."""
    omega, response, weight = between_sensors([record])
    if len(omega) < FEWEST:
        return []
    low = omega < 2.0 * np.pi * PROMPT
    low = low if np.count_nonzero(low) >= FEWEST else np.ones(len(omega), dtype=bool)
    sums = np.exp(1j * np.outer(DELAYS, omega[low])) @ (weight * response)[low] / np.sum(weight[low])
    ratio = float(max(sums.real, key=abs))  # at the delay of its filter, which would turn the phase
    size = abs(ratio)
    if ratio < 0.0:
        return [turned(record, ratio)]
    hint = next(
        (text for factor, text in UNITS.items() if 1.0 / AGREEMENT < size / factor < AGREEMENT), "another unit?"
    )
    return [] if 1.0 / AGREEMENT < size < AGREEMENT else [f"{compared(record, ratio)}: {hint}"]


def correlation(a: np.ndarray, b: np.ndarray) -> float:
    """Correlation coefficient [-]; 0 where one is constant."""
    return float(np.corrcoef(a, b)[0, 1]) if np.ptp(a) > 0.0 and np.ptp(b) > 0.0 else 0.0


def _swapped(record: Record) -> list[str]:
    """Whether command and position look exchanged: a valve moves the table at a speed, not to a place."""
    dt, span = record.sample_time, slice(record.start, None)
    u, x, v = (slow(s, dt)[span] for s in (record.commands, record.position, record.velocity))
    as_named, exchanged = correlation(u, v), correlation(np.gradient(u, dt), x)
    if exchanged > FOLLOWS and exchanged > as_named + 0.3:
        return [
            f"{record.name}: the position follows the rate of the command (correlation {exchanged:.2f}), the velocity "
            f"not the command ({as_named:.2f}): command and position swapped?"
        ]
    if as_named < -FOLLOWS:
        return [f"{record.name}: the velocity goes against the command ({as_named:.2f}); import one with the scale -1"]
    return []


def _two_tables(records: Sequence[Record]) -> list[str]:
    """Whether the velocity per command differs between recordings by more than friction explains."""
    gains: dict[str, float] = {}
    for record in records:
        u, v = (slow(s, record.sample_time)[record.start :] for s in (record.commands, record.velocity))
        u, v = u - u.mean(), v - v.mean()
        if correlation(u, v) > FOLLOWS:
            gains.setdefault(record.name, float(u @ v) / float(u @ u))
    if len(gains) < 2:
        return []
    low, high = min(gains, key=lambda n: gains[n]), max(gains, key=lambda n: gains[n])
    if gains[high] < TWICE * gains[low]:
        return []
    return [
        f"{high} and {low}: {gains[high]:.3g} and {gains[low]:.3g} m/s per command: two tables, "
        "supply pressures or command scales?"
    ]


def _too_little(records: Sequence[Record]) -> list[str]:
    """Whether all recordings together are too short, or a single sine."""
    seconds = sum(len(r.commands) * r.sample_time for r in records)
    names = ", ".join(dict.fromkeys(r.name for r in records))
    lines = []
    if seconds < SHORT:
        lines.append(f"{names}: {seconds:.1f} s in all: too little to distinguish many effects; record 30 s or more")
    slowest = min(1.0 / r.sample_time for r in records)
    if slowest < SLOWLY:
        lines.append(
            f"{names}: sampled at {slowest:.0f} Hz: too slow to show friction and sensor dynamics; a named effect is a "
            "guess; record at 200 Hz or more"
        )
    strongest = [_strongest(r) for r in records]
    if all(share > ONE_LINE for share, _ in strongest):
        low, high = min(f for _, f in strongest), max(f for _, f in strongest)
        if high <= 1.1 * low:
            lines.append(
                f"{names}: the command is a single sine of {low:.2g} Hz, which shows gain and phase there, not the "
                "dynamics; record a sweep, a multi-sine or an earthquake as well"
            )
    return lines


def _strongest(record: Record) -> tuple[float, float]:
    """Share of the command's power within 5 % of its strongest frequency, or two lines, and that frequency [Hz]."""
    u = (record.commands - record.commands.mean()) * np.hanning(len(record.commands))
    power = np.abs(np.fft.rfft(u)) ** 2
    frequency = np.fft.rfftfreq(len(u), record.sample_time)
    peak = float(frequency[np.argmax(power)])
    near = np.abs(frequency - peak) <= max(0.05 * peak, 2.5 * frequency[1])
    return float(power[near].sum() / max(power.sum(), 1e-300)), peak


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
    cannot contradict anything. sensors : what position and acceleration show of each other.
    """
    try:
        measured = linear_table(records, sensors)
    except ShakeError:  # what cannot be distinguished cannot contradict
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


def within_stroke(records: Sequence[Record], stroke: float) -> tuple[list[Record], tuple[str, ...]]:
    """The parts of recordings between the end stops, and a line on each recording that meets one.

    Parameters
    ----------
    stroke : full [m]; positions count from its middle.

    Raises
    ------
    ShakeError : nothing of a recording lies between the stops.
    """
    found, said = list[Record](), dict[str, float]()
    names = dict.fromkeys(r.name for r in records)
    for record in records:
        at = np.abs(record.position) >= (0.5 - NEAR) * stroke
        if not (at.any() and record.position_measured):
            found.append(record)
            continue
        said[record.name] = max(said.get(record.name, 0.0), float(np.max(np.abs(record.position))))
        found += [record.part(s) for s in stretches(~at) if (s.stop - s.start) * record.sample_time >= SHORTEST]
    lines = []
    for name, farthest in said.items():
        used, whole = (sum(len(r.commands) * r.sample_time for r in rs if r.name == name) for rs in (found, records))
        lines.append(
            f"{name}: the position reaches {1e3 * farthest:.1f} mm, the end stop of a stroke of {1e3 * stroke:.0f} mm; "
            f"split there; {used:.1f} of {whole:.1f} s are used"
        )
    if lost := [name for name in names if not any(r.name == name for r in found)]:
        line = next(line for line in lines if line.startswith(f"{lost[0]}: "))
        raise ShakeError(f"{line}: is the stroke (body.stroke), or the zero of the position, right?")
    return found, tuple(lines)


def unmeasured_positions(records: Sequence[Record]) -> tuple[str, ...]:
    """A line on the recordings without a position; nothing where all have one."""
    names = ", ".join(dict.fromkeys(r.name for r in records if not r.position_measured))
    if not names:
        return ()
    return (
        f"{names}: no position was measured; the answer is partial: slow motion, offsets, and scale and lag of the "
        "sensors are not judged",
    )


def usable_pressures(records: Sequence[Record], table: TableParameters | None) -> tuple[list[Record], tuple[str, ...]]:
    """Recordings without load pressures that cannot be those of the table's piston, and a line on each of these.

    Over a recording the piston does work on the table, which friction takes; and its force is of the size of inertia.

    Parameters
    ----------
    table : declared; None where its pressures have no unit.
    """
    found, lines = list[Record](), list[str]()
    for record in records:
        line = "" if record.pressure is None else _wrong_pressure(record, table)
        found.append(replace(record, pressure=None) if line else record)
        lines += [f"{record.name}: {line}: left out"] if line else []
    return found, tuple(dict.fromkeys(lines))


def _wrong_pressure(record: Record, table: TableParameters | None) -> str:
    """What speaks against a load pressure; empty where nothing does."""
    assert record.pressure is not None
    span = slice(record.start, None)
    pressure = record.pressure[span] - np.mean(record.pressure[span])
    felt = record.felt[span] - np.mean(record.felt[span])
    if max(correlation(pressure, record.velocity[span]), correlation(pressure, felt)) < 0.0:
        return "the load pressure pushes against the motion (chambers A and B exchanged?)"
    if table is None or not np.any(felt):
        return ""
    ratio = float(np.std(pressure) / np.std(felt)) * table.value("body.piston_area") / table.moved_mass
    if 1.0 / ANOTHER_UNIT < ratio < ANOTHER_UNIT:
        return ""
    return f"the load pressure makes {ratio:.2g} times the force of inertia of the declared mass (another unit?)"
