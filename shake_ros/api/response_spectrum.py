"""`response_spectrum`: the elastic response spectrum of a recording, a simulation or an array."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from shake_ros.api.signals import Source, naming, one_recording
from shake_ros.core.analysis import response_spectrum as analysis
from shake_ros.core.loop.metrics import DAMPING, HIGHEST, LOWEST
from shake_ros.core.quantities import ShakeError
from shake_ros.data.accelerograms.accelerogram import Accelerogram

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = npt.NDArray[np.float64]
PERIODS = 80


@dataclass(frozen=True, repr=False)
class ResponseSpectrum:
    """A response spectrum, all arrays of shape (m,).

    Attributes
    ----------
    name : of what it is of. damping : ξ [-]. periods : natural periods [s].
    displacement : largest relative displacement [m]. velocity : pseudo-velocity [m/s].
    acceleration : largest absolute acceleration [m/s²].
    """

    name: str
    damping: float
    periods: Array
    displacement: Array
    velocity: Array
    acceleration: Array

    def __repr__(self) -> str:
        peak = int(np.argmax(self.acceleration))
        return (
            f"{self.name}: response spectrum, {100.0 * self.damping:g} % damping, {len(self.periods)} periods from "
            f"{self.periods.min():.3g} to {self.periods.max():.3g} s, "
            f"at most {self.acceleration[peak]:.4g} m/s² at {self.periods[peak]:.3g} s"
        )

    def plot(self) -> Figure:
        """Absolute acceleration and relative displacement over the period."""
        from shake_ros.report.record_page import spectrum_chart
        from shake_ros.report.static_figure import static_figure

        spectra = {self.name: (self.periods, self.displacement, self.acceleration)}
        return static_figure(spectrum_chart("spectrum", spectra, self.damping))


def response_spectrum(
    source: Source | Accelerogram | npt.ArrayLike,
    periods: npt.ArrayLike | None = None,
    damping: float = DAMPING,
    sample_time: float | None = None,
) -> ResponseSpectrum:
    """The elastic response spectrum of an acceleration (Nigam and Jennings, 1969).

    Parameters
    ----------
    source : a recording with acceleration, its path, a simulation, an accelerogram, or an array of shape (n,) [m/s²].
    periods : natural periods; 80 from 1/15 to 2 s where not given [s]. damping : ξ, 0 … 1 [-].
    sample_time : of an array [s].

    Raises
    ------
    ShakeError
        No acceleration, an array without sample time, periods or damping out of range.

    Examples
    --------
    >>> import shake_ros as sr
    >>> sine = np.sin(2 * np.pi * 2 * np.arange(20000) / 1000)
    >>> found = sr.response_spectrum(sine, periods=[0.5], damping=0.05, sample_time=0.001)
    >>> round(float(found.acceleration[0]), 2)  # resonance: about 1/(2 ξ)
    10.05
    """
    if isinstance(source, Accelerogram):
        name, felt, step = source.name, source.acceleration, source.time_step
    elif isinstance(source, list | tuple | np.ndarray):
        if sample_time is None:
            raise ShakeError("response_spectrum: an array needs its sample_time")
        name, felt, step = "acceleration", np.asarray(source, dtype=np.float64), sample_time
    else:
        with naming(source):  # type: ignore[arg-type]
            part = one_recording(source).longest  # type: ignore[arg-type]
            if part.acceleration is None:
                raise ShakeError("no topic imu: there is no acceleration")
            name, felt, step = part.name, part.acceleration, part.sample_time
    wanted = np.geomspace(1.0 / HIGHEST, 1.0 / LOWEST, PERIODS) if periods is None else np.asarray(periods, dtype=float)
    return ResponseSpectrum(name, damping, wanted, *analysis.response_spectrum(felt, step, wanted, damping))
