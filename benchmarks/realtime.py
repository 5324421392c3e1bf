"""The closed loop in real time at 1 kHz: achieved rate, latency, missed deadlines, CPU of each process.

    python benchmarks/realtime.py [--seconds 60.0] [--domain 0] [--json FILE]

With and without SCHED_FIFO, beside the usual rclpy way (usual_pattern.py) in the same run. Latency is the round trip
of the plant: from the sampling instant t_k to the arrival of command k, each second's percentiles from /diagnostics.
The last figures are in realtime.txt.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import sys
import time
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "test" / "scripts")]

from listener import Listener  # noqa: E402

from shake_ros.ros.graph import Graph, NodeSpec  # noqa: E402
from shake_ros.ros.interface import DIAGNOSTICS  # noqa: E402

RATE = 1000.0
SETTLING = 2  # reports at the start that are left out
CLOCK_TICKS = os.sysconf("SC_CLK_TCK")
USUAL = (sys.executable, str(ROOT / "benchmarks" / "usual_pattern.py"))
CASES = {"usual rclpy way": (False, True), "ours": (False, False), "ours, SCHED_FIFO": (True, False)}


def nodes(seconds: float, fifo: bool) -> list[NodeSpec]:
    """The graph that is measured."""
    common = {"realtime.enabled": fifo}
    return [
        NodeSpec("reference_generator", {**common, "reference": "sine_20mm_2hz"}),
        NodeSpec("observer", common),
        NodeSpec("controller", common),
        NodeSpec("plant", {**common, "duration": seconds}),
    ]


def processor_time(process: int) -> float:
    """User and system time of a process [s]."""
    fields = Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / CLOCK_TICKS


def reports(listener: Listener) -> list[dict[str, str]]:
    """The plant's values on /diagnostics, one a second, without those of the start."""
    found = []
    for message in listener.messages(DIAGNOSTICS.name):
        for status in message.status:
            values = {item.key: item.value for item in status.values}
            if status.name.endswith(": plant") and "latency_p50_us" in values:
                found.append(values)
    return found[SETTLING:]


def measure(seconds: float, domain: int, fifo: bool, usual: bool) -> dict[str, Any]:
    """One run; raises RuntimeError where it was too short to say anything."""
    with Listener([DIAGNOSTICS.name], lockstep=False, domain_id=domain) as listener:
        graph = Graph(nodes(seconds, fifo), domain_id=domain, lockstep=False)
        if usual:
            graph.program = USUAL
        with graph:
            graph.wait_until_ready()
            before = {name: processor_time(one.pid) for name, one in graph.processes.items()}
            started = time.monotonic()
            time.sleep(0.8 * seconds)
            graph.check()
            elapsed = time.monotonic() - started
            spent = {name: processor_time(one.pid) - before[name] for name, one in graph.processes.items()}
            graph.wait(seconds + 60.0)
        found = reports(listener)
    if len(found) < 2:
        raise RuntimeError(f"{len(found)} reports of the plant: run longer")
    window = (len(found) - 1) * 1.0
    cycles = int(found[-1]["cycles"]) - int(found[0]["cycles"])
    missed = int(found[-1]["missed_deadlines"]) - int(found[0]["missed_deadlines"])
    return {
        "rate": RATE * cycles / (cycles + missed),
        "missed": missed,
        "late_commands": int(found[-1]["late_commands"]) - int(found[0]["late_commands"]),
        "window": window,
        "p50": statistics.median(float(one["latency_p50_us"]) for one in found),
        "p99": statistics.median(float(one["latency_p99_us"]) for one in found),
        "max": max(float(one["latency_max_us"]) for one in found),
        "cpu": {name: 100.0 * value / elapsed for name, value in spent.items()},
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--seconds", type=float, default=60.0, help="of each of the three runs [s]")
    parser.add_argument("--domain", type=int, default=int(os.environ.get("ROS_DOMAIN_ID", "0")))
    parser.add_argument("--json", type=Path, help="write the figures here as well")
    given = parser.parse_args()
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    found = {name: measure(given.seconds, given.domain, *case) for name, case in CASES.items()}
    print(f"{'':18}{'Hz':>8}{'missed':>8}{'late':>7}{'p50':>8}{'p99':>8}{'max us':>9}  CPU % of each process")
    for name, row in found.items():
        processor = ", ".join(f"{node} {value:.0f}" for node, value in row["cpu"].items())
        print(
            f"{name:18}{row['rate']:8.1f}{row['missed']:8}{row['late_commands']:7}"
            f"{row['p50']:8.0f}{row['p99']:8.0f}{row['max']:9.0f}  {processor}"
        )
    best = found["ours, SCHED_FIFO"]
    ratio = max(found["usual rclpy way"]["missed"], 1) / max(best["missed"], 1)
    print(f"usual way : ours with SCHED_FIFO, missed deadlines {ratio:.0f} : 1; load {os.getloadavg()[0]:.1f}")
    if given.json:
        given.json.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
