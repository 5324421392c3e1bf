"""Figures 6.61 and 6.62 for any controllers: errors of position and velocity over time, and their spectra."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from shake_ros.core.control.closed_loop import ClosedLoop
from shake_ros.report.chart import Array, Chart, ChartSeries, Panel

QUANTITIES = (("position", "mm"), ("velocity", "mm/s"))
HIGHEST_SHOWN = 30.0  # [Hz]
LEAST_SHOWN = 1e-5  # of the reference's largest line: a synthetic reference has next to nothing beyond its band


def error_chart(runs: Mapping[str, ClosedLoop], case: str = "", part: int = 1) -> Chart:
    """Figure 6.61: position and velocity error of each controller over time."""
    panels = []
    for column, (name, unit) in enumerate(QUANTITIES):
        time = np.arange(max(len(run.command) for run in runs.values())) * next(iter(runs.values())).sample_time
        series = []
        for k, (label, run) in enumerate(runs.items()):
            error = np.full(len(time), np.nan)
            error[: len(run.truth)] = 1e3 * (run.truth[:, column] - run.reference[:, column])
            series.append(ChartSeries(label, error, f"c{k % 6}"))
        panels.append(Panel(f"{name} error [{unit}]", time, tuple(series)))
    return Chart(f"errors_{part}", "time [s]", tuple(panels), f"Position and velocity error{case and f', {case}'}")


def response_chart(number: str, run: ClosedLoop, caption: str) -> Chart:
    """Position and velocity of one run over its reference, and the command, as figures 6.43 to 6.60."""
    time = np.arange(len(run.command)) * run.sample_time
    panels = [
        Panel(
            f"{name} [{unit}]",
            time,
            (
                ChartSeries("reference", 1e3 * run.reference[:, column], "measured", width=1.8),
                ChartSeries("table", 1e3 * run.truth[:, column], "after"),
            ),
        )
        for column, (name, unit) in enumerate(QUANTITIES)
    ]
    panels.append(Panel("command [-]", time, (ChartSeries("command", run.command, "before"),)))
    return Chart(f"figure_{number.split(',', maxsplit=1)[0]}", "time [s]", tuple(panels), caption)


def amplitudes(signal: Array, sample_time: float) -> tuple[Array, Array]:
    """Frequencies [Hz] and amplitudes of the signal's lines up to 30 Hz [unit of the signal]."""
    spectrum = 2.0 * np.abs(np.fft.rfft(signal - signal.mean())) / len(signal)
    frequency = np.asarray(np.fft.rfftfreq(len(signal), sample_time), dtype=np.float64)
    shown = (frequency > 0.0) & (frequency <= HIGHEST_SHOWN)
    return frequency[shown], spectrum[shown]


def spectrum_chart(runs: Mapping[str, ClosedLoop], case: str = "", part: int = 1) -> Chart:
    """Figure 6.62: spectra of position and velocity of the reference and under each controller."""
    panels = []
    first = next(iter(runs.values()))
    sound = {label: run for label, run in runs.items() if np.isfinite(run.truth).all()}
    for column, (name, unit) in enumerate(QUANTITIES):
        frequency, wanted = amplitudes(1e3 * first.reference[:, column], first.sample_time)
        least = LEAST_SHOWN * float(np.max(wanted, initial=0.0))

        def shown(lines: Array, least: float = least) -> Array:
            return np.where(lines >= least, lines, np.nan)

        series = [ChartSeries("reference", shown(wanted), "measured", width=1.8)]
        for label, run in sound.items():
            found = amplitudes(1e3 * run.truth[:, column], run.sample_time)[1]
            if len(found) == len(frequency):
                series.append(ChartSeries(label, shown(found), f"c{list(runs).index(label) % 6}"))
        panels.append(Panel(f"{name} [{unit}]", frequency, tuple(series), log=True))
    caption = f"Amplitude spectra of position and velocity{case and f', {case}'}"
    return Chart(f"spectra_{part}", "frequency [Hz]", tuple(panels), caption)
