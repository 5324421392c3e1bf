"""Every controller in lock-step over DDS has the numbers of the compiled loop, sample for sample.

    python test/scripts/every_controller.py [--seconds 0.5] [--domain 0] [CONTROLLER …]

Exit status 0 where every message of every controller carries the compiled loop's number.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
sys.path.insert(0, str(Path(__file__).resolve().parent))

from same_every_time import Run, differences_from_core

from benchmarks.realtime.listener import SAMPLED, Listener
from shake_ros.control.closed_loop import ClosedLoop, Loop, simulate
from shake_ros.control.laws import CONTROLLERS
from shake_ros.control.laws.runner import Controller
from shake_ros.control.observer import OBSERVERS
from shake_ros.control.observer.runner import Observer
from shake_ros.recordings.reference_file import build_program
from shake_ros.ros.graph import NodeSpec, run_composed
from shake_ros.settings import load_table, load_variant

TABLE, REFERENCE, OBSERVER, SEED = "bergamo", "sine_20mm_2hz", "linear_bergamo", 3
SAMPLE_TIME = 0.001


def over_dds(controller: str, seconds: float, domain: int) -> Run:
    """One run of the graph: topic → decoded messages."""
    nodes = [
        NodeSpec("controller", {"controller": controller}),
        NodeSpec("reference_generator", {"reference": REFERENCE}),
        NodeSpec("plant", {"table": TABLE, "seed": SEED, "duration": seconds}, reads=SAMPLED),
        NodeSpec("observer", {"observer": OBSERVER}),
    ]
    with Listener(lockstep=True, domain_id=domain) as listener:
        run_composed(nodes, domain_id=domain)
        listener.wait_for(dict.fromkeys(SAMPLED, round(seconds / SAMPLE_TIME)), 10.0)
    return {name: listener.messages(name) for name in SAMPLED}


def compiled(controller: str, seconds: float) -> ClosedLoop:
    """The same loop as one compiled function."""
    program = build_program(REFERENCE, SAMPLE_TIME)
    observer = Observer(*load_variant("observer", OBSERVER, OBSERVERS), SAMPLE_TIME)
    law = Controller(*load_variant("controller", controller, CONTROLLERS), SAMPLE_TIME)
    samples = program.samples(0, round(seconds / SAMPLE_TIME))
    return simulate(Loop(load_table(TABLE), observer, law, samples, seed=SEED))[0]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("controllers", nargs="*", default=list(CONTROLLERS), metavar="CONTROLLER")
    parser.add_argument("--seconds", type=float, default=0.5, help="simulated time of each run [s]")
    parser.add_argument("--domain", type=int, default=int(os.environ.get("ROS_DOMAIN_ID", "0")))
    given = parser.parse_args()
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    found = []
    for controller in given.controllers:
        core = compiled(controller, given.seconds)
        own = differences_from_core(over_dds(controller, given.seconds, given.domain), core)
        travel = float(abs(core.command).max())
        print(f"{controller}: largest command {travel:.3f}, {'the same' if not own else '; '.join(own)}", flush=True)
        found += own
    print("every controller is the same" if not found else f"{len(found)} differences")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
