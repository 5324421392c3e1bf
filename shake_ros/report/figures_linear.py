"""The table as a linear system and where it is none: describing functions (4.3), the oil spring along the stroke."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from shake_ros.core.analysis.frequency_response import describing_function
from shake_ros.core.plant.linearisation import linearise, oil_column_frequency, operating_point
from shake_ros.core.plant.parameters import TableParameters
from shake_ros.report.style import COLOURS, name_decades, new_figure, tidy
from shake_ros.settings import find, load_table, read_yaml

POINTS, PLACES = 33, 25
WITHIN = 0.75  # of the stroke
SAMPLE = 1e-3  # [s]


def settings() -> tuple[dict[str, Any], TableParameters]:
    """Content of config/figures/linear.yaml, and its table."""
    content: dict[str, Any] = read_yaml(find("figures", "linear"))
    return content, load_table(content["table"])


def describing_functions() -> Figure:
    """Gain and phase of the velocity's fundamental over frequency for several amplitudes, beside the linearised table.

    The half sample by which a held command comes late is taken off. At rest the table has no linear form that a sine
    would show: dry friction holds it; so it is linearised about a steady motion.
    """
    content, table = settings()
    frequencies = np.geomspace(content["lowest_frequency"], content["highest_frequency"], POINTS)
    found = describing_function(table, np.array(content["amplitudes"]), frequencies, sample_time=SAMPLE)
    held = np.exp(-1j * np.pi * frequencies * SAMPLE)
    fine = np.geomspace(frequencies[0], frequencies[-1], 400)
    moving = linearise(table, operating_point(table, 0.0, content["velocity"]))
    label = f"linearised at {1e3 * content['velocity']:g} mm/s"
    curves = [(label, fine, moving.response("velocity", fine), "--")]
    curves += [
        (f"amplitude {100.0 * amplitude:g} %", frequencies, row / held, "-")
        for amplitude, row in zip(found.amplitudes, found.response, strict=True)
    ]
    figure = new_figure(8.0, 6.0)
    gain, phase = figure.subplots(2, 1, sharex=True)
    for (label, axis, response, style), colour in zip(curves, COLOURS, strict=False):
        gain.loglog(axis, np.abs(response), style, color=colour, label=label)
        phase.semilogx(axis, np.degrees(np.unwrap(np.angle(response))), style, color=colour)
    gain.legend(frameon=False, fontsize=9, loc="lower left")
    for side in (gain.xaxis, gain.yaxis):
        name_decades(side)
    tidy(gain, "", "velocity per command [m/s]")
    tidy(phase, "frequency [Hz]", "phase [°]")
    return figure


def column_frequency(table: TableParameters, position: float, velocity: float) -> float:
    """Size of the oil column's pair among the poles of the table linearised at a position and steady velocity [Hz]."""
    poles = linearise(table, operating_point(table, position, velocity)).poles()
    pairs = poles[np.abs(poles.imag) > 1e-3 * np.abs(poles)]
    return float(np.abs(pairs[0]) / (2.0 * np.pi))


def oil_spring() -> Figure:
    """Frequency of the oil column along the stroke: closed form (2.25), (2.36), and poles of the linearised table."""
    content, table = settings()
    half = 0.5 * WITHIN * table.value("body.stroke")
    places = np.linspace(-half, half, PLACES)
    figure = new_figure(8.0, 4.2)
    axes = figure.subplots()
    for mass, colour in zip(content["specimens"], COLOURS, strict=False):
        loaded = table.with_values({"body.specimen_mass": mass})
        closed = [oil_column_frequency(loaded, x) / (2.0 * np.pi) for x in places]
        poles = [column_frequency(loaded, x, content["velocity"]) for x in places]
        axes.plot(1e3 * places, closed, color=colour, label=f"closed form, {mass:g} kg")
        axes.plot(1e3 * places, poles, "o", color=colour, markersize=4, label=f"poles, {mass:g} kg")
    axes.legend(frameon=False, fontsize=9, ncols=3)
    tidy(axes, "position [mm]", "frequency [Hz]")
    return figure
