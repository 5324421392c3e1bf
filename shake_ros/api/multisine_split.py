"""`multisine_split`: a response to repeated periods split into linear, even and odd nonlinear parts and noise."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from shake_ros.api.read import Source, naming, one_recording
from shake_ros.core.analysis import multisine_split as analysis
from shake_ros.core.analysis.multisine_split import MultisineSplit
from shake_ros.core.quantities import ShakeError, unknown_name
from shake_ros.data.recordings import TableRecording

if TYPE_CHECKING:
    from matplotlib.figure import Figure

UNITS = {"acceleration": "m/s²", "position": "m"}
PARTS = {
    "linear": "excited lines less odd distortion and noise",
    "even": "even lines left out",
    "odd": "odd lines left out, and their level on excited lines",
    "noise": "what does not repeat",
}
SHOWN_BAND = 4.0  # multiples of the highest excited frequency in the figure


@dataclass(frozen=True, repr=False)
class RecordedSplit:
    """The parts of one recording's response.

    Attributes
    ----------
    name : of the recording.
    channel : "acceleration" or "position".
    period : [s].
    lines : the parts line by line.
    """

    name: str
    channel: str
    period: float
    lines: MultisineSplit

    @property
    def parts(self) -> dict[str, float]:
        """Root mean square of the linear, even and odd parts and of the noise; NaN where not known."""
        return self.lines.parts()

    def plot(self) -> Figure:
        """Amplitudes of all lines, by what stands on them."""
        from shake_ros.report.signal_pages import split_figure

        title = f"{self.name}: {self.channel}, {self.lines.periods} periods of {self.period:g} s"
        highest = SHOWN_BAND * float(self.lines.frequency[self.lines.excited].max())
        return split_figure(title, self.lines, UNITS[self.channel], highest)

    def __repr__(self) -> str:
        split, parts = self.lines, self.parts
        used = split.frequency[split.excited]
        text = [
            f"{self.name}: {self.channel}",
            f"{split.periods} periods of {1.0 / split.frequency[0]:g} s, {len(used)} excited lines "
            f"from {used.min():.3g} to {used.max():.3g} Hz",
            f"part      root mean square [{UNITS[self.channel]}]  of the linear part [%]",
        ]
        for name, meaning in PARTS.items():
            value = parts[name]
            if (name == "noise" and split.periods < 2) or not np.isfinite(value):
                text.append(f"{name:8}  not known from this recording ({meaning})")
                continue
            share = 100.0 * value / max(parts["linear"], 1e-300)
            text.append(f"{name:8}  {value:23.6f}  {share:22.3f}  {meaning}")
        if not split.separates_even_from_odd:
            text.append(
                "even lines are excited too: even distortion may appear on odd lines and be hidden on excited ones"
            )
        return "\n".join(text)


def multisine_split(
    source: Source, period: float | None = None, channel: str = "acceleration", skip: int | None = None
) -> RecordedSplit:
    """Split the response to a periodic valve command (Pintelon and Schoukens, 2012).

    Parameters
    ----------
    source : a recording, its path, or a simulation.
    period : found in the command where not given [s].
    channel : "acceleration" or "position".
    skip : periods left out at the start; one where two remain if not given.

    Raises
    ------
    ShakeError
        A command that does not repeat itself, too few periods, no such channel.

    Examples
    --------
    >>> import shake_ros as sr
    >>> t = np.arange(8000) / 1000
    >>> u = 0.2 * np.cos(2 * np.pi * 1.5 * t) + 0.2 * np.sin(2 * np.pi * 3.5 * t)
    >>> found = sr.multisine_split(sr.recording("mixed", t, u, u, acceleration=10 * u + 8 * u**2), period=2.0)
    >>> round(found.parts["linear"], 3), round(found.parts["even"], 3)
    (2.0, 0.358)
    """
    if channel not in UNITS:
        raise unknown_name("channel", channel, UNITS)
    recording = one_recording(source)
    with naming(source):
        part = recording.longest
        values = part.position if channel == "position" else part.acceleration
        if values is None:
            raise ShakeError("no topic imu: there is no acceleration to split")
        samples = _samples(part, period)
        split = analysis.multisine_split(part.valve_command, values, samples, part.sample_time, skip)
    return RecordedSplit(recording.name, channel, samples * part.sample_time, split)


def _samples(part: TableRecording, period: float | None) -> int:
    """Samples of a period, as given or found."""
    if period is None:
        found = analysis.repeated_period(part.valve_command)
        if found is None:
            raise ShakeError("valve_command does not repeat itself; name the period with --period")
        return found
    if not (math.isfinite(period) and period > 0.0):
        raise ShakeError(f"--period {period:g} s is not a length of time")
    samples = period / part.sample_time
    if abs(samples - round(samples)) > 0.01 * max(1.0, 1e-3 * samples):
        raise ShakeError(f"--period {period:g} s is not a whole number of samples of {part.sample_time:g} s")
    return round(samples)
