"""`figures`: the thesis's figures drawn again from the equations in the package, and a figure of each effect."""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from shake_ros.core.effects import EFFECTS
from shake_ros.core.plant.simulation import run
from shake_ros.core.quantities import unknown_name
from shake_ros.report.static_figure import BEFORE, GREY, new_figure, tidy
from shake_ros.settings import find, load_table, read_yaml

if TYPE_CHECKING:
    from matplotlib.figure import Figure


HARMONICS = 15
LOWEST_SHOWN = 3e-3  # [m/s²]
OUTPUT, UNITS = {"position_sensor_lag": 0}, {0: "position [m]", 2: "acceleration [m/s²]"}


def strength(name: str) -> dict[str, float]:
    """Parameters at which an effect is shown: of config/figures/effects.yaml, else its first trial of the search."""
    own = read_yaml(find("figures", "effects"))["strengths"]
    chosen: dict[str, float] = own[name] if name in own else read_yaml(find("discovery", "effects"))[name]["trials"][0]
    return chosen


def responses(name: str, frequency: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times [s], shape (n,), and the declared and the extended table's output over the last periods, both (n,)."""
    content: dict[str, Any] = read_yaml(find("figures", "effects"))
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
    content: dict[str, Any] = read_yaml(find("figures", "effects"))
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
            right.set_ylim(bottom=LOWEST_SHOWN)
        tidy(left, "time [s]", unit, f"{frequency:g} Hz")
        tidy(right, "harmonic", unit)
    panels[0][0].legend(frameon=False, fontsize=9, loc="upper right")
    return figure


ALL = "all"


@dataclass(frozen=True)
class Drawing:
    """A figure: the module and function that draw it, `module:function`, and what it shows in a line."""

    drawn_by: str
    line: str


FIGURES: dict[str, Drawing] = {
    "2.4": Drawing("shake_ros.thesis.figures_laws:entrained_air", "bulk modulus with entrained air, four models"),
    "2.5": Drawing("shake_ros.thesis.figures_laws:empirical", "empirical formulas for the bulk modulus"),
    "3.6": Drawing("shake_ros.thesis.figures_laws:curves", "steady friction of all laws against velocity"),
    "3.7": Drawing("shake_ros.thesis.figures_laws:lag", "frictional lag"),
    "3.8": Drawing("shake_ros.thesis.figures_laws:reversal", "hysteresis with velocity"),
    "3.9": Drawing("shake_ros.thesis.figures_laws:presliding", "pre-sliding displacement"),
    "3.10": Drawing("shake_ros.thesis.figures_laws:stick_slip", "stick-slip at 1 mm/s"),
    "break_away": Drawing("shake_ros.thesis.figures_laws:break_away", "break-away force against force rate"),
    "6.10": Drawing("shake_ros.thesis.figures_table:steps", "steps of the detailed and the simplified valve"),
    "6.11": Drawing("shake_ros.thesis.figures_table:second_order_step", "full step of the valve of table 6.4"),
    "valve_frequency": Drawing(
        "shake_ros.thesis.figures_table:frequency_response", "frequency response of both valves"
    ),
    "describing_functions": Drawing(
        "shake_ros.thesis.figures_table:describing_functions", "gain and phase of the table over amplitude (4.3)"
    ),
    "oil_spring": Drawing("shake_ros.thesis.figures_table:oil_spring", "frequency of the oil column along the stroke"),
    "flow_force": Drawing(
        "shake_ros.thesis.figures_table:flow_force", "axial flow force, and steps of the spool with it"
    ),
    **{
        name: Drawing("shake_ros.thesis.figures:effect_figure", f"what {name} does to a 2 Hz and a 5 Hz sine")
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
    found = {}
    for name in known_figures(names):
        module, function = FIGURES[name].drawn_by.split(":")
        draw = getattr(importlib.import_module(module), function)
        found[name] = draw(name) if name in EFFECTS else draw()
    return found
