"""How long a node takes to start: python -m benchmarks.realtime.start [--repeats 5] [--domain 0] [--save].

Seconds from the start of the process to its first message at a reader that is there already, for every kind of node
with its code compiled beforehand, in turn with a bare rclpy node that publishes once it has a reader (bare_node.py).
The smallest and the median of the repeats by the wall clock, the processor's time that the process had taken by then,
and the ratio of the medians. --save writes benchmarks/realtime/start.txt.
"""

from __future__ import annotations

import argparse
import os
import platform
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from benchmarks import ROOT
from benchmarks.realtime.listener import Listener
from shake_ros.entry_points import NODES
from shake_ros.recordings.bags import write_table_recording
from shake_ros.ros.interface import DIAGNOSTICS

TIMEOUT = 120.0  # [s] the first start may have to compile
TICKS = os.sysconf("SC_CLK_TCK")
BARE = "bare rclpy node"
COMMON = ("--ros-args", "-p", "lockstep:=false", "-p")
READERS = {"recorder": 2}  # of /diagnostics that a node awaits before it starts: itself as well


def arguments(folder: Path) -> dict[str, list[str]]:
    """The command of each kind of node; recorder and player need a place and a recording."""
    k = np.arange(200)
    recording = write_table_recording(folder / "recording", 0.01 * k, 0.001 * k, 0.01 * k, -0.1 * k)
    own = {"recorder": ["-p", f"output:={folder / 'made'}-%"], "player": ["-p", f"input:={recording}"]}
    commands = {BARE: ["-m", "benchmarks.realtime.bare_node"]}
    for name in NODES:
        awaited = f"wait_for:='{DIAGNOSTICS.name}:{READERS.get(name, 1)}'"
        commands[name] = ["-m", "shake_ros", name, *COMMON, awaited, *own.get(name, [])]
    return commands


def processor_time(process: int) -> float:
    """User and system time of a process so far [s]."""
    fields = Path(f"/proc/{process}/stat").read_text(encoding="utf-8").rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / TICKS


def start_once(command: list[str], number: int, domain: int) -> tuple[float, float]:
    """Wall clock and processor time [s] from the start of a process to its first message."""
    given = [part.replace("%", str(number)) for part in command]
    environment = {**os.environ, "ROS_DOMAIN_ID": str(domain), "PYTHONPATH": str(ROOT)}
    with Listener([DIAGNOSTICS.name], lockstep=False, domain_id=domain) as listener:
        begun = time.time_ns()
        process = subprocess.Popen([sys.executable, *given], env=environment, stderr=subprocess.PIPE)
        try:
            deadline = time.monotonic() + TIMEOUT
            while not listener.arrivals[DIAGNOSTICS.name]:
                if process.poll() is not None or time.monotonic() > deadline:
                    process.kill()
                    said = process.communicate()[1].decode(errors="replace").strip().splitlines()
                    raise RuntimeError(f"{' '.join(given)}: no message. {' '.join(said[-1:])}")
                time.sleep(0.001)
            spent = processor_time(process.pid)
            return 1e-9 * (listener.arrivals[DIAGNOSTICS.name][0] - begun), spent
        finally:
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
                try:
                    process.communicate(timeout=10.0)
                except subprocess.TimeoutExpired:
                    process.kill()
                    process.communicate()


def report(repeats: int, domain: int) -> Iterator[str]:
    """The table, line by line."""
    machine = f"{os.cpu_count()} cores {platform.machine()}, Python {platform.python_version()}"
    yield f"{time.strftime('%Y-%m-%d')}, {machine}, load {os.getloadavg()[0]:.1f}, {repeats} starts each"
    yield f"{'node':22s} {'best s':>7s} {'median s':>9s} {'processor s':>12s} {'to bare':>8s}"
    with tempfile.TemporaryDirectory() as folder:
        commands = arguments(Path(folder))
        found: dict[str, list[tuple[float, float]]] = {name: [] for name in commands}
        for number in range(repeats + 1):  # the first one compiles and does not count
            for name, command in commands.items():
                result = start_once(command, number, domain)
                found[name] += [result] if number else []
    bare = statistics.median(wall for wall, _ in found[BARE])
    for name, results in found.items():
        walls, processor = [wall for wall, _ in results], min(spent for _, spent in results)
        median = statistics.median(walls)
        yield f"{name:22s} {min(walls):7.2f} {median:9.2f} {processor:12.2f} {median / bare:8.1f}"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--repeats", type=int, default=5, help="starts that count of each kind")
    parser.add_argument("--domain", type=int, default=int(os.environ.get("ROS_DOMAIN_ID", "0")))
    parser.add_argument("--save", action="store_true", help="write the table to benchmarks/realtime/start.txt as well")
    given = parser.parse_args()
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    lines = []
    for line in report(given.repeats, given.domain):
        print(line, flush=True)
        lines.append(line)
    if given.save:
        Path(__file__).with_suffix(".txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
