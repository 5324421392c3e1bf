"""Memory of identification: python -m benchmarks.identification.memory [--seconds 60] [--hour 3600]

Two processes of their own, so that each one's peak (resource.getrusage) is its own: `identify` on three recordings of
--seconds at 1 kHz, and recordings of a tenth of --hour and of --hour read. Beside each are the peak of a process that
only imports the package and, for the recordings, the size of the samples alone. Target: below 2 GiB.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from shake_ros.declared import model_structure
from shake_ros.fit.records import Record
from shake_ros.physics.plant.simulation import run
from shake_ros.recordings.bags import read_table_recording, write_table_recording
from shake_ros.search.declared_fit import identify
from shake_ros.settings import load_search, load_table

RATE = 1000  # [Hz]
COLUMNS = 4  # time, command, position, acceleration


def command(seconds: float, seed: int) -> np.ndarray:
    """A sum of sines that keeps the table within its stroke."""
    rng = np.random.default_rng(seed)
    t = np.arange(round(seconds * RATE)) / RATE
    return np.asarray(
        sum(0.06 * np.cos(2.0 * np.pi * f * t + rng.uniform(0.0, 6.0)) for f in (0.7, 1.3, 2.9, 4.7, 7.9))
    )


def fit_three(seconds: float) -> str:
    """`identify` on three recordings."""
    table, records = load_table("bergamo"), []
    for seed in range(3):
        u, rng = command(seconds, seed), np.random.default_rng(seed)
        out = run(table, u, 1.0 / RATE)
        noise = rng.standard_normal((2, len(u)))
        position = out[:, 0] + table.sensors.position_noise * noise[0]
        felt = out[:, 2] + table.sensors.acceleration_noise * noise[1]
        records.append(Record(f"run{seed}", 1.0 / RATE, u, position, felt))
    identify(model_structure(table), records, [], load_search(), lambda text, part: None)
    return f"identify, three recordings of {seconds:g} s at 1 kHz"


def read(path: Path) -> str:
    """A recording read."""
    samples = len(read_table_recording(path))
    return f"{samples} samples read ({samples * COLUMNS * 8 / 2**20:.0f} MiB of numbers)"


def peak() -> float:
    """Peak resident memory of this process [MiB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def in_a_process(*arguments: str) -> None:
    """Run one part by itself."""
    print(
        subprocess.run(
            [sys.executable, "-m", "benchmarks.identification.memory", *arguments],
            check=True,
            capture_output=True,
            text=True,
        ).stdout,
        end="",
    )


def main() -> None:
    """Run both parts, or the one that --part names."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--seconds", type=float, default=60.0)
    options.add_argument("--hour", type=float, default=3600.0, help="length of the long recording [s]")
    options.add_argument("--part", choices=("nothing", "fit", "read"), help="(used by the program itself)")
    options.add_argument("--path", type=Path)
    given = options.parse_args()
    if given.part:
        start = time.perf_counter()
        parts = {"nothing": lambda: "imports alone", "fit": lambda: fit_three(given.seconds)}
        said = read(given.path) if given.part == "read" else parts[given.part]()
        print(f"peak {peak():7.0f} MiB  {time.perf_counter() - start:7.1f} s  {said}")
        return
    in_a_process("--part", "nothing")
    in_a_process("--part", "fit", "--seconds", str(given.seconds))
    with tempfile.TemporaryDirectory() as folder:
        for seconds in (given.hour / 10.0, given.hour):
            u = command(seconds, 1)
            t, path = np.arange(len(u)) / RATE, Path(folder) / f"{seconds:.0f}"
            position = 0.01 * np.sin(2.0 * np.pi * t)
            write_table_recording(path, time=t, valve_command=u, position=position, acceleration=-0.4 * position)
            in_a_process("--part", "read", "--path", str(path))


if __name__ == "__main__":
    main()
