"""Figure of recordings: command, position and acceleration over time."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.figure import Figure

from shake_ros.data.recordings import TableRecording
from shake_ros.report.style import BEFORE, MEASURED, new_figure, tidy

CHANNELS = (("valve_command", "command [-]", 1.0), ("position", "position [mm]", 1e3))
REFERENCE = {"position": 0, "acceleration": 2}  # column of a reference
ACCELERATION = ("acceleration", "acceleration [m/s²]", 1.0)


def recordings_figure(recordings: Sequence[TableRecording]) -> Figure:
    """A column for each recording, a row for each signal."""
    channels = [*CHANNELS, *([ACCELERATION] if any(r.acceleration is not None for r in recordings) else [])]
    figure = new_figure(5.0 + 4.5 * (len(recordings) - 1), 2.2 * len(channels))
    grid = figure.subplots(len(channels), len(recordings), squeeze=False, sharex="col", sharey="row")
    for column, recording in enumerate(recordings):
        grid[0, column].set_title(recording.name)
        for row, (signal, label, scale) in enumerate(channels):
            axes, values = grid[row, column], getattr(recording, signal)
            if signal in REFERENCE and recording.reference is not None:
                wanted = scale * recording.reference[:, REFERENCE[signal]]
                axes.plot(recording.time, wanted, color=BEFORE, linewidth=0.8, label="reference")
            if values is not None:
                axes.plot(recording.time, scale * values, color=MEASURED, linewidth=0.8)
            tidy(axes, "time [s]" if row == len(channels) - 1 else "", label if column == 0 else "")
    return figure
