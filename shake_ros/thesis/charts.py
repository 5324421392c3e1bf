"""Charts of the reproduction: motions over each other, errors over frequency, training, studies of one parameter.

A study is what a single parameter of (6.15) does to the table's motion and to the harmonics of its acceleration, thesis
6.3.4.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shake_ros.core.plant.parameters import TableParameters
from shake_ros.core.plant.simulation import initial_state, run_batch
from shake_ros.report.chart import Array, Chart, ChartSeries, Panel

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class ParameterStudy:
    """Simulations with one parameter changed.

    Attributes
    ----------
    name : of the parameter.
    values : shape (m,) in the unit of the thesis's θ.
    sample_time : [s].
    commands : shape (n,) [-].
    motion : shape (m, n, 3): position [m], velocity [m/s], acceleration [m/s²].
    """

    name: str
    values: Floats
    sample_time: float
    commands: Floats
    motion: Floats

    def spectrum(self, samples: int) -> tuple[Floats, Floats]:
        """Frequencies [Hz], shape (k,), and amplitudes [m/s²], shape (m, k), of the last `samples` of acceleration."""
        last = self.motion[:, -samples:, 2]
        amplitude = 2.0 / samples * np.abs(np.fft.rfft(last, axis=1))
        return np.asarray(np.fft.rfftfreq(samples, self.sample_time), dtype=float), np.asarray(amplitude, dtype=float)

    def spread(self, samples: int) -> Floats:
        """How far the runs lie apart in position, velocity and acceleration, relative to their size, shape (3,) [-].

        The root mean square over the last `samples` of the difference between the runs with the least and the greatest
        value, over that of their mean; the drift of an open-loop position is left out.
        """
        last = self.motion[:, -samples:, :] - self.motion[:, -samples:, :].mean(axis=1, keepdims=True)
        low, high = last[int(np.argmin(self.values))], last[int(np.argmax(self.values))]
        return np.asarray(np.std(high - low, axis=0) / np.std(0.5 * (high + low), axis=0))


def study_of(
    table: TableParameters,
    name: str,
    values: Floats,
    settings: list[dict[str, float]],
    commands: Floats,
    sample_time: float,
) -> ParameterStudy:
    """Simulate the table with each of `settings` (dotted names to values), side by side.

    Parameters
    ----------
    name, values : the parameter that is varied and its values.
    commands : shape (n,) [-].
    sample_time : [s].
    """
    vectors = np.array([table.with_values(changes).vector() for changes in settings])
    starts = np.array([initial_state(vector) for vector in vectors])
    motion = run_batch(vectors, starts, commands, sample_time, columns=(0, 1, 2))
    return ParameterStudy(name, np.asarray(values, dtype=float), sample_time, commands, motion)


SYMBOLS = {"theta_5": ("θ₅", "Pa/m³"), "theta_6": ("θ₆", "m³/(s·Pa)"), "theta_7": ("θ₇", "")}
ROWS = (("position [m]", 0), ("velocity [m/s]", 1), ("acceleration [m/s²]", 2))
SHOWN_PERIODS = 3
HIGHEST_HARMONIC = 15
LOWEST_SHOWN = 1e-2  # [m/s²]


def value_label(study: ParameterStudy, value: float) -> str:
    """Legend of one run."""
    symbol, unit = SYMBOLS[study.name]
    return f"{symbol} = {value:g} {unit}".rstrip()


CHANNELS = ("velocity", "acceleration")
UNITS = {"velocity": "m/s", "acceleration": "m/s²"}
RUN_COLOURS = ("measured", "before", "after", "c3")


def motions(name: str, time: Array, runs: Mapping[str, tuple[Array, Array]], caption: str) -> Chart:
    """Velocity above, acceleration below; the first run is drawn as what the others should be.

    Parameters
    ----------
    name, caption : of the chart.
    time : (n,) [s].
    runs : velocity [m/s] and acceleration [m/s²], each (n,), by name.
    """
    panels = [
        Panel(
            f"{channel} [{UNITS[channel]}]",
            time,
            tuple(
                ChartSeries(title, run[k], colour, width=2.0 if colour == "measured" else 1.2)
                for (title, run), colour in zip(runs.items(), RUN_COLOURS, strict=False)
            ),
        )
        for k, channel in enumerate(CHANNELS)
    ]
    return Chart(name, "time [s]", tuple(panels), caption)


def over_frequency(
    name: str, frequencies: Sequence[float], errors: Mapping[str, Mapping[str, Sequence[float]]], caption: str
) -> Chart:
    """Relative error of velocity and acceleration over frequency, one curve for each model."""
    x = np.array(frequencies, dtype=np.float64)
    panels = [
        Panel(
            f"error of the {channel} [%]",
            x,
            tuple(
                ChartSeries(title, 100.0 * np.array(found[channel]), f"c{k}", kind="marks")
                for k, (title, found) in enumerate(errors.items())
            ),
            log=True,
        )
        for channel in CHANNELS
    ]
    return Chart(name, "frequency [Hz]", tuple(panels), caption)


def study_motion(name: str, study: ParameterStudy, frequency: float, caption: str) -> Chart:
    """Figures 6.19, 6.21, 6.23: position, velocity and acceleration over the last periods."""
    shown = round(SHOWN_PERIODS / frequency / study.sample_time)
    time = np.arange(len(study.commands), dtype=np.float64)[-shown:] * study.sample_time
    panels = []
    for title, column in ROWS:
        runs = study.motion[:, -shown:, column]
        runs = runs - runs.mean(axis=1, keepdims=True) if column == 0 else runs
        series = [ChartSeries(value_label(study, float(v)), runs[i], f"c{i}") for i, v in enumerate(study.values)]
        panels.append(Panel(title, time, tuple(series)))
    return Chart(name, "time [s]", tuple(panels), caption)


def study_spectrum(name: str, study: ParameterStudy, frequency: float, samples: int, caption: str) -> Chart:
    """Figures 6.20, 6.22, 6.24: amplitudes of the acceleration's harmonics."""
    found, amplitudes = study.spectrum(samples)
    harmonics = frequency * np.arange(1, HIGHEST_HARMONIC + 1)
    places = [int(np.argmin(np.abs(found - f))) for f in harmonics]
    series = [
        ChartSeries(value_label(study, float(v)), amplitudes[i, places], f"c{i}", kind="marks")
        for i, v in enumerate(study.values)
    ]
    panel = Panel("acceleration [m/s²]", harmonics, tuple(series), log=True)
    return Chart(name, "frequency [Hz]", (panel,), caption)


def training(name: str, curves: Sequence[Array], caption: str) -> Chart:
    """Mean square error on the parts to learn, stop by and test over the epochs, a curve for each seed.

    Parameters
    ----------
    name, caption : of the chart.
    curves : each (epochs + 1, 3).
    """
    epochs = np.arange(max(len(c) for c in curves), dtype=np.float64)
    panels = []
    for k, title in enumerate(("to learn", "to stop by", "to test")):
        series = []
        for i, curve in enumerate(curves):
            values = np.full(len(epochs), np.nan)
            values[: len(curve)] = curve[:, k]
            series.append(ChartSeries(f"run {i + 1}", values, f"c{i % 6}"))
        panels.append(Panel(f"error {title} [-]", epochs, tuple(series), log=True))
    return Chart(name, "epoch", tuple(panels), caption)
