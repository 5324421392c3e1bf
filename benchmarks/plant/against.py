"""The plant of this source tree against that of another: python -m benchmarks.plant.against DIR [--rounds N] [--save].

DIR is a checkout of another version. Each round runs the declared table in a process of its own from one tree and then
from the other; a time is the least processor time of 80 runs of 2 s, a tree's figure the least of its rounds, so that
other programs hardly count. Also says whether both trees give the same results to the bit, for the declared table and
with effects, and what a cylinder with unequal areas costs. --save writes benchmarks/plant/against.txt.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import platform
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks import ROOT

SAMPLE, REPEATS = 1e-3, 80
MEASURE = "--measure"  # what the processes of the rounds are asked for
EFFECTS = {"effects.soft_zone.depth": 0.84, "effects.dead_volume.volume": 1e-5, "effects.supply_droop.resistance": 2e9}
SINGLE_ROD = {"body.area_ratio": 0.6, "body.volume_share": 0.625}


def measure() -> str:
    """Milliseconds of the declared table and of a single rod, nan where there is none, and a hash of the results."""
    from shake_ros.core.plant.parameters import NAMES, TableParameters
    from shake_ros.core.plant.simulation import run
    from shake_ros.settings import load_table

    table = load_table("bergamo")
    commands = 0.5 * np.sin(4.0 * np.pi * SAMPLE * np.arange(2000))

    def best(one: TableParameters) -> float:
        times = []
        for _ in range(REPEATS):
            begun = time.thread_time()
            run(one, commands, SAMPLE)
            times.append(time.thread_time() - begun)
        return 1e3 * min(times)

    results = np.concatenate([run(t, commands, SAMPLE) for t in (table, table.with_values(EFFECTS))])
    unequal = best(table.with_values(SINGLE_ROD)) if "body.area_ratio" in NAMES else float("nan")
    return f"{best(table):.4f} {unequal:.4f} {hashlib.sha256(results.tobytes()).hexdigest()[:16]}"


def measured(tree: Path) -> tuple[float, float, str]:
    """`measure` in a process of its own that takes the package from a tree."""
    paths = os.pathsep.join([str(tree), str(ROOT)])
    environment = {**os.environ, "PYTHONPATH": paths}
    command = [sys.executable, __file__, MEASURE]
    said = subprocess.run(command, env=environment, cwd=tree, check=True, capture_output=True)
    declared, unequal, same = said.stdout.decode().split()[-3:]
    return float(declared), float(unequal), same


def report(other: Path, rounds: int) -> str:
    """What the rounds gave."""
    found = [(measured(other), measured(ROOT)) for _ in range(rounds)]
    before, after = (min(pair[k][0] for pair in found) for k in (0, 1))
    unequal = min(pair[1][1] for pair in found)
    bits = "the same to the bit" if len({side[2] for pair in found for side in pair}) == 1 else "not the same"
    return "\n".join(
        [
            f"{time.strftime('%Y-%m-%d')}, {os.cpu_count()} cores {platform.machine()}, load {os.getloadavg()[0]:.1f}",
            f"2 s of the declared table, least of {rounds}: other tree {before:.3f} ms, this tree {after:.3f} ms",
            f"ratio {after / before:.3f}, results {bits}",
            f"the same on a cylinder with unequal areas: {unequal:.3f} ms, ratio to equal areas {unequal / after:.3f}",
        ]
    )


def main(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    if list(arguments) == [MEASURE]:
        print(measure())
        return 0
    parser = argparse.ArgumentParser(prog="python -m benchmarks.plant.against", description=__doc__)
    parser.add_argument("other", type=Path, metavar="DIR")
    parser.add_argument("--rounds", type=int, default=8)
    parser.add_argument("--save", action="store_true")
    given = parser.parse_args(arguments)
    text = report(given.other.resolve(), given.rounds)
    print(text)
    if given.save:
        Path(__file__).with_suffix(".txt").write_text(f"{text}\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
