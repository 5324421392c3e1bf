"""A figure per effect: what it does to the acceleration of a sine of 2 Hz and of 5 Hz."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from shake_ros.core.effects import EFFECTS
from shake_ros.core.plant.simulation import run
from shake_ros.report.static_figure import BEFORE, GREY, new_figure, tidy
from shake_ros.settings import find, load_table, read_yaml

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
