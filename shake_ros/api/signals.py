"""What a recording's signals show: `thd`, the harmonics of an acceleration (6.1); `frequency_response`, gain, delay and
coherence between two signals; `multisine_split`, linear, even and odd nonlinear parts and noise."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from shake_ros.api.read import Source, naming, one_recording
from shake_ros.quantities import ShakeError, unknown_name
from shake_ros.recordings.bags import TableRecording
from shake_ros.report.chart import COLOURS, GREY, Chart, ChartSeries, Panel, new_figure, static_figure, tidy
from shake_ros.report.page import Page, Result
from shake_ros.report.result_table import ResultTable
from shake_ros.signals.frequency_response import COHERENT, FrequencyResponse
from shake_ros.signals.frequency_response import frequency_response as estimate
from shake_ros.signals.multisine_split import MultisineSplit, repeated_period
from shake_ros.signals.multisine_split import multisine_split as split_response
from shake_ros.signals.stretches import steady_part
from shake_ros.signals.thd import Harmonics, fundamental_frequency, nearby_fundamental
from shake_ros.signals.thd import harmonics as harmonics_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SHOWN = 15
ANOTHER_CLOCK = 20.0  # parts in a million, from which a frequency is said to be another
APERIODIC = 0.3  # of an excitation's root mean square in no harmonic, from which on it has no fundamental


@dataclass(frozen=True, repr=False)
class Distortion:
    """Harmonics of the acceleration of one recording."""

    name: str  # of the recording
    harmonics: Harmonics  # amplitudes [m/s²], phases [rad], noise [m/s²]
    origin: str  # where the fundamental is from
    shown: int = SHOWN  # orders that are printed

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
    harmonics : orders to fit and to print; all below half the sampling rate where not given, of which 15 are printed.
    start : of the segment that is used; the one in which the excitation keeps its amplitude where not given [s].
    stop : end of that segment [s].

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
        found = harmonics_of(part.time, part.acceleration, own, harmonics)
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
    share = harmonics_of(time, excitation, frequency).rest / float(np.std(excitation))
    if share > APERIODIC:
        raise ShakeError(
            f"{source} is not periodic ({100.0 * share:.0f} % of it in no harmonic of {frequency:.3f} Hz); "
            "name the fundamental with --frequency"
        )
    return frequency


SCHEMA = "shake_ros.frequency_response/1"
INPUTS = {"valve_command": "-", "reference": "m", "force": "N"}
OUTPUTS = {"position": "m", "acceleration": "m/s²"}
WINDOW = 4.0  # [s]
AT = (0.5, 1.0, 2.0, 5.0, 10.0, 15.0, 20.0)  # [Hz]


@dataclass(frozen=True, repr=False)
class RecordedResponse(Result):
    """The frequency response between two signals of one recording."""

    title: str  # recording, signals and windows
    name: str  # of the recording
    unit: str  # of the gain
    found: FrequencyResponse  # the response on all lines
    # frequency [Hz], gain, delay [s] and coherence [-] at the frequencies asked for
    rows: Sequence[tuple[float, float, float, float]]

    @property
    def table(self) -> ResultTable:
        """The rows, delays in ms."""
        rows = [(f, gain, 1e3 * delay, coherence) for f, gain, delay, coherence in self.rows]
        formats = {"delay [ms]": "{:.2f}".format, "coherence": "{:.4f}".format}
        return ResultTable(("frequency [Hz]", f"gain [{self.unit}]", "delay [ms]", "coherence"), rows, formats)

    def plot(self) -> Figure:
        """Gain with two standard deviations and delay on coherent lines, coherence on all."""
        return static_figure(self._chart())

    def _chart(self) -> Chart:
        """Up to twice the highest frequency asked for; gain and delay on coherent lines."""
        found, highest = self.found, min(2.0 * max(row[0] for row in self.rows), float(self.found.frequency[-1]))
        shown = found.frequency <= highest
        good = shown & (found.coherence >= COHERENT)
        frequency, gain, spread = found.frequency[good], found.gain[good], 2.0 * found.deviation[good]
        gains = (
            ChartSeries("− two deviations", gain * (1.0 - spread), "grey"),
            ChartSeries("+ two deviations", gain * (1.0 + spread), "grey"),
            ChartSeries("gain", gain, "after", width=1.6),
        )
        delay = ChartSeries("delay", 1e3 * found.delay[good], "before")
        coherence = ChartSeries("coherence", found.coherence[shown], "measured")
        panels = (
            Panel(f"gain [{self.unit}]", frequency, gains, log=True),
            Panel("delay [ms]", frequency, (delay,), height=150),
            Panel("coherence", found.frequency[shown], (coherence,), height=120),
        )
        caption = "Gain with two standard deviations and delay on coherent lines, coherence on all"
        return Chart("response", "frequency [Hz]", panels, caption, log_x=True)

    @property
    def page(self) -> Page:
        """The response at the frequencies asked for, and over all."""
        page = Page("Frequency response", f"{self.title}.")
        page.heading("What was found")
        page.result(self.table)
        page.heading("Over frequency")
        page.chart(self._chart())
        return page

    def content(self) -> dict[str, Any]:
        """Content of report.json."""
        lines = {
            "frequency_hz": self.found.frequency.tolist(),
            "gain": self.found.gain.tolist(),
            "delay_s": self.found.delay.tolist(),
            "coherence": self.found.coherence.tolist(),
            "gain_deviation": self.found.deviation.tolist(),
        }
        at = [dict(zip(("frequency_hz", "gain", "delay_s", "coherence"), row, strict=True)) for row in self.rows]
        return {"schema": SCHEMA, "recording": self.name, "gain_unit": self.unit, "at": at, "lines": lines}


def frequency_response(
    source: Source,
    input: str = "valve_command",  # noqa: A002 (the command's option has this name)
    output: str = "position",
    window: float = WINDOW,
    at: Sequence[float] | None = None,
) -> RecordedResponse:
    """The H1 estimate of the response between two signals, in the longest segment without a gap.

    Parameters
    ----------
    source : a recording, its path, or a simulation.
    input : "valve_command", "reference" or "force".
    output : "position" or "acceleration".
    window : length of a window; its inverse parts the lines [s].
    at : frequencies of the table; 0.5 … 20 Hz, as far as there are lines, where not given [Hz].

    Raises
    ------
    ShakeError
        A signal that is not there or not finite, a window that does not fit, a frequency outside the lines.

    Examples
    --------
    >>> import shake_ros as sr
    >>> u = 0.1 * np.random.default_rng(1).standard_normal(20000)
    >>> runs = sr.recording("late", np.arange(20000) / 1000, command=u, position=0.02 * np.roll(u, 5))
    >>> sr.frequency_response(runs, window=1.0, at=[10.0])
    Frequency response
    late: valve_command → position, 39 windows of 1 s.
    <BLANKLINE>
    What was found
    frequency [Hz]  gain [m per -]  delay [ms]  coherence
    10                     0.01996        4.97     0.9996
    """
    for kind, name, known in (("input", input, INPUTS), ("output", output, OUTPUTS)):
        if name not in known:
            raise unknown_name(kind, name, known)
    recording = one_recording(source)
    part = recording.longest
    with naming(source):
        try:
            if not (math.isfinite(window) and window > 0.0):
                raise ShakeError(f"--window {window:g}: a positive number of seconds is needed")
            found = estimate(_signal(part, input), _signal(part, output), part.sample_time, window)
        except ShakeError as error:
            raise ShakeError(f"{input} → {output}: {error}") from None
        wanted = at or [f for f in AT if found.frequency[0] <= f <= found.frequency[-1]]
        try:
            rows = [(f, *found.at(f)) for f in wanted]
        except ShakeError as error:
            raise ShakeError(f"--at: {error}") from None
    unit = f"{OUTPUTS[output]} per {INPUTS[input]}" if input != "reference" else "-"
    title = f"{recording.name}: {input} → {output}, {found.windows} windows of {window:g} s"
    return RecordedResponse(title, recording.name, unit, found, rows)


def _signal(part: TableRecording, name: str) -> npt.NDArray[np.float64]:
    values = getattr(part, name)
    if values is None or not np.isfinite(values).any():
        raise ShakeError(f"no topic for {name} in the recording")
    values = values[:, 0] if values.ndim > 1 else values
    if not np.all(np.isfinite(values)):
        raise ShakeError(f"{int(np.sum(~np.isfinite(values)))} samples of {name} are not finite numbers")
    return np.asarray(values)


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
    """The parts of one recording's response."""

    name: str  # of the recording
    channel: str  # "acceleration" or "position"
    period: float  # [s]
    lines: MultisineSplit  # the parts line by line

    @property
    def parts(self) -> dict[str, float]:
        """Root mean square of the linear, even and odd parts and of the noise; NaN where not known."""
        return self.lines.parts()

    def plot(self) -> Figure:
        """Amplitudes of all lines, by what stands on them."""
        split, figure = self.lines, new_figure(10.0, 5.5)
        axes = figure.add_subplot()
        shown = split.frequency <= SHOWN_BAND * float(split.frequency[split.excited].max())
        amplitude = np.maximum(np.abs(split.response), 1e-12)
        kinds = (
            (split.excited, COLOURS[0], "o", "excited lines: linear part with odd distortion"),
            (~split.odd & ~split.excited, COLOURS[2], "v", "even lines left out: even distortion"),
            (split.odd & ~split.excited, COLOURS[1], "^", "odd lines left out: odd distortion"),
        )
        for chosen, colour, marker, label in kinds:
            at = shown & chosen
            if np.any(at):
                axes.plot(split.frequency[at], amplitude[at], marker, color=colour, markersize=4, label=label)
        if np.any(np.isfinite(split.noise)):
            label = "noise (standard dev.)"
            axes.plot(split.frequency[shown], split.noise[shown], color=GREY, linewidth=0.8, label=label)
        axes.set_yscale("log")
        tidy(axes, "frequency [Hz]", f"amplitude of a line [{UNITS[self.channel]}]")
        axes.legend(loc="upper right", fontsize="small")
        title = f"{self.name}: {self.channel}, {split.periods} periods of {self.period:g} s"
        figure.suptitle(title, fontsize="medium")
        return figure

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
    period : length of a period; found in the command where not given [s].
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
        if values is None or not np.isfinite(values).any():
            topic = {"acceleration": "imu", "position": "joint_states"}[channel]
            raise ShakeError(f"no topic {topic}: there is no {channel} to split")
        samples = _samples(part, period)
        split = split_response(part.valve_command, values, samples, part.sample_time, skip)
    return RecordedSplit(recording.name, channel, samples * part.sample_time, split)


def _samples(part: TableRecording, period: float | None) -> int:
    """Samples of a period, as given or found."""
    if period is None:
        found = repeated_period(part.valve_command)
        if found is None:
            raise ShakeError("valve_command does not repeat itself; name the period with --period")
        return found
    if not (math.isfinite(period) and period > 0.0):
        raise ShakeError(f"--period {period:g} s is not a length of time")
    samples = period / part.sample_time
    if abs(samples - round(samples)) > 0.01 * max(1.0, 1e-3 * samples):
        raise ShakeError(f"--period {period:g} s is not a whole number of samples of {part.sample_time:g} s")
    return round(samples)
