"""Figure of a drive-file iteration: error against the run's number, and the response spectra."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from shake_ros.report.style import COLOURS, GREY, new_figure, tidy

Array = NDArray[np.float64]


def draw(
    path: Path, errors: Sequence[float], spectra: Sequence[float], frequencies: Array, wanted: Array, found: Array
) -> None:
    """Write a PNG.

    Parameters
    ----------
    errors : of the acceleration, one a run [-]. spectra : largest deviation of the response spectrum, one a run [-].
    frequencies : [Hz]. wanted, found : spectra of the reference and of the best run, on those frequencies [m/s²]
    """
    figure = new_figure(10.0, 4.0)
    left, right = figure.subplots(1, 2)
    number = np.arange(1, len(errors) + 1)
    left.plot(number, 100.0 * np.asarray(errors), "o-", color=COLOURS[0], label="acceleration, NRMSE")
    left.plot(number, 100.0 * np.asarray(spectra), "s--", color=COLOURS[1], label="response spectrum, largest")
    left.set_ylim(bottom=0.0)
    tidy(left, "run", "error [%]")
    left.legend(frameon=False)
    right.semilogx(frequencies, wanted, color=GREY, linewidth=3.0, label="wanted")
    right.semilogx(frequencies, found, color=COLOURS[0], label="best run")
    tidy(right, "frequency [Hz]", "response at 5 % damping [m/s²]")
    right.legend(frameon=False)
    figure.savefig(path, dpi=120)
