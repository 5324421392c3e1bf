"""What close_loop finds on a public servo-hydraulic table: python -m benchmarks.discovery.public_table --data DIR.

DIR is the folder `dataset` of github.com/SJ-Chuang/TD3-Shake-Table-System: 163 runs of a table under a specimen, valve
voltage, displacement, load pressure and accelerations at 204.8 Hz. Its licence is not stated, so nothing of it is part
of the repository. The first split is fixed, further ones (--splits N) are drawn: two recordings to learn from, two held
out. Beside each answer is what a linear filter of the command leaves, fitted to the same two.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.signal import butter, sosfiltfilt

import shake_ros as sr
from benchmarks import ROOT
from benchmarks.discovery.measured_data import command, imported, per_cent, verdict

COLUMNS = (
    *("--time", "Time", "--command", "Voltage command*0.1"),
    *("--position", "Table disp*0.001", "--acceleration", " Acc 1F*0.001"),
    *("--pressure_load", "Delta P*1e6"),  # in volts: an unknown table has a scale of its own for it
)
FIXED = ("1999_921_TCU029_NS", "1999_921_TAP089_EW", "1999_921_KAU050_NS", "1999_921_HWA011_EW")
LAGS, BELOW = 205, 20.0  # of the linear filter, one second; what it is fitted below [Hz]


def linear(learn: Sequence[Path], hold: Sequence[Path]) -> str:
    """Relative error of the velocity that a finite impulse response of the command leaves, by recording."""

    def terms(bag: Path) -> tuple[np.ndarray, np.ndarray]:
        (r,) = sr.read(bag).records()
        sections = butter(4, BELOW, fs=1.0 / r.sample_time, output="sos")
        rows = np.column_stack([np.roll(r.commands, k) for k in range(LAGS)] + [np.ones(len(r.commands))])
        return sosfiltfilt(sections, rows, axis=0)[LAGS:], sosfiltfilt(sections, r.velocity)[LAGS:]

    known = [terms(bag) for bag in learn]
    square, right = sum(a.T @ a for a, _ in known), sum(a.T @ v for a, v in known)
    response = np.linalg.solve(square + 1e-8 * np.trace(square) / LAGS * np.eye(len(square)), right)
    held = {bag.name: terms(bag) for bag in hold}
    return ", ".join(f"{n} {100.0 * np.std(v - a @ response) / np.std(v):.2f} %" for n, (a, v) in held.items())


def split(data: Path, out: Path, names: Sequence[str], minutes: float | None) -> None:
    """The answer from two recordings, judged by two others."""
    files = {f.stem: f for f in data.glob("*/*.csv")}
    bags = [imported(files[n], out, COLUMNS) for n in names]
    place = out / names[0]
    limit = ("--minutes", minutes) if minutes else ()
    chosen = ("--config", "unknown", "--learn", *bags[:2], "--hold", *bags[2:], "--out", place, "--force", *limit)
    _, seconds = command("close_loop", *chosen)
    print(verdict(place, "velocity", seconds))
    report = json.loads((place / "report.json").read_text(encoding="utf-8"))
    print(f"    held-out acceleration: {per_cent(report['final']['error']['hold'], 'acceleration')}")
    print(f"    held-out velocity of a linear filter: {linear(bags[:2], bags[2:])}")
    values = {n: e["value"] for n, e in report["final"]["parameters"].items()}
    specimen = "effects.specimen_resonance"
    if f"{specimen}.mass" in values:
        share = values[f"{specimen}.mass"] / values["body.table_mass"]
        print(f"    specimen: {values[f'{specimen}.frequency']:.2f} Hz, share of the moved mass {share:.2f}")


def main(given: Sequence[str] = tuple(sys.argv[1:])) -> None:
    """Run the splits."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--data", type=Path, required=True, metavar="DIR", help="the folder `dataset`")
    options.add_argument("--splits", type=int, default=0, metavar="N", help="drawn beside the fixed one")
    options.add_argument("--first", type=int, default=0, metavar="N", help="number of the first one drawn")
    options.add_argument("--minutes", type=float, metavar="M", help="of each search")
    options.add_argument("--out", type=Path, default=ROOT / "out" / "public_table", metavar="DIR")
    chosen = options.parse_args(list(given))
    names = sorted(f.stem for f in chosen.data.glob("*/*.csv") if f.stat().st_size)
    if not set(FIXED) <= set(names):
        raise SystemExit(f"{chosen.data}: not the folder `dataset` of the repository")
    drawn = [np.random.default_rng([42, k]).choice(names, 4, replace=False).tolist() for k in range(chosen.splits)]
    for each in [FIXED] * (chosen.first == 0) + drawn[chosen.first :]:
        print(f"{' + '.join(each[:2])}, held out {' + '.join(each[2:])}:", flush=True)
        split(chosen.data, chosen.out, each, chosen.minutes)


if __name__ == "__main__":
    main()
