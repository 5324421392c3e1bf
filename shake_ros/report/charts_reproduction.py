"""Charts of the reproduction: motions over each other, errors over frequency, a study of one parameter, training."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from shake_ros.core.analysis.parameter_study import ParameterStudy
from shake_ros.report.chart import Array, Chart, ChartSeries, Panel
from shake_ros.report.figures_sensitivity import HIGHEST_HARMONIC, ROWS, SHOWN_PERIODS, label

CHANNELS = ("velocity", "acceleration")
UNITS = {"velocity": "m/s", "acceleration": "m/s²"}
COLOURS = ("measured", "before", "after", "c3")


def motions(name: str, time: Array, runs: Mapping[str, tuple[Array, Array]], caption: str) -> Chart:
    """Velocity above, acceleration below; the first run is drawn as what the others should be.

    Parameters
    ----------
    name, caption : of the chart. time : (n,) [s]. runs : velocity [m/s] and acceleration [m/s²], each (n,), by name.
    """
    panels = [
        Panel(
            f"{channel} [{UNITS[channel]}]",
            time,
            tuple(
                ChartSeries(title, run[k], colour, width=2.0 if colour == "measured" else 1.2)
                for (title, run), colour in zip(runs.items(), COLOURS, strict=False)
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
        series = [ChartSeries(label(study, float(v)), runs[i], f"c{i}") for i, v in enumerate(study.values)]
        panels.append(Panel(title, time, tuple(series)))
    return Chart(name, "time [s]", tuple(panels), caption)


def study_spectrum(name: str, study: ParameterStudy, frequency: float, samples: int, caption: str) -> Chart:
    """Figures 6.20, 6.22, 6.24: amplitudes of the acceleration's harmonics."""
    found, amplitudes = study.spectrum(samples)
    harmonics = frequency * np.arange(1, HIGHEST_HARMONIC + 1)
    places = [int(np.argmin(np.abs(found - f))) for f in harmonics]
    series = [
        ChartSeries(label(study, float(v)), amplitudes[i, places], f"c{i}", kind="marks")
        for i, v in enumerate(study.values)
    ]
    panel = Panel("acceleration [m/s²]", harmonics, tuple(series), log=True)
    return Chart(name, "frequency [Hz]", (panel,), caption)


def training(name: str, curves: Sequence[Array], caption: str) -> Chart:
    """Mean square error on the parts to learn, stop by and test over the epochs, a curve for each seed.

    Parameters
    ----------
    name, caption : of the chart. curves : each (epochs + 1, 3).
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
