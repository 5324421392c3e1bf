"""A timer and nothing else, as the measure of what the machine gives: how late each tick of an absolute grid comes.

    python benchmarks/realtime/bare_timer.py [--period 0.001] [--priority 0]   # until its standard input ends

Needs the standard library alone. Prints one line of JSON: ticks, how many whole periods were missed, and how late the
ticks were [us]. `bare_timer.c` is the same without Python.
"""

from __future__ import annotations

import argparse
import gc
import json
import os
import select
import sys
import time
from array import array

PERCENTILES = {"p50": 0.5, "p99": 0.99, "p999": 0.999, "max": 1.0}


def measure(period: int) -> tuple[array[int], int]:
    """Lateness of each tick [ns] and the number of missed periods [ns], until standard input ends."""
    late: array[int] = array("q")
    missed, deadline = 0, time.monotonic_ns() + period
    while not late or len(late) % 64 or not select.select([sys.stdin], [], [], 0)[0]:
        time.sleep(max(0, deadline - time.monotonic_ns()) * 1e-9)
        late.append(time.monotonic_ns() - deadline)
        skipped = max(0, late[-1] // period)
        missed += skipped
        deadline += (1 + skipped) * period
    return late, missed


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--period", type=float, default=0.001, help="[s]")
    parser.add_argument("--priority", type=int, default=0, help="of SCHED_FIFO; 0: usual scheduling")
    given = parser.parse_args()
    if given.priority:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(given.priority))
    gc.disable()
    period = round(given.period * 1e9)
    late, missed = measure(period)
    ordered = sorted(late)
    microseconds = {name: ordered[round(share * (len(ordered) - 1))] / 1000 for name, share in PERCENTILES.items()}
    print(json.dumps({"ticks": len(late), "missed": missed, **microseconds}))


if __name__ == "__main__":
    main()
