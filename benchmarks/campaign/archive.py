"""An archive whose changes are known: does the study `archive` say which table changed, when, and by which parameter?

    python -m benchmarks.campaign.archive [--out DIR] [--save]

30 recordings of three tables on five days, made by discovery/hidden_tables.py, which shares nothing with the package:
one table stays as it is, the oil of the second softens, the friction of the third rises. Each recording has its own
excitation and its own noise.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

import numpy as np

import shake_ros as sr
from benchmarks.discovery import hidden_tables as hidden
from shake_ros.data.recordings import write_table_recording

DAYS = ("2026-01-12", "2026-02-09", "2026-03-09", "2026-04-13", "2026-05-11")
TABLES = {"north": (11, {}, 0), "south": (12, {"modulus": 0.9}, 2), "west": (13, {"coulomb": 1.2}, 3)}
"""Table → seed, factors of what changes, number of the first day on which it has."""
LENGTH = 0.6  # of the recordings
RUNS = {"learn": "learn_multisine", "hold": "hold_pulses"}


def make(folder: Path) -> int:
    """The recordings; returns how many."""
    count = 0
    for table, (seed, factors, since) in TABLES.items():
        for day, when in enumerate(DAYS):
            truth = hidden.declared_truth(seed)
            if day >= since:
                truth = truth._replace(**{name: factor * getattr(truth, name) for name, factor in factors.items()})
            commands = hidden.excitations(100 * seed + day, LENGTH)
            for role, name in RUNS.items():
                rng = np.random.default_rng([seed, day, role == "hold"])
                made = hidden.record(truth, commands[name], 1.0, rng)
                at = np.arange(len(made["command"])) * hidden.SAMPLE
                path = folder / f"{table}_{when}_{role}"
                write_table_recording(path, at, made["command"], made["position"], made["acceleration"])
                count += 1
    return count


def main() -> None:
    """Make the archive, run the study, print its table beside the truth."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, help="folder of the campaign (default: one that is removed)")
    parser.add_argument("--workers", type=int, help="processes")
    parser.add_argument("--save", action="store_true", help="keep the lines in archive.txt")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        bags = Path(folder) / "recordings"
        bags.mkdir()
        count = make(bags)
        begun = time.perf_counter()
        out = given.out or Path(folder) / "archive"
        found = sr.campaign("archive", out, workers=given.workers, changes={"folder": str(bags)})
        found.report(command="python -m benchmarks.campaign.archive")
        lines = [f"{count} recordings, {len(found.rows)} fits in {time.perf_counter() - begun:.0f} s by the clock", ""]
    for table, (_, factors, since) in TABLES.items():
        text = ", ".join(f"{name} times {factor:g} since {DAYS[since]}" for name, factor in factors.items())
        lines.append(f"truth: {table}: {text or 'nothing changed'}")
    lines += ["", repr(found)]
    print("\n".join(lines))
    if given.save:
        Path(__file__).with_suffix(".txt").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
