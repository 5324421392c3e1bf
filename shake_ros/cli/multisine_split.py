"""multisine_split: a response to repeated periods split into linear, even and odd nonlinear parts and noise."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from shake_ros.core.analysis.multisine_split import MultisineSplit, multisine_split, repeated_period
from shake_ros.core.quantities import ShakeError
from shake_ros.data.recordings import TableRecording, read_table_recording
from shake_ros.report.figures_multisine import draw_split

UNITS = {"acceleration": "m/s²", "position": "m"}
PARTS = {
    "linear": "excited lines less odd distortion and noise",
    "even": "even lines left out",
    "odd": "odd lines left out, and their level on excited lines",
    "noise": "what does not repeat",
}
SHOWN_BAND = 4.0  # multiples of the highest excited frequency in the figure
METHOD = """\
The excitation is the valve command. Without --period it is found where the command repeats itself. The first period is
left out where two remain (--skip changes that). Even and odd distortion are apart only where odd lines alone are
excited, and the odd part is known only where some odd lines are left out (grid: odd_random of the multisine)."""


def parser() -> argparse.ArgumentParser:
    """The command line."""
    p = argparse.ArgumentParser(
        prog="multisine_split", description=__doc__, epilog=METHOD, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    p.add_argument("bag", metavar="BAG", type=Path)
    p.add_argument("--period", type=float, metavar="T", help="length of a period [s] (default: found)")
    p.add_argument("--channel", choices=tuple(UNITS), default="acceleration")
    p.add_argument("--skip", type=int, metavar="N", help="periods left out at the start")
    p.add_argument("--plot", type=Path, metavar="PNG", help="also draw the lines")
    p.add_argument("--force", action="store_true", help="replace an existing figure")
    return p


def main(argv: Sequence[str]) -> int:
    """Run the command; 0 done, 2 bad arguments or input."""
    try:
        given = parser().parse_args(list(argv))
    except SystemExit as stop:
        return int(stop.code or 0)
    try:
        print(analyse(given))
    except ShakeError as error:
        print(f"multisine_split: {error}", file=sys.stderr)
        return 2
    return 0


def analyse(given: argparse.Namespace) -> str:
    """The printed table of a recording; draws the figure where one is wanted."""
    plot: Path | None = given.plot
    if plot is not None and plot.exists() and not given.force:
        raise ShakeError(f"{plot}: exists already (--force replaces it)")
    recording = read_table_recording(given.bag)
    try:
        part = recording.longest
        values = part.position if given.channel == "position" else part.acceleration
        if values is None:
            raise ShakeError("no topic imu: there is no acceleration to split")
        samples = _samples(part, given.period)
        split = multisine_split(part.valve_command, values, samples, part.sample_time, given.skip)
    except ShakeError as error:
        raise ShakeError(f"{given.bag}: {error}") from None
    if plot is not None:
        title = f"{recording.name}: {given.channel}, {split.periods} periods of {samples * part.sample_time:g} s"
        highest = SHOWN_BAND * float(split.frequency[split.excited].max())
        try:
            draw_split(plot, title, split, UNITS[given.channel], highest)
        except OSError as error:
            raise ShakeError(f"{plot}: cannot be written ({error.strerror})") from None
    return "\n".join((f"{recording.name}: {given.channel}", *_lines(split, UNITS[given.channel])))


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


def _lines(split: MultisineSplit, unit: str) -> list[str]:
    parts = split.parts()
    used = split.frequency[split.excited]
    lines = [
        f"{split.periods} periods of {1.0 / split.frequency[0]:g} s, {len(used)} excited lines "
        f"from {used.min():.3g} to {used.max():.3g} Hz",
        f"part      root mean square [{unit}]  of the linear part [%]",
    ]
    for name, told in PARTS.items():
        value = parts[name]
        if (name == "noise" and split.periods < 2) or not np.isfinite(value):
            lines.append(f"{name:8}  not known from this recording ({told})")
            continue
        share = 100.0 * value / max(parts["linear"], 1e-300)
        lines.append(f"{name:8}  {value:23.6f}  {share:22.3f}  {told}")
    if not split.separates_even_from_odd:
        lines.append("even lines are excited too: even distortion may stand on odd lines and hide on excited ones")
    return lines
