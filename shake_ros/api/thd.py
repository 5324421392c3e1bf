"""`thd`: the harmonics of an acceleration and their total harmonic distortion (6.1)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shake_ros.api.read import Source, naming, one_recording
from shake_ros.core.analysis import thd as analysis
from shake_ros.core.analysis.stretches import steady_part
from shake_ros.core.analysis.thd import Harmonics, fundamental_frequency, nearby_fundamental
from shake_ros.core.quantities import ShakeError
from shake_ros.data.recordings import TableRecording

SHOWN = 15
ANOTHER_CLOCK = 20.0  # parts in a million, from which a frequency is said to be another
APERIODIC = 0.3  # of an excitation's root mean square in no harmonic, from which on it has no fundamental


@dataclass(frozen=True, repr=False)
class Distortion:
    """Harmonics of the acceleration of one recording.

    Attributes
    ----------
    name : of the recording.
    harmonics : amplitudes [m/s²], phases [rad], noise [m/s²].
    origin : where the fundamental is from.
    shown : orders that are printed.
    """

    name: str
    harmonics: Harmonics
    origin: str
    shown: int = SHOWN

    @property
    def thd(self) -> float:
        """Total harmonic distortion (6.1) [-]."""
        return self.harmonics.thd

    def __repr__(self) -> str:
        found = self.harmonics
        rate = (found.samples - 1) / (found.stop - found.start)
        lines = [
            f"{self.name}: acceleration",
            f"fundamental {found.frequency:.6g} Hz ({self.origin}), {found.periods:.0f} periods "
            f"from {found.start:.3f} to {found.stop:.3f} s, {found.samples} samples at {rate:.1f} Hz",
            "order  frequency [Hz]  amplitude [m/s²]  of the fundamental [%]  phase [rad]",
        ]
        for k in found.orders[: self.shown]:
            amplitude, phase = found.amplitude[k - 1], found.phase[k - 1]
            share = 100.0 * amplitude / found.amplitude[0]
            lines.append(f"{k:5d}  {k * found.frequency:14.4f}  {amplitude:16.6f}  {share:22.4f}  {phase:11.4f}")
        lines += [
            f"THD            {100.0 * found.thd:.3f} % (6.1), orders 2 to {len(found.amplitude)}",
            f"THD and noise  {100.0 * found.thd_and_noise:.3f} %, all that is not the fundamental",
            f"noise          {found.noise:.6f} m/s² rms in no harmonic; its floor {found.floor:.6f} m/s², "
            f"which varies an amplitude by {found.amplitude_error:.6f} m/s²",
        ]
        return "\n".join(lines)


def thd(
    source: Source,
    frequency: float | None = None,
    harmonics: int | None = None,
    start: float | None = None,
    stop: float | None = None,
) -> Distortion:
    """Harmonics of the acceleration over whole periods, by a least-squares fit.

    Parameters
    ----------
    source : a recording, its path, or a simulation.
    frequency : fundamental, or near it; that of the reference or, without one, of the valve command where not given. It
        is fitted to the acceleration, within 1 % and two lines of the spectrum, for its clock may be another [Hz].
    harmonics : orders to fit; all below half the sampling rate where not given.
    start, stop : part of the recording; the one in which the excitation keeps its amplitude where not given [s].

    Raises
    ------
    ShakeError
        No acceleration, no periodic excitation, no whole period.

    Examples
    --------
    >>> import shake_ros as sr
    >>> t = np.arange(4000) / 1000
    >>> sine = np.sin(2 * np.pi * 2 * t)
    >>> felt = sine + 0.1 * np.sin(2 * np.pi * 6 * t)
    >>> round(sr.thd(sr.recording("sine", t, command=sine, position=0.01 * sine, acceleration=felt)).thd, 6)
    0.1
    """
    recording = one_recording(source)
    with naming(source):
        if recording.acceleration is None:
            raise ShakeError("no topic imu: there is no acceleration to analyse")
        part = _between(recording.longest, start, stop)
        name, excitation = _excitation(part)
        source_of = "as given" if frequency is not None else f"of {name}"
        if frequency is None:
            frequency = _fundamental(part.time, excitation, name)
        if start is None and stop is None:
            part = part[steady_part(part.time, excitation, frequency)]
        assert part.acceleration is not None
        own = nearby_fundamental(part.time, part.acceleration, frequency)
        found = analysis.harmonics(part.time, part.acceleration, own, harmonics)
    return Distortion(recording.name, found, _origin(own, frequency, source_of), harmonics or SHOWN)


def _origin(own: float, near: float, source: str) -> str:
    """Where a fundamental is from, in words."""
    if own == near:
        return source
    off = 1e6 * (own / near - 1.0)
    apart = f", {off:+.0f} ppm off: another clock?" if abs(off) > ANOTHER_CLOCK else ""
    return f"fitted to the acceleration near {near:.6g} Hz {source}{apart}"


def _between(part: TableRecording, start: float | None, stop: float | None) -> TableRecording:
    low = -math.inf if start is None else start
    high = math.inf if stop is None else stop
    kept = np.flatnonzero((part.time >= low) & (part.time <= high))
    if len(kept) < 2:
        first, last = part.time[0], part.time[-1]
        raise ShakeError(f"nothing between {low:g} and {high:g} s: the longest segment is {first:.3f} … {last:.3f} s")
    return part[slice(int(kept[0]), int(kept[-1]) + 1)]


def _excitation(part: TableRecording) -> tuple[str, npt.NDArray[np.float64]]:
    """Name and samples of what drives the table: the reference's position, else the valve command."""
    if part.reference is not None:
        position = part.reference[:, 0]
        if np.isfinite(position).all() and np.ptp(position) > 0.0:
            return "reference", position
    return "valve_command", part.valve_command


def _fundamental(time: npt.NDArray[np.float64], excitation: npt.NDArray[np.float64], source: str) -> float:
    """The fundamental of a periodic excitation [Hz], found anew in the part in which it keeps its amplitude."""
    if np.ptp(excitation) == 0.0:
        raise ShakeError(f"{source} is constant; name the fundamental with --frequency")
    frequency = fundamental_frequency(time, excitation)
    steady = steady_part(time, excitation, frequency)
    time, excitation = time[steady], excitation[steady]
    if len(time) > 8 and (time[-1] - time[0]) * frequency > 2.0:
        frequency = fundamental_frequency(time, excitation, near=frequency)
    share = analysis.harmonics(time, excitation, frequency).rest / float(np.std(excitation))
    if share > APERIODIC:
        raise ShakeError(
            f"{source} is not periodic ({100.0 * share:.0f} % of it in no harmonic of {frequency:.3f} Hz); "
            "name the fundamental with --frequency"
        )
    return frequency
