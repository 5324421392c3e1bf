"""thd: the harmonics of a recording's acceleration and their total harmonic distortion (6.1)."""

from __future__ import annotations

import argparse
import math
import sys
from pathlib import Path

import numpy as np
import numpy.typing as npt

from shake_ros.core.analysis.steady_part import steady_part
from shake_ros.core.analysis.thd import Harmonics, fundamental_frequency, harmonics
from shake_ros.core.quantities import ShakeError
from shake_ros.data.recordings import TableRecording, read_table_recording

SHOWN = 15
APERIODIC = 0.3  # of an excitation's root mean square in no harmonic, from which on it has no fundamental
METHOD = """\
The fundamental is that of the reference or, where there is none, of the valve command, unless --frequency names it.
Without --start and --stop, the part is taken in which that signal keeps its amplitude; of it, whole periods.
Amplitudes come from a least-squares fit of all harmonics below half the sampling rate (or of --harmonics N)."""


def parser() -> argparse.ArgumentParser:
    """The command line."""
    p = argparse.ArgumentParser(
        prog="thd",
        description="Print the harmonics of the acceleration in recordings, and their distortion.",
        epilog=METHOD,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    p.add_argument("bags", nargs="+", metavar="BAG", type=Path)
    p.add_argument("--frequency", type=float, help="fundamental [Hz] (default: found)")
    p.add_argument("--harmonics", type=int, metavar="N", help="orders to fit and to print (default: all, 15 printed)")
    p.add_argument("--start", type=float, metavar="T", help="from this time of the recording on [s]")
    p.add_argument("--stop", type=float, metavar="T", help="up to this time of the recording [s]")
    return p


def main(argv: list[str]) -> int:
    """Run the command; 0 done, 2 bad arguments or input."""
    try:
        arguments = parser().parse_args(argv)
    except SystemExit as stop:
        return int(stop.code or 0)
    try:
        tables = [analyse(path, arguments) for path in arguments.bags]
    except ShakeError as error:
        print(f"thd: {error}", file=sys.stderr)
        return 2
    print("\n\n".join(tables))
    return 0


def analyse(path: Path, arguments: argparse.Namespace) -> str:
    """The printed table of one recording; every ShakeError names the recording."""
    recording = read_table_recording(path)
    if recording.acceleration is None:
        raise ShakeError(f"{path}: no topic imu: there is no acceleration to analyse")
    part = recording.longest
    try:
        part = _between(part, arguments.start, arguments.stop)
        source, excitation = _excitation(part)
        frequency = arguments.frequency
        if frequency is None:
            frequency = _fundamental(part.time, excitation, source)
        if arguments.start is None and arguments.stop is None:
            part = part[steady_part(part.time, excitation, frequency)]
        assert part.acceleration is not None
        found = harmonics(part.time, part.acceleration, frequency, arguments.harmonics)
    except ShakeError as error:
        raise ShakeError(f"{path}: {error}") from None
    told = f"of {source}" if arguments.frequency is None else "as given"
    return "\n".join((f"{recording.name}: acceleration", *_lines(found, told, arguments.harmonics or SHOWN)))


def _between(part: TableRecording, start: float | None, stop: float | None) -> TableRecording:
    low = -math.inf if start is None else start
    high = math.inf if stop is None else stop
    kept = np.flatnonzero((part.time >= low) & (part.time <= high))
    if len(kept) < 2:
        first, last = part.time[0], part.time[-1]
        raise ShakeError(f"nothing between {low:g} and {high:g} s: the longest piece is {first:.3f} … {last:.3f} s")
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
    share = harmonics(time, excitation, frequency).rest / float(np.std(excitation))
    if share > APERIODIC:
        raise ShakeError(
            f"{source} is not periodic ({100.0 * share:.0f} % of it in no harmonic of {frequency:.3f} Hz); "
            "name the fundamental with --frequency"
        )
    return frequency


def _lines(found: Harmonics, told: str, shown: int) -> list[str]:
    rate = (found.samples - 1) / (found.stop - found.start)
    lines = [
        f"fundamental {found.frequency:.6g} Hz ({told}), {found.periods:.0f} periods "
        f"from {found.start:.3f} to {found.stop:.3f} s, {found.samples} samples at {rate:.1f} Hz",
        "order  frequency [Hz]  amplitude [m/s²]  of the fundamental [%]  phase [rad]",
    ]
    for k in found.orders[:shown]:
        amplitude, phase = found.amplitude[k - 1], found.phase[k - 1]
        share = 100.0 * amplitude / found.amplitude[0]
        lines.append(f"{k:5d}  {k * found.frequency:14.4f}  {amplitude:16.6f}  {share:22.4f}  {phase:11.4f}")
    return [
        *lines,
        f"THD            {100.0 * found.thd:.3f} % (6.1), orders 2 to {len(found.amplitude)}",
        f"THD and noise  {100.0 * found.thd_and_noise:.3f} %, all that is not the fundamental",
        f"noise          {found.noise:.6f} m/s² (standard deviation); of an amplitude {found.amplitude_error:.6f} m/s²",
    ]
