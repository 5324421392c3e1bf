"""A command that is recorded after it acted: the table seems to move before it is told to.

A logger that takes the command from another program, or through a filter, has it late. The delay of the linear table
nearest to the response (linear_table.py) contains dead time and lag of the valve, and is above zero for every table.
Where a delay below zero explains the response clearly better than any above, the recorded command is late; where the
lines do not reach the hydraulic frequency, its damping explains either, and nothing is moved. No dead time of a model
explains a late command, so the commands are moved to where a delay is left. The dead time that is found counts from
there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from shake_ros.fit.nuisances.prepared import Prepared
from shake_ros.fit.records import Record
from shake_ros.fit.start.linear_table import WORTH, linear_table
from shake_ros.quantities import ShakeError

LEAD = 0.02  # by which commands are earlier for a look at a delay below zero [s]
LEFT = 5e-3  # delay that a late command is left with: dead time and valve of a usual table [s]


def lead(records: Sequence[Record]) -> float:
    """Time by which the motion comes before the held command [s]; 0 where a delay explains the response as well.

    A command that is held from sample to sample is half a sample late by itself, in a simulation as well.
    """
    held = 0.5 * min(r.sample_time for r in records)
    try:
        moved = linear_table([earlier(r, LEAD) for r in records])
        ahead = LEAD + held - moved.delay
        late = ahead > 0.0 and moved.cost < WORTH * linear_table(records).cost
    except ShakeError:  # no coherent line
        return 0.0
    return ahead if late else 0.0


def earlier(record: Record, time: float) -> Record:
    """The recording with its command earlier by a time [s], to whole samples and the fraction between two of them."""
    samples = time / record.sample_time
    whole, part = int(samples), samples - int(samples)
    u = record.commands
    moved = (1.0 - part) * u + part * np.append(u[1:], u[-1])
    count = len(u) - whole
    command_before = float(moved[whole - 1]) if whole else record.command_before
    return replace(record.part(slice(0, count)), commands=moved[whole:], command_before=command_before)


def in_time(data: Prepared) -> Prepared:
    """The recordings with their commands moved to where they are before the motion, where they were behind it."""
    first = lead(data.estimation)
    if not first:
        return data
    return moved_ahead(data, LEFT + first)


def moved_ahead(data: Prepared, time: float) -> Prepared:
    """The recordings with their commands earlier by a time [s], up to whole samples."""
    step = max(r.sample_time for r in data.estimation)
    ahead = step * np.ceil(time / step)
    both = [[earlier(r, ahead) for r in records] for records in (data.estimation, data.validation)]
    return replace(data, estimation=both[0], validation=both[1], ahead=float(ahead))
