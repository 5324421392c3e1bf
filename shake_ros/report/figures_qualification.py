"""Figures of a qualification: spectra with the tolerance band, motion, convergence."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter, ScalarFormatter
from numpy.typing import NDArray

from shake_ros.core.qualification.judge import SpectrumJudgement
from shake_ros.report.style import COLOURS, GREY, new_figure, tidy

Array = NDArray[np.float64]
BAND = 0.9, 1.3  # of the RRS, drawn as the tolerance band


def spectra_axes(axes: Axes, f: Array, required: Array, found: Array) -> None:
    """RRS with its band from 0.9 to 1.3, and TRS."""
    axes.fill_between(f, BAND[0] * required, BAND[1] * required, color=GREY, alpha=0.25, label="0.9 to 1.3 RRS")
    axes.loglog(f, required, color=COLOURS[1], linewidth=2.0, label="required, RRS")
    axes.loglog(f, found, color=COLOURS[0], linewidth=1.4, label="test, TRS")
    for side in (axes.xaxis, axes.yaxis):
        side.set_major_formatter(ScalarFormatter())
        side.set_minor_formatter(NullFormatter())
    marks = [m for m in (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0) if f[0] <= m <= f[-1]]
    axes.set_xticks(marks, [f"{m:g}" for m in marks])
    low, high = axes.get_ylim()
    levels = [m * 10.0**k for k in range(-3, 4) for m in (1.0, 2.0, 5.0) if low <= m * 10.0**k <= high]
    axes.set_yticks(levels, [f"{m:g}" for m in levels])
    tidy(axes, "frequency [Hz]", "absolute acceleration [m/s²]")
    axes.legend(frameon=False)


def motions(motion: Array, sample_time: float, drift: float) -> list[tuple[str, Array]]:
    """Measured acceleration, and its velocity and displacement above the frequency of its drift [Hz], with labels."""
    f = np.fft.rfftfreq(motion.size, sample_time)
    slope = np.where(f >= drift, 1.0 / (2j * np.pi * np.maximum(f, drift)), 0.0)
    spectrum = np.fft.rfft(motion)
    velocity, displacement = (np.fft.irfft(spectrum * slope**order, motion.size) for order in (1, 2))
    return [
        ("acceleration [m/s²]", motion),
        ("velocity [m/s]", velocity),
        ("displacement [mm]", 1e3 * displacement),
    ]


def motion_axes(axes: Sequence[Axes], motion: Array, sample_time: float, drift: float) -> None:
    """As many of `motions` as there are axes."""
    time = np.arange(len(motion)) * sample_time
    for place, (label, signal) in zip(axes, motions(motion, sample_time, drift), strict=False):
        place.plot(time, signal, color=COLOURS[0], linewidth=0.6)
        tidy(place, "time [s]" if place is axes[-1] else "", label)


def convergence_axes(axes: Axes, errors: Sequence[float]) -> None:
    """Error of the spectrum, run by run."""
    axes.plot(np.arange(1, len(errors) + 1), 100.0 * np.asarray(errors), "o-", color=COLOURS[0])
    axes.set_ylim(bottom=0.0)
    axes.set_xticks(np.arange(1, len(errors) + 1))
    tidy(axes, "run", "spectrum missed, rms of ln [%]")


def qualification_figure(
    judgement: SpectrumJudgement, motion: Array, sample_time: float, errors: Sequence[float]
) -> Figure:
    """Spectra, motion and convergence in one figure."""
    figure = new_figure(10.0, 6.0)
    parts = np.atleast_1d(np.asarray(figure.subfigures(2, 1, height_ratios=(3, 2)), dtype=object))
    top, bottom = parts
    spectra_axes(top.subplots(), judgement.frequencies, judgement.required, judgement.found)
    left, right = bottom.subplots(1, 2, width_ratios=(3, 1))
    motion_axes([left], motion, sample_time, 0.4 * float(judgement.frequencies[0]))
    convergence_axes(right, errors)
    return figure
