"""`acceleration_spectra`: absolute acceleration spectra of a recording at several dampings, over the frequency."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from shake_ros.api.result_table import ResultTable
from shake_ros.api.signals import Source, naming, one_recording
from shake_ros.core.analysis.oscillators import HIGHEST, acceleration_spectrum
from shake_ros.core.quantities import ShakeError
from shake_ros.data.accelerograms import read_accelerogram
from shake_ros.data.accelerograms.accelerogram import Accelerogram
from shake_ros.data.results import refuse_existing, writing

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = npt.NDArray[np.float64]
DAMPING, LOW, HIGH, PER_OCTAVE, MOST = (0.05,), 0.1, 100.0, 6, 96


@dataclass(frozen=True, repr=False)
class AccelerationSpectra:
    """Largest absolute accelerations of oscillators on a table.

    Attributes
    ----------
    name : of what they are of. damping : (k,) ξ [-]. frequencies : (m,) natural frequencies [Hz].
    acceleration : (k, m) [m/s²]. peak : largest acceleration of the record itself [m/s²].
    """

    name: str
    damping: tuple[float, ...]
    frequencies: Array
    acceleration: Array
    peak: float

    @property
    def frame(self) -> ResultTable:
        """A row a frequency, a column a damping."""
        heads = tuple(f"{100.0 * d:g} % [m/s²]" for d in self.damping)
        rows = [(float(f), *map(float, found)) for f, found in zip(self.frequencies, self.acceleration.T, strict=True)]
        return ResultTable(("frequency [Hz]", *heads), rows)

    def __repr__(self) -> str:
        return f"{self.name}: absolute acceleration, peak of the record {self.peak:.4g} m/s²\n{self.frame!r}"

    def plot(self) -> Figure:
        """Acceleration over the frequency, a curve a damping."""
        from shake_ros.report.style import COLOURS, new_figure, tidy

        figure = new_figure(8.0, 4.5)
        axes = figure.subplots()
        for found, damping, colour in zip(self.acceleration, self.damping, COLOURS * 4, strict=False):
            axes.loglog(self.frequencies, found, color=colour, label=f"{100.0 * damping:g} %")
        tidy(axes, "frequency [Hz]", "absolute acceleration [m/s²]")
        axes.legend(frameon=False, title="damping")
        return figure

    def write(self, path: str | Path, force: bool = False) -> None:
        """Columns of frequency and acceleration, comma-separated; `force` replaces a file."""
        out = Path(path)
        refuse_existing(out, force=force)
        head = ",".join(["frequency [Hz]", *(f"acceleration at {100.0 * d:g} % [m/s2]" for d in self.damping)])
        with writing():
            out.parent.mkdir(parents=True, exist_ok=True)
            np.savetxt(
                out,
                np.column_stack([self.frequencies, self.acceleration.T]),
                fmt="%.9g",
                delimiter=",",
                header=head,
                comments="",
            )


def acceleration_spectra(
    source: Source | Accelerogram,
    damping: Sequence[float] = DAMPING,
    low: float = LOW,
    high: float | None = None,
    per_octave: int = PER_OCTAVE,
) -> AccelerationSpectra:
    """Absolute acceleration spectra, exact to 0.45 of the sampling rate.

    Parameters
    ----------
    source : a recording with acceleration, its path, a simulation, or an accelerogram or its path; the mean is taken
        off, for the oscillators start at rest. damping : ξ, one or several [-].
    low, high : ends of the band; `high` is 100 Hz, or 0.45 of the sampling rate where that is lower [Hz].
    per_octave : frequencies of an octave.

    Raises
    ------
    ShakeError
        No acceleration, a band or damping out of range.

    Examples
    --------
    >>> import shake_ros as sr
    >>> time = np.arange(20000) / 1000
    >>> run = sr.recording("sine", time, 0 * time, 0 * time, acceleration=np.sin(2 * np.pi * 2 * time))
    >>> found = sr.acceleration_spectra(run, damping=[0.05, 0.1], low=2.0, high=4.0, per_octave=1)
    >>> found.acceleration.round(2).tolist()  # at the resonance √(1 + 4ξ²)/(2ξ); above it the start from rest shows
    [[10.05, 1.62], [5.1, 1.54]]
    """
    name, felt, step = _acceleration(source)
    top = HIGHEST / step
    last = min(HIGH, top) if high is None else high
    if not 0.0 < low < last <= top * (1.0 + 1e-9):
        raise ShakeError(f"{name}: the band {low:g} … {last:g} Hz does not rise from above 0 to at most {top:.4g} Hz")
    if not 1 <= per_octave <= MOST:
        raise ShakeError(f"{name}: {per_octave} frequencies of an octave are not within 1 … {MOST}")
    if not damping:
        raise ShakeError(f"{name}: no damping is given")
    f = np.geomspace(low, last, max(2, math.ceil(per_octave * math.log2(last / low) - 1e-9) + 1))
    about = felt - float(np.mean(felt))
    try:
        found = np.array([acceleration_spectrum(about, step, f, d) for d in damping])
    except ShakeError as error:
        raise ShakeError(f"{name}: {error}") from None
    return AccelerationSpectra(name, tuple(damping), f, found, float(np.max(np.abs(about))))


def _acceleration(source: Source | Accelerogram) -> tuple[str, Array, float]:
    """Name, acceleration (n,) [m/s²] and sample time [s] of what was given."""
    path = Path(source) if isinstance(source, str | Path) else None
    if path is not None and path.is_file() and path.suffix not in (".mcap", ".db3"):
        source = read_accelerogram(path)
    if isinstance(source, Accelerogram):
        return source.name, source.acceleration, source.time_step
    with naming(source):
        part = one_recording(source).longest
        if part.acceleration is None:
            raise ShakeError("no topic imu: there is no acceleration")
        return part.name, part.acceleration, part.sample_time
