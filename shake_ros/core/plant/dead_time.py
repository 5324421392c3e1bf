"""The dead time between a command and its action: that of a table, and that of the loop around it."""

from __future__ import annotations

import math

from shake_ros.core.plant.parameters import TableParameters

DELAY = "effects.command_delay.delay"


def dead_time(table: TableParameters, sample_time: float) -> tuple[int, float]:
    """Whole samples and fraction of a sample of the table's dead time."""
    delay = table.value(DELAY) / sample_time
    whole = math.floor(delay)
    return whole, delay - whole


def delayed_by(table: TableParameters, loop_delay: float) -> TableParameters:
    """The table as a loop sees it that delays each command by `loop_delay` [s] before the table does."""
    return table.with_values({DELAY: table.value(DELAY) + loop_delay}) if loop_delay else table
