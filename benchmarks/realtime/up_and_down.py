"""A graph of seven nodes brought up and taken down again and again: no crash, no hang, no process left.

    python -m benchmarks.realtime.up_and_down [--times 50] [--minutes 4] [--domain 0] [--save]

Each time every node reports on /diagnostics, then SIGINT ends all of them with exit code 0, the recorder last. Says how
long that took and how many segments of shared memory are left; --save writes it to up_and_down.txt.
"""

from __future__ import annotations

import argparse
import math
import os
import statistics
import sys
import tempfile
import time
from pathlib import Path

from tqdm import tqdm

from shake_ros.recordings.bags.bag import Bag
from shake_ros.ros.graph import Graph, NodeSpec

SAVED = Path(__file__).with_suffix(".txt")
SHARED_MEMORY = Path("/dev/shm")
PLAYED = 0.5  # s of the loop in between


def segments() -> int:
    """Segments of shared memory of Fast DDS."""
    return sum(path.name.startswith("fastrtps") for path in SHARED_MEMORY.iterdir()) if SHARED_MEMORY.is_dir() else 0


def again_and_again(times: int, domain: int, minutes: float = math.inf) -> list[tuple[float, float]]:
    """Seconds until every node runs, and until all have ended, each time; raises GraphError where one does not."""
    found: list[tuple[float, float]] = []
    first = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        for number in tqdm(range(times), disable=not sys.stderr.isatty()):
            if time.monotonic() - first > 60.0 * minutes:
                break
            bag = Path(folder) / f"run_{number}"
            nodes = [
                NodeSpec("plant"),
                NodeSpec("reference_generator", {"reference": "sine_20mm_2hz"}),
                NodeSpec("observer"),
                NodeSpec("controller"),
                NodeSpec("thd_analyzer"),
                NodeSpec("faults", {"topics": "pressure_supply"}, name="between", remaps={"pressure_supply": "other"}),
                NodeSpec("recorder", {"output": str(bag)}),
            ]
            begun = time.monotonic()
            with Graph(nodes, domain_id=domain, lockstep=False) as graph:
                graph.wait_until_ready()
                up = time.monotonic()
                time.sleep(PLAYED)
                ending = time.monotonic()
                graph.stop()
            found.append((up - begun, time.monotonic() - ending))
            whole = Bag(bag)  # closed in good order
            whole.close()
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--times", type=int, default=50)
    parser.add_argument("--domain", type=int, default=int(os.environ.get("ROS_DOMAIN_ID", "0")))
    parser.add_argument("--minutes", type=float, default=math.inf, help="begin none after so many")
    parser.add_argument("--save", action="store_true", help=f"write {SAVED.name} as well")
    given = parser.parse_args()
    before = segments()
    found = again_and_again(given.times, given.domain, given.minutes)
    up, down = (sorted(column) for column in zip(*found, strict=True))
    text = (
        f"python -m benchmarks.realtime.up_and_down --times {given.times}   ({os.cpu_count()} cores, load "
        f"{os.getloadavg()[0]:.1f})\n\n"
        f"{len(found)} times up and down, 7 nodes each, every node ended with 0, every recording whole\n"
        f"up    median {statistics.median(up):.2f} s, longest {up[-1]:.2f} s\n"
        f"down  median {statistics.median(down):.2f} s, longest {down[-1]:.2f} s\n"
        f"segments of shared memory left behind: {segments() - before}\n"
    )
    print(text, end="")
    if given.save:
        SAVED.write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
