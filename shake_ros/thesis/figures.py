"""`figures`: the thesis's figures drawn again, of its laws and of the table, and what each effect does to the table."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from shake_ros.physics.effects import EFFECTS
from shake_ros.physics.plant.linearisation import linearise, oil_column_frequency, operating_point
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.physics.plant.simulation import run
from shake_ros.quantities import unknown_name
from shake_ros.report.chart import BEFORE, COLOURS, GREY, name_decades, new_figure, tidy
from shake_ros.settings import find, load_table, read_yaml
from shake_ros.signals.frequency_response import describing_function
from shake_ros.thesis import figures_laws as laws
from shake_ros.thesis.figures_laws import gain_and_phase, settings

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ALL = "all"
FREQUENCIES, PLACES = 33, 25  # of the describing functions, and along the stroke
WITHIN = 0.75  # of the stroke
SAMPLE = 1e-3  # [s]
HARMONICS = 15  # of the figures of effects
LOWEST_OF_EFFECT = 3e-3  # [m/s²]
OUTPUT, UNITS = {"position_sensor_lag": 0}, {0: "position [m]", 2: "acceleration [m/s²]"}


def describing_functions() -> Figure:
    """Gain and phase of the velocity's fundamental over frequency for several amplitudes, beside the linearised table.

    The half sample by which a held command comes late is taken off. At rest the table has no linear form that a sine
    would show: dry friction holds it; so it is linearised about a steady motion.
    """
    content = settings("linear")
    table = load_table(content["table"])
    frequencies = np.geomspace(content["lowest_frequency"], content["highest_frequency"], FREQUENCIES)
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
    figure = gain_and_phase(curves, np.asarray, "velocity per command [m/s]")
    gain = figure.axes[0]
    gain.set_yscale("log")
    for side in (gain.xaxis, gain.yaxis):
        name_decades(side)
    return figure


def column_frequency(table: TableParameters, position: float, velocity: float) -> float:
    """Size of the oil column's pair among the poles of the table linearised at a position and steady velocity [Hz]."""
    poles = linearise(table, operating_point(table, position, velocity)).poles()
    pairs = poles[np.abs(poles.imag) > 1e-3 * np.abs(poles)]
    return float(np.abs(pairs[0]) / (2.0 * np.pi))


def oil_spring() -> Figure:
    """Frequency of the oil column along the stroke: closed form (2.25), (2.36), and poles of the linearised table."""
    content = settings("linear")
    table = load_table(content["table"])
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


def strength(name: str) -> dict[str, float]:
    """Parameters at which an effect is shown: of config/figures/effects.yaml, else its first trial of the search."""
    own = settings("effects")["strengths"]
    chosen: dict[str, float] = own[name] if name in own else read_yaml(find("discovery", "effects"))[name]["trials"][0]
    return chosen


def responses(name: str, frequency: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times [s], shape (n,), and the declared and the extended table's output over the last periods, both (n,)."""
    content = settings("effects")
    declared = load_table(content["table"])
    extended = declared.with_values({f"effects.{name}.{field}": value for field, value in strength(name).items()})
    dt = content["sample_time"]
    window = round(round(4.0 * frequency / 2.0) / frequency / dt)  # whole periods, about two seconds
    t = np.arange(round(content["settling"] / dt) + window) * dt
    command = content["amplitude"] * np.sin(2.0 * np.pi * frequency * t)
    column = OUTPUT.get(name, 2)
    before, after = (run(table, command, dt)[-window:, column] for table in (declared, extended))
    return t[-window:], before, after


def effect_figure(name: str) -> Figure:
    """Two periods in time and the harmonics, without and with the effect, at both frequencies."""
    content = settings("effects")
    figure = new_figure(11.0, 5.6)
    values = ", ".join(f"{field} = {value:g}" for field, value in strength(name).items())
    figure.suptitle(f"{name.replace('_', ' ')}  ({EFFECTS[name].place}; {values})", fontsize=11)
    panels = figure.subplots(2, 2)
    for (left, right), frequency in zip(panels, content["frequencies"], strict=True):
        t, before, after = responses(name, frequency)
        shown = t < t[0] + 2.0 / frequency
        harmonics = np.arange(1, HARMONICS + 1)
        places = harmonics * round(frequency * len(t) * content["sample_time"])
        for i, (signal, label) in enumerate(((before, "declared"), (after, "with the effect"))):
            colour = GREY if i == 0 else BEFORE
            left.plot(t[shown], signal[shown], color=colour, linewidth=1.4, label=label)
            amplitudes = 2.0 / len(signal) * np.abs(np.fft.rfft(signal))[places]
            right.bar(harmonics + 0.4 * i - 0.2, amplitudes, 0.4, color=colour)
        right.set_yscale("log")
        right.set_xticks(harmonics)
        unit = UNITS[OUTPUT.get(name, 2)]
        if name not in OUTPUT:
            right.set_ylim(bottom=LOWEST_OF_EFFECT)
        tidy(left, "time [s]", unit, f"{frequency:g} Hz")
        tidy(right, "harmonic", unit)
    panels[0][0].legend(frameon=False, fontsize=9, loc="upper right")
    return figure


class Drawing(NamedTuple):
    """A figure: what draws it, and what it shows in a line."""

    draw: Callable[[], Figure]
    line: str


FIGURES: dict[str, Drawing] = {
    "2.4": Drawing(laws.entrained_air, "bulk modulus with entrained air, four models"),
    "2.5": Drawing(laws.empirical, "empirical formulas for the bulk modulus"),
    "3.6": Drawing(laws.curves, "steady friction of all laws against velocity"),
    "3.7": Drawing(laws.lag, "frictional lag"),
    "3.8": Drawing(laws.reversal, "hysteresis with velocity"),
    "3.9": Drawing(laws.presliding, "pre-sliding displacement"),
    "3.10": Drawing(laws.stick_slip, "stick-slip at 1 mm/s"),
    "break_away": Drawing(laws.break_away, "break-away force against force rate"),
    "6.10": Drawing(laws.steps, "steps of the detailed and the simplified valve"),
    "6.11": Drawing(laws.second_order_step, "full step of the valve of table 6.4"),
    "valve_frequency": Drawing(laws.frequency_response, "frequency response of both valves"),
    "describing_functions": Drawing(describing_functions, "gain and phase of the table over amplitude (4.3)"),
    "oil_spring": Drawing(oil_spring, "frequency of the oil column along the stroke"),
    "flow_force": Drawing(laws.flow_force, "axial flow force, and steps of the spool with it"),
    **{
        name: Drawing(partial(effect_figure, name), f"what {name} does to a 2 Hz and a 5 Hz sine")
        for name in EFFECTS
        if "full" in EFFECTS[name].models and name != "unlisted"
    },
}


def known_figures(names: Sequence[str]) -> list[str]:
    """The names once each, or all of them; raises UnknownName."""
    for name in names:
        if name not in (*FIGURES, ALL):
            raise unknown_name("figure", name, [*FIGURES, ALL])
    return list(FIGURES) if ALL in names else list(dict.fromkeys(names))


def figures(*names: str) -> dict[str, Figure]:
    """Figures of the thesis, and what each effect does to the table.

    Parameters
    ----------
    names : numbers of figures as in the thesis, names of effects, or "all".

    Raises
    ------
    UnknownName
        With the figures there are.

    Examples
    --------
    >>> import shake_ros as sr
    >>> [len(figure.axes) for figure in sr.figures("2.4").values()]
    [4]
    """
    return {name: FIGURES[name].draw() for name in known_figures(names)}
