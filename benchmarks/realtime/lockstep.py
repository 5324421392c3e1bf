"""Steps a second of the closed loop in lock-step: plant, reference, observer, controller and recorder over DDS.

    python -m benchmarks.realtime.lockstep [--seconds 10.0] [--domain 0] [--json FILE]

As separate processes and all in one, each beside the usual rclpy way (usual_pattern.py) in the same run.
The last figures are in lockstep.txt.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

from benchmarks.realtime import usual_pattern
from shake_ros.recordings.bags.bag import Bag
from shake_ros.ros import interface
from shake_ros.ros.graph import Graph, NodeSpec, run_composed

SAMPLE_TIME = 0.001
REQUIRED = {"processes": 1200.0, "composed": 3000.0}  # steps/s
WARM_UP = 0.1  # [s], fills the compilation cache
TOPICS = tuple(topic.name for topic in interface.TOPICS.values() if topic.sampled)


def nodes(seconds: float, bag: Path) -> list[NodeSpec]:
    """The graph that is measured."""
    return [
        NodeSpec("recorder", {"output": str(bag)}),
        NodeSpec("reference_generator", {"reference": "sine_20mm_2hz"}),
        NodeSpec("observer"),
        NodeSpec("controller"),
        NodeSpec("plant", {"duration": seconds}),
    ]


def steps_per_second(output: str, bag: Path, seconds: float) -> float:
    """From the plant's last line, once the recording has every sample; RuntimeError where it has not."""
    wanted = round(seconds / SAMPLE_TIME)
    found = {name.rpartition("/")[2]: topic.count for name, topic in Bag(str(bag)).topics.items()}
    short = {name: found.get(name, 0) for name in TOPICS if found.get(name, 0) != wanted}
    done = re.search(r"done: (\d+) samples in ([\d.]+) s", output)
    if short or done is None:
        raise RuntimeError(f"incomplete: {short} of {wanted} messages\n{output[-1000:]}")
    return int(done[1]) / float(done[2])


def processes(seconds: float, domain: int, bag: Path, usual: bool) -> float:
    """Steps/s as separate processes."""
    graph = Graph(nodes(seconds, bag), domain_id=domain)
    if usual:
        graph.program = (sys.executable, "-m", "benchmarks.realtime.usual_pattern")
    with graph:
        graph.wait(300.0 + 20.0 * seconds)
        graph.stop()
        return steps_per_second(graph.output("plant"), bag, seconds)


def composed(seconds: float, domain: int, bag: Path, usual: bool) -> float:
    """Steps/s in one process, which is started for it."""
    command = [
        sys.executable,
        "-m",
        "benchmarks.realtime.lockstep",
        "--inside",
        str(bag),
        "--seconds",
        str(seconds),
        "--domain",
        str(domain),
    ]
    done = subprocess.run(
        [*command, *(["--usual"] if usual else [])], capture_output=True, text=True, timeout=300.0, check=True
    )
    return steps_per_second(done.stderr, bag, seconds)


def measure(seconds: float, domain: int) -> dict[str, dict[str, float]]:
    """Steps/s of both arrangements, ours and the usual way, and their ratio."""
    found: dict[str, dict[str, float]] = {}
    with tempfile.TemporaryDirectory() as folder:
        for name, run in (("processes", processes), ("composed", composed)):
            run(WARM_UP, domain, Path(folder) / f"{name}_warm", False)
            ours = run(seconds, domain, Path(folder) / f"{name}_ours", False)
            usual = run(seconds, domain, Path(folder) / f"{name}_usual", True)
            found[name] = {"steps_per_second": ours, "usual": usual, "ratio": ours / usual, "required": REQUIRED[name]}
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--seconds", type=float, default=10.0, help="simulated time of a run [s]")
    parser.add_argument("--domain", type=int, default=int(os.environ.get("ROS_DOMAIN_ID", "0")))
    parser.add_argument("--json", type=Path, help="write the figures here as well")
    parser.add_argument("--inside", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--usual", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    if given.inside:
        if given.usual:
            usual_pattern.use()
        run_composed(nodes(given.seconds, given.inside), domain_id=given.domain)
        return 0
    found = measure(given.seconds, given.domain)
    print(
        f"{round(given.seconds / SAMPLE_TIME)} steps, recorded, every message in the bag; load {os.getloadavg()[0]:.1f}"
    )
    print(f"{'':12}{'steps/s':>10}{'usual way':>12}{'ratio':>8}{'required':>10}")
    for name, row in found.items():
        print(f"{name:12}{row['steps_per_second']:10.0f}{row['usual']:12.0f}{row['ratio']:8.2f}{row['required']:10.0f}")
    if given.json:
        given.json.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
