"""`frequency_response`: gain, delay and coherence between two signals of a recording."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from shake_ros.api.read import Source, naming, one_recording
from shake_ros.core.analysis import frequency_response as analysis
from shake_ros.core.analysis.frequency_response import FrequencyResponse
from shake_ros.core.quantities import ShakeError, unknown_name
from shake_ros.data.recordings import TableRecording
from shake_ros.data.result_folder import write_folder, write_json
from shake_ros.report.result_table import ResultTable

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from shake_ros.report.chart import Chart

SCHEMA = "shake_ros.frequency_response/1"
INPUTS = {"valve_command": "-", "reference": "m", "force": "N"}
OUTPUTS = {"position": "m", "acceleration": "m/s²"}
WINDOW = 4.0  # [s]
AT = (0.5, 1.0, 2.0, 5.0, 10.0, 15.0, 20.0)  # [Hz]


@dataclass(frozen=True, repr=False)
class RecordedResponse:
    """The frequency response between two signals of one recording.

    Attributes
    ----------
    title : recording, signals and windows.
    name : of the recording.
    unit : of the gain.
    found : the response on all lines.
    rows : frequency [Hz], gain, delay [s] and coherence [-] at the frequencies asked for.
    """

    title: str
    name: str
    unit: str
    found: FrequencyResponse
    rows: Sequence[tuple[float, float, float, float]]

    @property
    def table(self) -> ResultTable:
        """The rows, delays in ms."""
        rows = [(f, gain, 1e3 * delay, coherence) for f, gain, delay, coherence in self.rows]
        formats = {"delay [ms]": "{:.2f}".format, "coherence": "{:.4f}".format}
        return ResultTable(("frequency [Hz]", f"gain [{self.unit}]", "delay [ms]", "coherence"), rows, formats)

    def plot(self) -> Figure:
        """Gain with two standard deviations and delay on coherent lines, coherence on all."""
        from shake_ros.report.static_figure import static_figure

        return static_figure(self._chart())

    def _chart(self) -> Chart:
        from shake_ros.report.signal_pages import response_chart

        highest = min(2.0 * max(row[0] for row in self.rows), float(self.found.frequency[-1]))
        return response_chart(self.found, highest, self.unit)

    def report(self, out: str | Path, force: bool = False, *, figures: str | None = None, command: str = "") -> None:
        """Write report.json and report.html into a new folder; options as of `Discovery.report`."""
        write_folder(Path(out), lambda folder: self._fill(folder, figures, command), force=force)

    def _fill(self, folder: Path, figures: str | None, command: str) -> None:
        from shake_ros.report.page import write_page
        from shake_ros.report.signal_pages import response_page

        lines = {
            "frequency_hz": self.found.frequency.tolist(),
            "gain": self.found.gain.tolist(),
            "delay_s": self.found.delay.tolist(),
            "coherence": self.found.coherence.tolist(),
            "gain_deviation": self.found.deviation.tolist(),
        }
        at = [dict(zip(("frequency_hz", "gain", "delay_s", "coherence"), row, strict=True)) for row in self.rows]
        content = {"schema": SCHEMA, "recording": self.name, "gain_unit": self.unit, "at": at, "lines": lines}
        write_json(folder / "report.json", content)
        write_page(response_page(self.title, self.table, self._chart(), command), folder, figures)

    def __repr__(self) -> str:
        return f"{self.title}\n{self.table}"


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
    at : frequencies of the table; 0.5 … 20 Hz as far as there are lines where not given [Hz].

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
    late: valve_command → position, 39 windows of 1 s
    frequency [Hz]  gain [m per -]  delay [ms]  coherence
                10         0.01996        4.97     0.9996
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
            found = analysis.frequency_response(_signal(part, input), _signal(part, output), part.sample_time, window)
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
    if values is None:
        raise ShakeError(f"no topic for {name} in the recording")
    values = values[:, 0] if values.ndim > 1 else values
    if not np.all(np.isfinite(values)):
        raise ShakeError(f"{int(np.sum(~np.isfinite(values)))} samples of {name} are not finite numbers")
    return np.asarray(values)
