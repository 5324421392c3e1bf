"""spectrum: response spectra of the acceleration in recordings."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from shake_ros.api.record_scale import accelerogram
from shake_ros.api.response_spectrum import DAMPING, HIGH, LOW, PER_OCTAVE, acceleration_spectra
from shake_ros.cli.reporting import add_take, source
from shake_ros.core.quantities import ShakeError
from shake_ros.data.results import refuse_existing

METHOD = """\
BAG is a recording of a table (its topic imu) or an accelerogram. Each oscillator starts at rest and is advanced exactly
for straight lines between the samples, as accelerograms are taken; the free vibration behind the record counts too."""


def parser() -> argparse.ArgumentParser:
    """The command line."""
    p = argparse.ArgumentParser(
        prog="spectrum",
        description="Print the absolute acceleration spectra of recordings.",
        epilog=METHOD,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    p.add_argument("bags", nargs="+", metavar="BAG", type=Path)
    add_take(p)
    p.add_argument("--channel", type=int, default=0, help="component of an accelerogram that has several, from 1")
    p.add_argument("--damping", type=float, nargs="+", default=list(DAMPING), metavar="XI", help="(default: 0.05)")
    p.add_argument("--low", type=float, default=LOW, metavar="HZ", help=f"lowest frequency (default: {LOW:g})")
    p.add_argument(
        "--high", type=float, metavar="HZ", help=f"highest (default: {HIGH:g}, or 0.45 of the sampling rate if lower)"
    )
    p.add_argument(
        "--per-octave", type=int, default=PER_OCTAVE, metavar="N", help=f"frequencies (default: {PER_OCTAVE})"
    )
    p.add_argument("--subtract-mean", action="store_true", help="take off the record's mean first (a sensor's offset)")
    p.add_argument(
        "--band-limited", action="store_true", help="no straight lines between samples: exact to 0.45 of the rate"
    )
    p.add_argument("--out", type=Path, metavar="FILE.csv", help="write the columns of one recording")
    p.add_argument("--force", action="store_true", help="replace an existing file")
    return p


def main(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    given = parser().parse_args(list(arguments))
    if given.out is not None:
        if len(given.bags) > 1 or given.out.suffix != ".csv":
            raise ShakeError(f"--out {given.out}: give one recording and a name that ends in .csv")
        refuse_existing(given.out, force=given.force)
    band, how = (given.damping, given.low, given.high, given.per_octave), (given.subtract_mean, given.band_limited)
    given_of = [source(bag, given) for bag in given.bags]
    read = [accelerogram(s, given.channel) if isinstance(s, Path) else s for s in given_of]
    found = [acceleration_spectra(each, *band, *how) for each in read]
    print("\n\n".join(map(repr, found)))
    if given.out is not None:
        found[0].write(given.out, given.force)
        print(f"written: {given.out}")
    return 0
