"""The loop on an idle and on a loaded machine, with and without priority, beside a bare C timer: what it gives away.

    python -m benchmarks.realtime.idle_and_loaded [--seconds 15] [--load 0 4] [--graph NAME …] [--domain 0] [--save]

The graphs of timing.py over plant and bridge as processes; `--load`: so many processes that never wait, at the usual
priority, beside each. The timer (bare_timer.c) has the loop's scheduling and runs at the same time, so that it is the
limit of this machine in that hour. `pauses` says where each long pause comes from; the last table is in
idle_and_loaded.txt.
"""

from __future__ import annotations

import argparse
import itertools
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from benchmarks.realtime.graphs import CASES, PRIORITY
from benchmarks.realtime.pauses import TIMER, beside
from benchmarks.realtime.timing import above_other_work, measure

GRAPHS = ("unscheduled", "plant", "bridge_unscheduled", "bridge")
BUSY = "while True: pass"
SAVED = Path(__file__).with_suffix(".txt")
COLUMNS = (
    "steps/s",
    "missed",
    "late",
    "held",
    "p50",
    "p99",
    "p99.9",
    "max",
    "timer missed",
    "timer p99.9",
    "timer max",
)


class BareTimer:
    """A bare timer in C for the time of the block.

    Attributes
    ----------
    found : ticks, missed periods, then lateness p50, p99, p99.9 and the longest [us].
    """

    def __init__(self, program: Path, seconds: float, fifo: bool) -> None:
        self._command = [str(program), str(seconds), *([str(PRIORITY)] if fifo else [])]
        self.found: list[float] = []

    def __enter__(self) -> BareTimer:
        self._process = subprocess.Popen(self._command, stdout=subprocess.PIPE, text=True)
        return self

    def __exit__(self, kind: object, *_: object) -> None:
        if kind is not None:
            self._process.kill()
        said, _nothing = self._process.communicate()
        self.found = [float(word) for word in said.split()]


def row(name: str, load: int, found: dict[str, Any], limit: list[float]) -> str:
    """One run: shares in percent, latency and lateness in microseconds."""
    periods = found["samples"] + found["missed"]
    shares = (found["missed"] / periods, found["late"] / max(found["samples"], 1))
    cells = [f"{found['rate']:.1f}", *(f"{100.0 * share:.3f} %" for share in shares), f"{found['seconds_not_running']}"]
    cells += [f"{found['latency'].get(key, float('nan')):.0f}" for key in ("p50", "p99", "p999", "max")]
    cells += [f"{100.0 * limit[1] / (limit[0] + limit[1]):.3f} %", f"{limit[4]:.0f}", f"{limit[5]:.0f}"]
    graph = "bridge" if CASES[name].bridge else "plant"
    scheduling = "SCHED_FIFO" if CASES[name].fifo else "usual"
    return f"{graph:8}{scheduling:12}{load:>4}" + "".join(
        f"{cell:>{max(len(column), 8) + 2}}" for column, cell in zip(COLUMNS, cells, strict=True)
    )


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--seconds", type=float, default=15.0, help="of each run [s]")
    parser.add_argument("--load", type=int, nargs="+", default=[0, 4], help="processes that never wait, beside it")
    parser.add_argument("--graph", choices=GRAPHS, nargs="+", default=list(GRAPHS))
    parser.add_argument("--domain", type=int, default=int(os.environ.get("ROS_DOMAIN_ID", "0")))
    parser.add_argument("--save", action="store_true", help=f"write {SAVED.name} as well")
    given = parser.parse_args()
    os.environ |= {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "ROS_DOMAIN_ID": str(given.domain)}
    above_other_work()
    said = [
        f"python -m benchmarks.realtime.idle_and_loaded --seconds {given.seconds:g}   ({os.cpu_count()} cores, load "
        f"{os.getloadavg()[0]:.1f} before)",
        "",
        f"{'graph':8}{'scheduling':12}{'busy':>4}" + "".join(f"{one:>{max(len(one), 8) + 2}}" for one in COLUMNS),
    ]
    print("\n".join(said), flush=True)
    with tempfile.TemporaryDirectory() as folder:
        program = Path(folder) / "bare_timer"
        subprocess.run(["cc", "-O2", "-o", program, TIMER], check=True)
        for load, name in itertools.product(given.load, given.graph):
            limit = BareTimer(program, given.seconds, CASES[name].fifo)
            with beside(BUSY, load):
                found = measure(name, given.seconds, given.domain, limit)
            said.append(row(name, load, found, limit.found))
            print(said[-1], flush=True)
    said += ["", "shares of the periods; held: seconds in which the table did not run; latency and lateness in us", ""]
    if given.save:
        SAVED.write_text("\n".join(said), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
