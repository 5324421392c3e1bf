"""The reader of tables on a file of a million rows, beside numpy.loadtxt on the same file in the same run.

    python -m benchmarks.recordings.tables [--rows 1000000] [--save]

Ratios of processor time, the least of three: how the table is written is found, and its columns are read. Last figures:
tables.txt.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from shake_ros.recordings.tables.table import read_table


def least(work: Callable[[], object], times: int = 3) -> float:
    """The least processor time of some runs [s]."""
    found = []
    for _ in range(times):
        started = time.process_time()
        work()
        found.append(time.process_time() - started)
    return min(found)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--rows", type=int, default=1_000_000)
    parser.add_argument("--save", action="store_true", help="write tables.txt as well")
    given = parser.parse_args()
    t = np.arange(given.rows) / 1000.0
    table = np.column_stack([t, np.sin(t), 20.0 * np.cos(t)])
    said = [f"python -m benchmarks.recordings.tables --rows {given.rows}", ""]
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "run.csv"
        np.savetxt(file, table, ["%.3f", "%.6f", "%.5f"], ",", header="Time [s],Valve [V],Disp [mm]", comments="")
        points = file.read_text()
        base = least(lambda: np.loadtxt(file, delimiter=",", skiprows=1))
        said.append(f"numpy.loadtxt: {base:.2f} s")
        ways = {
            "decimal points": points,
            "decimal commas": points.replace(",", ";").replace(".", ","),
            "a separator at the end of each row": points.replace("\n", ",\n"),
            "every cell in quotes": '"' + points.rstrip("\n").replace(",", '","').replace("\n", '"\n"') + '"\n',
            "a row of units and text behind": points.replace("\n", "\ns,V,mm\n", 1) + "End of test\n",
        }
        for name, text in ways.items():
            file.write_text(text)
            took = least(lambda: read_table(file).read((0, 1, 2)))
            said.append(f"{name}: {took / base:.1f} times numpy.loadtxt")
    print("\n".join(said))
    if given.save:
        Path(__file__).with_suffix(".txt").write_text("\n".join(said) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
