"""frequency_response: gain, delay and coherence between two signals of a recording, as a table and a plot."""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from shake_ros.core.analysis.frequency_response import FrequencyResponse, frequency_response
from shake_ros.core.quantities import ShakeError
from shake_ros.data.recordings import TableRecording, read_table_recording
from shake_ros.data.results import write_folder, write_json
from shake_ros.report.figures_frequency import response_figure
from shake_ros.report.page import Page

SCHEMA = "shake_ros.frequency_response/1"
UNITS = {"valve_command": "-", "reference": "m", "force": "N", "position": "m", "acceleration": "m/s²"}
WINDOW = 4.0  # [s]
AT = (0.5, 1.0, 2.0, 5.0, 10.0, 15.0, 20.0)  # [Hz]


def parser() -> argparse.ArgumentParser:
    """The command line."""
    p = argparse.ArgumentParser(prog="frequency_response", description=__doc__)
    p.add_argument("bag", metavar="BAG", type=Path)
    p.add_argument("--input", choices=("valve_command", "reference", "force"), default="valve_command")
    p.add_argument("--output", choices=("position", "acceleration"), default="position")
    p.add_argument("--window", type=float, default=WINDOW, metavar="T", help=f"window [s] (default: {WINDOW:g})")
    p.add_argument("--at", type=float, nargs="+", metavar="HZ", help="frequencies of the table (default: 0.5 … 20 Hz)")
    p.add_argument("--out", type=Path, metavar="DIR", help="folder for report.json and report.html with the plot")
    p.add_argument("--force", action="store_true", help="replace an existing result folder")
    return p


def main(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    given = parser().parse_args(list(arguments))
    if given.out is not None and given.out.exists() and not given.force:
        raise ShakeError(f"{given.out}: exists already (--force replaces it)")
    recording = read_table_recording(given.bag)
    found = analyse(recording, given.bag, given.input, given.output, given.window)
    wanted = given.at or [f for f in AT if found.frequency[0] <= f <= found.frequency[-1]]
    try:
        rows = [(f, *found.at(f)) for f in wanted]
    except ShakeError as error:
        raise ShakeError(f"{given.bag}: --at: {error}") from None
    unit = f"{UNITS[given.output]} per {UNITS[given.input]}" if given.input != "reference" else "-"
    lines = [f"{recording.name}: {given.input} → {given.output}, {found.windows} windows of {given.window:g} s"]
    lines += [f"{'frequency [Hz]':>16}{'gain [' + unit + ']':>20}{'delay [ms]':>14}{'coherence':>12}"]
    lines += [f"{f:>16.4g}{gain:>20.4g}{1e3 * delay:>14.2f}{coherence:>12.4f}" for f, gain, delay, coherence in rows]
    if given.out is not None:
        write_folder(given.out, lambda folder: _fill(folder, recording, found, rows, lines[0], unit), force=given.force)
        lines.append(f"report: {given.out / 'report.html'}")
    print("\n".join(lines))
    return 0


def analyse(recording: TableRecording, path: Path, given: str, answer: str, window: float) -> FrequencyResponse:
    """The response in the longest piece without a gap; every ShakeError names the recording and the signal."""
    part = recording.longest
    try:
        if not (math.isfinite(window) and window > 0.0):
            raise ShakeError(f"--window {window:g}: a positive number of seconds is needed")
        return frequency_response(_signal(part, given), _signal(part, answer), part.sample_time, window)
    except ShakeError as error:
        raise ShakeError(f"{path}: {given} → {answer}: {error}") from None


def _signal(part: TableRecording, name: str) -> npt.NDArray[np.float64]:
    values = getattr(part, name)
    if values is None:
        raise ShakeError(f"no topic for {name} in the recording")
    values = values[:, 0] if values.ndim > 1 else values
    if not np.all(np.isfinite(values)):
        raise ShakeError(f"{int(np.sum(~np.isfinite(values)))} samples of {name} are not finite numbers")
    return np.asarray(values)


def _fill(
    folder: Path,
    recording: TableRecording,
    found: FrequencyResponse,
    rows: list[tuple[float, float, float, float]],
    title: str,
    unit: str,
) -> None:
    columns: dict[str, Any] = {
        "frequency_hz": found.frequency.tolist(),
        "gain": found.gain.tolist(),
        "delay_s": found.delay.tolist(),
        "coherence": found.coherence.tolist(),
        "gain_deviation": found.deviation.tolist(),
    }
    table = [dict(zip(("frequency_hz", "gain", "delay_s", "coherence"), row, strict=True)) for row in rows]
    write_json(
        folder / "report.json",
        {"schema": SCHEMA, "recording": recording.name, "gain_unit": unit, "at": table, "lines": columns},
    )
    page = Page("Frequency response", f"{title}.")
    head = ["frequency [Hz]", f"gain [{unit}]", "delay [ms]", "coherence"]
    page.table(head, [[f"{f:g}", f"{g:.4g}", f"{1e3 * d:.2f}", f"{c:.4f}"] for f, g, d, c in rows])
    highest = 2.0 * max(row[0] for row in rows)
    caption = "Gain with two standard deviations and delay on coherent lines, coherence on all"
    page.figure(response_figure(found, min(highest, float(found.frequency[-1])), unit), caption)
    (folder / "report.html").write_text(page.render(), encoding="utf-8")
