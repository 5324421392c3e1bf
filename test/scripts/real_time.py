"""The closed loop in real time at 1 kHz: stamps on the grid, every missed deadline counted, the table follows.

    python test/scripts/real_time.py [--seconds 4.0] [--fifo] [--domain 0]

Says what it found; the exit status is 0 where the bookkeeping is right and the loop is closed. On a machine that is
busy with other work it may not be: the suite runs it beside a bare timer. `benchmarks/realtime/timing.py` measures.
"""

from __future__ import annotations

import argparse
import itertools
import os
import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from benchmarks.realtime.listener import Listener
from shake_ros.ros.conversions import SECOND
from shake_ros.ros.graph import Graph, NodeSpec

PERIOD = SECOND // 1000  # [ns]
TOPICS = ("joint_states", "valve_command", "reference", "truth", "/diagnostics")


def stamps(messages: list[Any]) -> list[int]:
    """Stamps of messages [ns]."""
    return [m.header.stamp.sec * SECOND + m.header.stamp.nanosec for m in messages]


def nodes(seconds: float, fifo: bool) -> list[NodeSpec]:
    """The closed loop on a sine of 20 mm at 2 Hz."""
    common = {"realtime.enabled": fifo}
    return [
        NodeSpec("reference_generator", {**common, "reference": "sine_20mm_2hz"}),
        NodeSpec("observer", common),
        NodeSpec("controller", common),
        # a slow machine must not end the run in a safe hold
        NodeSpec(
            "plant", {**common, "duration": seconds, "interlock.causes.stale_command.threshold": 0.5}, reads=TOPICS[:-1]
        ),
    ]


def check(listener: Listener) -> list[str]:
    """What is wrong with what was heard."""
    found = []
    measured = stamps(listener.messages("joint_states"))
    commands = stamps(listener.messages("valve_command"))
    steps = [after - before for before, after in itertools.pairwise(measured)]
    status = listener.status("plant")
    missed = int(status["missed_deadlines"])
    heard = sum(step // PERIOD - 1 for step in steps)
    print(f"plant: {len(measured)} samples heard, {heard} missing on the grid, {missed} missed deadlines counted")
    print(f"plant: {status['rate_hz']} Hz, round trip p50 {status.get('latency_p50_us', '?')} us")
    if any(step <= 0 or step % PERIOD for step in steps):
        found.append("stamps off the grid or not increasing")
    if heard > missed + len(measured) // 100:
        found.append(f"{heard} samples missing, but {missed} missed deadlines on /diagnostics")
    if not commands:
        found.append("no command")
    # the listener may find the plant later than the controller, lose it earlier, and miss samples of its own when the
    # machine pauses: as many commands as it has missed samples may answer one that it has not heard, on the grid
    known, own_losses = set(measured), max(heard - missed, 0)
    unheard = [stamp for stamp in commands if measured[0] <= stamp <= measured[-1] and stamp not in known]
    if len(unheard) > own_losses or any((stamp - measured[0]) % PERIOD for stamp in unheard):
        found.append(f"{len(unheard)} commands bear a stamp that no measurement has; {own_losses} samples not heard")
    moved = max(abs(m.points[0].positions[0]) for m in listener.messages("truth"))
    asked = max(abs(m.points[0].positions[0]) for m in listener.messages("reference"))
    print(f"asked {asked * 1e3:.1f} mm, moved {moved * 1e3:.1f} mm")
    if not 0.5 * asked < moved < 2.0 * asked:
        found.append("the table does not follow")
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--seconds", type=float, default=4.0, help="duration [s]")
    parser.add_argument("--fifo", action="store_true", help="with SCHED_FIFO where this user may")
    parser.add_argument("--domain", type=int, default=int(os.environ.get("ROS_DOMAIN_ID", "0")))
    given = parser.parse_args()
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    with (
        Listener(TOPICS, lockstep=False, domain_id=given.domain) as listener,
        Graph(nodes(given.seconds, given.fifo), domain_id=given.domain, lockstep=False) as graph,
    ):
        graph.wait(given.seconds + 60.0)
    found = check(listener)
    for line in found:
        print(f"WRONG {line}")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
