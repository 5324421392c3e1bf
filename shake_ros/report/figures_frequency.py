"""Figure of a frequency response: gain, delay and coherence over frequency."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from shake_ros.core.analysis.frequency_response import COHERENT, FrequencyResponse
from shake_ros.report.style import AFTER, BEFORE, MEASURED, new_figure, tidy


def response_figure(found: FrequencyResponse, highest: float, unit: str) -> Figure:
    """Gain ± two deviations, delay and coherence up to `highest` [Hz]; gain and delay on coherent lines."""
    shown = found.frequency <= highest
    good = shown & (found.coherence >= COHERENT)
    frequency, gain, spread = found.frequency[good], found.gain[good], 2.0 * found.deviation[good]
    figure = new_figure(9.5, 7.2)
    upper, middle, lower = figure.subplots(3, 1, sharex=True)
    upper.fill_between(frequency, gain * (1.0 - spread), gain * (1.0 + spread), color=AFTER, alpha=0.2, linewidth=0.0)
    upper.plot(frequency, gain, color=AFTER, linewidth=1.4)
    upper.set_yscale("log")
    middle.plot(frequency, 1e3 * found.delay[good], color=BEFORE, linewidth=1.4)
    lower.plot(found.frequency[shown], found.coherence[shown], color=MEASURED, linewidth=1.2)
    lower.set_ylim(0.0, 1.02)
    lower.set_xscale("log")
    lower.set_xlim(float(np.min(found.frequency)), highest)
    tidy(upper, "", f"gain [{unit}]")
    tidy(middle, "", "delay [ms]")
    tidy(lower, "frequency [Hz]", "coherence [-]")
    return figure
