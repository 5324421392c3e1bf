"""Where the pauses of the loop come from: each that is longer than 2 ms, node by node, with what its thread did then.

    python -m benchmarks.realtime.pauses [--seconds 20] [--graph plant|bridge] [--fifo] [--alike] [--load N] [--joining]

The graph of timing.py as processes that note their own pauses (traced.py), beside the bare timer of bare_timer.c with
the same scheduling, which is the machine's limit. `--load N`: N processes beside it that never wait, at the usual
priority. `--joining`: all the time another node comes and goes, so that discovery has work.

For each node: steps a second, missed periods, pauses and the longest, then how many of them each part was the largest
of, with the milliseconds that it took in all pauses; page faults a second over all steps. `--save` adds to pauses.txt.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from benchmarks.realtime.driver import Driver
from benchmarks.realtime.graphs import PRIORITY, Case, Reports, emulator, nodes
from benchmarks.realtime.listener import Listener
from benchmarks.realtime.timing import begin
from benchmarks.realtime.traced import LIMIT, SETTLING
from shake_ros.realtime import ANY, RealtimeParameters, ask_for
from shake_ros.ros.graph import Graph
from shake_ros.ros.interface import DIAGNOSTICS

TIMER = Path(__file__).with_name("bare_timer.c")
SAVED = Path(__file__).with_suffix(".txt")
JOINING = "import rclpy\nwhile True:\n rclpy.init(); rclpy.create_node('visitor').destroy_node(); rclpy.shutdown()"
PARTS = ("collector", "report", "discovery", "executor", "computation", "waited", "asleep")
QUOTA = Path("/sys/fs/cgroup/cpu.stat")


@contextmanager
def beside(program: str, count: int) -> Iterator[None]:
    """So many processes of a Python program beside the block."""
    started = [subprocess.Popen([sys.executable, "-c", program]) for _ in range(count)]
    try:
        yield
    finally:
        for process in started:
            process.kill()
            process.wait()


def throttled() -> int:
    """How often a quota of the control group has stopped its processes."""
    lines = QUOTA.read_text().splitlines() if QUOTA.is_file() else []
    return sum(int(line.split()[1]) for line in lines if line.startswith("nr_throttled"))


def stolen() -> float:
    """Time that the hypervisor gave to others so far, of all processors [s]."""
    return int(Path("/proc/stat").read_text().split("\n", 1)[0].split()[8]) / os.sysconf("SC_CLK_TCK")


def run(case: Case, seconds: float, domain: int, alike: bool) -> tuple[dict[str, Any], list[str]]:
    """What each node noted, and the bare timer's line, over a run."""
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        timer = folder / "bare_timer"
        subprocess.run(["cc", "-O2", "-o", timer, TIMER], check=True)
        target = stack.enter_context(emulator(case))
        listener = stack.enter_context(Listener([DIAGNOSTICS.name], lockstep=False, domain_id=domain))
        graph = Graph(nodes(case, target.bridge if target else ""), domain_id=domain, lockstep=False)
        graph.program = (sys.executable, "-m", "benchmarks.realtime.traced")
        os.environ["PAUSES"] = str(folder)
        running = stack.enter_context(graph)
        reports = Reports(listener)
        driver = stack.enter_context(Driver(domain_id=domain, node=case.table)) if case.bridge else None
        if driver:
            driver.node.destroy_publisher(driver.publisher)
        begin(case, running, reports, driver)
        if alike:
            ask_for(RealtimeParameters(True, PRIORITY, ANY, False, False, False))
        time.sleep(SETTLING / 1e9)
        priority = [str(PRIORITY)] if case.fifo else []
        limit = subprocess.run([timer, str(seconds), *priority], capture_output=True, text=True, check=True).stdout
        running.stop()
        found = {one: json.loads((folder / f"{one}.json").read_text()) for one in running.processes}
        return found, limit.split()


def lines(found: dict[str, Any], limit: list[str], seconds: float) -> list[str]:
    """The table of one run."""
    said = [f"{'':22}steps/s  pauses  longest ms   " + "".join(f"{part:>15}" for part in PARTS) + "   faults/s"]
    for node, of in found.items():
        pauses = of["pauses"]
        largest = [max(PARTS, key=lambda part: one[part]) for one in pauses]
        cells = [f"{largest.count(part)} ({sum(one[part] for one in pauses):.0f} ms)" for part in PARTS]
        longest = max((one["late"] for one in pauses), default=0.0)
        said.append(
            f"{node:20}{of['steps'] / of['seconds']:9.1f}{len(pauses):8}{longest:12.1f}   "
            + "".join(f"{cell:>15}" for cell in cells)
            + f"{of['faults'] / of['seconds']:11.1f}"
        )
    ticks, missed, *late = map(float, limit)
    said.append(
        f"bare C timer        {ticks / seconds:9.1f}, {missed:.0f} missed; late p50 p99 p99.9 max "
        + " ".join(f"{value:.0f}" for value in late)
        + " us"
    )
    return said


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--seconds", type=float, default=20.0, help="of the run [s]")
    parser.add_argument("--graph", choices=("plant", "bridge"), default="plant")
    parser.add_argument("--fifo", action="store_true", help="with SCHED_FIFO")
    parser.add_argument("--alike", action="store_true", help="with the priority for this program too, which listens")
    parser.add_argument("--load", type=int, default=0, help="processes that never wait, beside it")
    parser.add_argument("--joining", action="store_true", help="a node comes and goes all the time, beside it")
    parser.add_argument("--domain", type=int, default=int(os.environ.get("ROS_DOMAIN_ID", "0")))
    parser.add_argument("--note", default="", help="words for the heading")
    parser.add_argument("--save", action="store_true", help=f"add to {SAVED.name}")
    given = parser.parse_args()
    os.environ |= {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "ROS_DOMAIN_ID": str(given.domain)}
    case = Case(bridge=given.graph == "bridge", fifo=given.fifo)
    before = throttled(), stolen()
    with beside("while True: pass", given.load), beside(JOINING, int(given.joining)):
        found, limit = run(case, given.seconds, given.domain, given.alike)
        load = os.getloadavg()[0]
    heading = [
        f"{given.graph}, {'SCHED_FIFO' if given.fifo else 'usual scheduling'}"
        f"{', who listens too' if given.alike else ''}, {given.load} busy processes beside"
        f"{', a node joins and leaves' if given.joining else ''}{'; ' if given.note else ''}{given.note}",
        f"  {given.seconds:g} s, pauses beyond {LIMIT / 1e6:g} ms; load {load:.1f}, stopped by a quota "
        f"{throttled() - before[0]} times, {stolen() - before[1]:.1f} s stolen by the hypervisor",
    ]
    text = "\n".join([*heading, *lines(found, limit, given.seconds), ""])
    print(text, flush=True)
    if given.save:
        with SAVED.open("a", encoding="utf-8") as saved:
            saved.write(text + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
