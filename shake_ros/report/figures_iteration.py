"""Figure of a drive-file iteration: error against the run's number, and the response spectra."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from shake_ros.core.loop.metrics import FREQUENCIES, HIGHEST, LOWEST
from shake_ros.report.style import COLOURS, GREY, new_figure, tidy

Array = NDArray[np.float64]


def iteration_figure(errors: Sequence[float], spectra: Sequence[Array], wanted: Array, best: int) -> Figure:
    """Errors on the left, spectra on the right.

    Parameters
    ----------
    errors : of the acceleration, one a run [-]. spectra : response spectra as of `loop.metrics.spectrum_of`, one a run,
        wanted : that of the reference [m/s²]. best : index of the run whose spectrum is drawn.
    """
    largest = [float(np.max(np.abs(found / wanted - 1.0))) for found in spectra]
    frequencies = np.geomspace(LOWEST, HIGHEST, FREQUENCIES)
    figure = new_figure(10.0, 4.0)
    left, right = figure.subplots(1, 2)
    number = np.arange(1, len(errors) + 1)
    left.plot(number, 100.0 * np.asarray(errors), "o-", color=COLOURS[0], label="acceleration, NRMSE")
    left.plot(number, 100.0 * np.asarray(largest), "s--", color=COLOURS[1], label="response spectrum, largest")
    left.set_ylim(bottom=0.0)
    tidy(left, "run", "error [%]")
    left.legend(frameon=False)
    right.semilogx(frequencies, wanted, color=GREY, linewidth=3.0, label="wanted")
    right.semilogx(frequencies, spectra[best], color=COLOURS[0], label="best run")
    tidy(right, "frequency [Hz]", "response at 5 % damping [m/s²]")
    right.legend(frameon=False)
    return figure
