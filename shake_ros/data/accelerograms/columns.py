"""A table of columns, one of which is a time and one an acceleration, as loggers and spreadsheets write it.

The columns are found by their units and names; without either, two columns are time and acceleration. The unit comes
from the heading or from the caller; without either it is taken as m/s², with a warning.
"""

from __future__ import annotations

import numpy as np

from shake_ros.core.quantities import ShakeError
from shake_ros.data.accelerograms.accelerogram import Accelerogram, Array, Text, checked, chosen, unit_in
from shake_ros.data.tables.table import ColumnTable, read_table, table_of
from shake_ros.data.tables.units import QUANTITIES, quantity_of

NAME = "two_columns"
AT_LEAST = 0.5  # step of a time without a unit from which it may be in milliseconds [s]


def read(text: Text, channel: int, unit: str) -> Accelerogram:
    """The acceleration of a table of columns."""
    table = table_of(text.path, text.lines) if text.lines else read_table(text.path)
    time_place, place, channel_note = _places(table, channel)
    time, values = table.read([time_place, place])
    for name, column in (("time", time), ("acceleration", values)):
        if not np.isfinite(column).all():
            row = int(np.argmax(~np.isfinite(column)))
            raise ShakeError(f"{table.path}, {table.line(row)}: {name} 'nan' is not a finite number")
    found, warnings = _unit(table, place, unit)
    step = _step(table, time_place, time)
    return Accelerogram(
        time_step=step,
        acceleration=checked(text, step, values, found, 0),
        name=table.path.stem,
        format=NAME,
        unit=found,
        provenance={f"header {i + 1}": line for i, line in enumerate(table.header)} | channel_note,
        warnings=warnings,
    )


def _kind(table: ColumnTable, place: int) -> str:
    """The quantity of a column, empty where neither unit nor name says it."""
    unit, name = table.unit(place), quantity_of(table.name(place))
    said = unit.quantity if unit and (unit.certain or unit.quantity == name) else ""
    return said if said in QUANTITIES else name


def _places(table: ColumnTable, channel: int) -> tuple[int, int, dict[str, str]]:
    """Columns of time and acceleration, and which of several accelerations it is."""
    kinds = {place: _kind(table, place) for place in table.numbers}
    times = [place for place, kind in kinds.items() if kind == "time"]
    several = [place for place, kind in kinds.items() if kind == "acceleration"]
    if not times and "index" in kinds.values():
        name = table.name(next(place for place, kind in kinds.items() if kind == "index"))
        raise ShakeError(
            f"{table.path}: column '{name}' counts samples and no column holds the time: name the step in a "
            "line 'NPTS= …, DT= … SEC' above one column, or write the time"
        )
    if len(kinds) == 2 and not times:
        times = [next(place for place in kinds if place not in several)]
    if len(kinds) == 2 and not several:
        several = [next(place for place in kinds if place not in times)]
        if kinds[several[0]]:
            raise ShakeError(
                f"{table.path}: column '{table.name(several[0])}' holds {kinds[several[0]]}, not acceleration"
            )
    if len(times) != 1 or not several:
        held = ", ".join(f"'{table.name(place)}'" for place in kinds)
        raise ShakeError(
            f"{table.path}: {len(kinds)} columns without a heading that names one 'time' and one "
            f"'acceleration' ({held})"
        )
    names = [table.name(place) for place in several]
    number = chosen(table.path, names, channel)
    return times[0], several[number], {"channel": f"{number + 1} of {len(names)}"} if len(names) > 1 else {}


def _unit(table: ColumnTable, place: int, asked: str) -> tuple[str, tuple[str, ...]]:
    """The unit of the acceleration, and a warning where it is assumed."""
    unit = table.unit(place)
    named = unit_in(f"[{unit.text}]") if unit else next((u for line in table.header if (u := unit_in(line))), "")
    if asked and named and asked != named:
        raise ShakeError(f"{table.path}: the heading says {named}, not {asked}")
    if asked or named:
        return asked or named, ()
    return "m/s2", ("neither the file nor the caller names a unit, taken as m/s2",)


def _step(table: ColumnTable, place: int, time: Array) -> float:
    """The time step [s]; an error where time stands still, goes back, or is not uniform to its printed digits."""
    if len(time) < 2:
        raise ShakeError(f"{table.path}, {table.line(0)}: one sample is not a record")
    unit = table.unit(place)
    steps = np.diff(time)
    wrong = np.flatnonzero(steps <= 0.0)
    if wrong.size:
        i = int(wrong[0]) + 1
        raise ShakeError(f"{table.path}, {table.line(i)}: time does not advance: {time[i]:g} s after {time[i - 1]:g} s")
    step, typical = float(time[-1] - time[0]) / steps.size, float(np.median(steps))
    if unit is None and AT_LEAST <= typical:
        raise ShakeError(
            f"{table.path}: time step {typical:g} without a unit: write 'time [s]' or 'time [ms]' above the column"
        )
    digits = next((d for d in range(13) if np.allclose(np.round(time[:1000], d), time[:1000], 0.0, 1e-3 * typical)), 13)
    resolution = 1.01 * 10.0**-digits
    tolerance = max(0.01 * typical, resolution if resolution <= 0.41 * typical else 0.0)  # coarser excuses nothing
    uneven = np.flatnonzero(np.abs(steps - typical) > tolerance)
    if uneven.size:
        i = int(uneven[0]) + 1
        raise ShakeError(
            f"{table.path}, {table.line(i)}: time is not uniform: a step of {steps[i - 1]:g} s where {typical:g} s "
            "is usual"
        )
    drift = np.abs(time - time[0] - step * np.arange(time.size))
    if np.max(drift) > tolerance:
        i = int(np.argmax(drift))
        raise ShakeError(f"{table.path}, {table.line(i)}: time is not uniform: {drift[i]:g} s off a step of {step:g} s")
    return step * (unit.factor if unit else 1.0)
