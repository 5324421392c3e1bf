"""The closed loop in lock-step is the same, sample for sample: processes twice, composed once, core alone once.

    python test/scripts/same_every_time.py [--seconds 2.0] [--domain 0]

Exit status 0 where every decoded message of every topic is the same in every run.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from stepped_loop import simulate_closed_loop

from benchmarks.realtime.listener import SAMPLED, Listener
from shake_ros.control.closed_loop import ClosedLoop
from shake_ros.control.laws import CONTROLLERS
from shake_ros.control.laws.runner import Controller
from shake_ros.control.observer import OBSERVERS
from shake_ros.control.observer.runner import Observer
from shake_ros.physics.plant.table import Table
from shake_ros.recordings.reference_file import build_program
from shake_ros.ros.graph import Graph, NodeSpec, run_composed
from shake_ros.settings import load_table, load_variant

TABLE, REFERENCE, OBSERVER, CONTROLLER, SEED = "bergamo", "pulse", "sliding_mode", "super_twisting", 3
SAMPLE_TIME = 0.001
Run = dict[str, list[Any]]


def nodes(seconds: float) -> list[NodeSpec]:
    """The graph; the reads of the listener are announced with the last node, so that the plant waits for them."""
    return [
        NodeSpec("controller", {"controller": CONTROLLER}),
        NodeSpec("reference_generator", {"reference": REFERENCE}),
        NodeSpec("plant", {"table": TABLE, "seed": SEED, "duration": seconds}, reads=SAMPLED),
        NodeSpec("observer", {"observer": OBSERVER}),
    ]


def run(seconds: float, domain: int, composed: bool) -> Run:
    """One run over DDS: topic → decoded messages."""
    count = round(seconds / SAMPLE_TIME)
    with Listener(lockstep=True, domain_id=domain) as listener:
        started = time.perf_counter()
        if composed:
            run_composed(nodes(seconds), domain_id=domain)
            listener.wait_for(dict.fromkeys(SAMPLED, count), 10.0)
        else:
            with Graph(nodes(seconds), domain_id=domain) as graph:
                graph.wait(60.0 + seconds)
                listener.wait_for(dict.fromkeys(SAMPLED, count), 10.0)
        kind = "composed" if composed else "processes"
        print(f"{kind}: {count} steps in {time.perf_counter() - started:.2f} s with the start")
    return {name: listener.messages(name) for name in SAMPLED}


def core_alone(seconds: float) -> ClosedLoop:
    """The same loop without ROS."""
    return simulate_closed_loop(
        Table(load_table(TABLE), SAMPLE_TIME, SEED),
        Observer(*load_variant("observer", OBSERVER, OBSERVERS), SAMPLE_TIME),
        Controller(*load_variant("controller", CONTROLLER, CONTROLLERS), SAMPLE_TIME),
        build_program(REFERENCE, SAMPLE_TIME),
        round(seconds / SAMPLE_TIME),
    )


def differences(first: Run, second: Run) -> list[str]:
    """Where two runs differ: topic, sample, both messages."""
    found = []
    for name in SAMPLED:
        if len(first[name]) != len(second[name]):
            found.append(f"{name}: {len(first[name])} and {len(second[name])} messages")
        for k, (one, other) in enumerate(zip(first[name], second[name], strict=False)):
            if one != other:
                found.append(f"{name}, sample {k}: {one} and {other}")
                break
    return found


def differences_from_core(found: Run, core: ClosedLoop) -> list[str]:
    """Where a run over DDS differs from the loop without ROS."""
    columns = {
        "joint_states": [m.position[0] for m in found["joint_states"]] == core.measured[:, 0].tolist(),
        "imu": [m.linear_acceleration.x for m in found["imu"]] == core.measured[:, 1].tolist(),
        "pressure_a": [m.fluid_pressure for m in found["pressure_a"]] == core.measured[:, 2].tolist(),
        "valve_command": [m.position[0] for m in found["valve_command"]] == core.command.tolist(),
        "reference": [m.points[0].positions[0] for m in found["reference"]] == core.reference[:, 0].tolist(),
        "estimate": [m.points[0].accelerations[0] for m in found["estimate"]] == core.estimate[:, 2].tolist(),
        "truth": [m.points[0].velocities[0] for m in found["truth"]] == core.truth[:, 1].tolist(),
    }
    return [f"{name} differs from the loop without ROS" for name, same in columns.items() if not same]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--seconds", type=float, default=2.0, help="simulated time of a run [s]")
    parser.add_argument("--domain", type=int, default=int(os.environ.get("ROS_DOMAIN_ID", "0")))
    given = parser.parse_args()
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    first = run(given.seconds, given.domain, composed=False)
    found = [f"second run: {line}" for line in differences(first, run(given.seconds, given.domain, composed=False))]
    found += [f"composed: {line}" for line in differences(first, run(given.seconds, given.domain, composed=True))]
    found += differences_from_core(first, core_alone(given.seconds))
    moved = max(abs(message.points[0].positions[0]) for message in first["truth"])
    print(f"{sum(len(messages) for messages in first.values())} messages a run; the table moved {moved * 1e3:.1f} mm")
    if moved < 1e-3:
        found.append("the table did not move")
    for line in found:
        print(f"DIFFERENT {line}")
    print("the same in every run" if not found else f"{len(found)} differences")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
