"""Each controller live over DDS at 1 kHz beside its numbers in lock-step.

    python -m benchmarks.realtime.controllers [--seconds 12.0] [--domain 0] [--fifo] [--save] [CONTROLLER …]

The graph of separate processes runs in real time on the wall clock; the motion that it published is judged as `compare`
judges, beside the compiled loop, whose numbers are those of the graph in lock-step (test/scripts/every_controller.py).
The live loop acts on whatever command is newest, so it differs by its latency and missed deadlines, which stand
beside it. --save writes benchmarks/realtime/controllers.txt.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from benchmarks.realtime.listener import Listener
from shake_ros.control.closed_loop import Loop, normalised_error, simulate
from shake_ros.control.laws import CONTROLLERS
from shake_ros.control.laws.runner import Controller
from shake_ros.control.observer import OBSERVERS
from shake_ros.control.observer.runner import Observer
from shake_ros.recordings.reference_file import build_program
from shake_ros.ros.graph import Graph, NodeSpec
from shake_ros.ros.interface import DIAGNOSTICS
from shake_ros.settings import find, load_table, load_variant, read_yaml

SAMPLE_TIME = 0.001
TABLE, OBSERVER, REFERENCE, SEED = "bergamo", "linear_bergamo", "sine_20mm_2hz", 3
SETTLED = 1.5  # [s] at the start that do not count
LONG = 600.0  # [s] of the reference
HEARD = ("truth", "reference", "valve_command", DIAGNOSTICS.name)


def stamp(message: Any) -> float:
    """Sampling instant [s]."""
    return float(message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec)


def motion(messages: list[Any]) -> tuple[np.ndarray, np.ndarray]:
    """Times (n,) [s] and position, velocity, acceleration (n, 3) of trajectory messages."""
    points = [m.points[0] for m in messages]
    rows = [[p.positions[0], p.velocities[0], p.accelerations[0]] for p in points]
    return np.array([stamp(m) for m in messages]), np.array(rows)


def long_reference(folder: Path) -> str:
    """The reference's sine for longer than nodes take to start: the generator does not wait for them in real time."""
    path = folder / "reference.yaml"
    content = {**read_yaml(find("reference", REFERENCE)), "duration": LONG}
    path.write_text(yaml.safe_dump(content), encoding="utf-8")
    return str(path)


def live(
    controller: str, seconds: float, domain: int, fifo: bool, folder: Path
) -> tuple[list[float], float, dict[str, str]]:
    """Errors, command travel [1/s] and the plant's last report of a run in real time."""
    common = {"realtime.enabled": fifo}
    reference_file = long_reference(folder)
    nodes = [
        NodeSpec("reference_generator", {**common, "reference": reference_file}),
        NodeSpec("observer", {**common, "observer": OBSERVER}),
        NodeSpec("controller", {**common, "controller": controller}),
        NodeSpec("plant", {**common, "table": TABLE, "seed": SEED, "duration": seconds}),
    ]
    with Listener(HEARD, lockstep=False, domain_id=domain) as listener:
        with Graph(nodes, domain_id=domain, lockstep=False) as graph:
            graph.wait_until_ready()
            graph.wait(seconds + 60.0)
        time.sleep(0.2)
        time_truth, truth = motion(listener.messages("truth"))
        time_reference, reference = motion(listener.messages("reference"))
        commands = [m.position[0] for m in listener.messages("valve_command")]
        status = [s for m in listener.messages(DIAGNOSTICS.name) for s in m.status if s.name.endswith(": plant")]
    reports = [{item.key: item.value for item in one.values} for one in status]
    # the generator has a clock of its own in real time: the reference is taken at the plant's instants
    both = (time_truth >= max(time_reference[0], time_truth[0]) + SETTLED) & (time_truth <= time_reference[-1])
    if np.count_nonzero(both) < 1000:
        raise RuntimeError(f"{controller}: {np.count_nonzero(both)} samples of truth and reference belong together")
    found = truth[both]
    wanted = np.column_stack([np.interp(time_truth[both], time_reference, column) for column in reference.T])
    travel = float(np.mean(np.abs(np.diff(commands))) / SAMPLE_TIME)
    return normalised_error(wanted, found).tolist(), travel, reports[-1] if reports else {}


def lockstep(controller: str, seconds: float) -> tuple[list[float], float]:
    """Errors and command travel [1/s] of the compiled loop."""
    states = build_program(REFERENCE, SAMPLE_TIME).samples(0, round(seconds / SAMPLE_TIME))
    observer = Observer(*load_variant("observer", OBSERVER, OBSERVERS), SAMPLE_TIME)
    law = Controller(*load_variant("controller", controller, CONTROLLERS), SAMPLE_TIME)
    run, _ = simulate(Loop(load_table(TABLE), observer, law, states, seed=SEED))
    first = round(SETTLED / SAMPLE_TIME)
    return run.tracking_error(first).tolist(), float(np.mean(np.abs(np.diff(run.command))) / SAMPLE_TIME)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("controllers", nargs="*", metavar="CONTROLLER")
    parser.add_argument("--seconds", type=float, default=9.0, help="of each run [s]")
    parser.add_argument("--domain", type=int, default=int(os.environ.get("ROS_DOMAIN_ID", "0")))
    parser.add_argument("--fifo", action="store_true", help="SCHED_FIFO")
    parser.add_argument("--save", action="store_true")
    given = parser.parse_args()
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    lines = [
        f"{'':28}{'live: errors [%]':>22}{'travel':>8}{'missed':>8}{'p50':>6}{'p99 us':>8}"
        f"{'lock-step: errors [%]':>26}{'travel':>8}"
    ]
    print(lines[0])
    for controller in given.controllers or [name for name in CONTROLLERS if name != "none"]:
        with tempfile.TemporaryDirectory() as folder:
            errors, travel, report = live(controller, given.seconds, given.domain, given.fifo, Path(folder))
        expected, wanted_travel = lockstep(controller, given.seconds)
        shown, there = ("".join(f"{100.0 * e:8.2f}" for e in row) for row in (errors, expected))
        latency = [float(report.get(f"latency_{name}_us", "nan")) for name in ("p50", "p99")]
        lines.append(
            f"{controller:28}{shown:>22}{travel:8.2f}{report.get('missed_deadlines', '-'):>8}"
            f"{latency[0]:6.0f}{latency[1]:8.0f}{there:>26}{wanted_travel:8.2f}"
        )
        print(lines[-1], flush=True)
    schedule = "SCHED_FIFO" if given.fifo else "the usual scheduling"
    lines.append(f"{REFERENCE}, {given.seconds:g} s each, {schedule}; load of the machine {os.getloadavg()[0]:.1f}")
    print(lines[-1])
    if given.save:
        Path(__file__).with_suffix(".txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
