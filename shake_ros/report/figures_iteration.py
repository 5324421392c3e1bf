"""Figure of a drive-file iteration: error against the run's number, and the response spectra."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

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
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.0, 4.0), layout="constrained")
    FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2)
    number = np.arange(1, len(errors) + 1)
    left.plot(number, 100.0 * np.asarray(errors), "o-", label="acceleration, NRMSE")
    left.plot(number, 100.0 * np.asarray(spectra), "s--", label="response spectrum, largest")
    left.set(xlabel="run", ylabel="error [%]", ylim=(0.0, None))
    left.legend()
    right.semilogx(frequencies, wanted, color="0.6", linewidth=3.0, label="wanted")
    right.semilogx(frequencies, found, label="best run")
    right.set(xlabel="frequency [Hz]", ylabel="response at 5 % damping [m/s²]")
    right.legend()
    figure.savefig(path, dpi=120)
