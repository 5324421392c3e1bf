"""A recorded closed-loop run: plant, reference generator, observer, controller and recorder in lock-step over DDS."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from shake_ros.ros.graph import Graph, GraphError, NodeSpec

POLL = 0.1  # [s]
SLOWEST = 50.0  # steps/s below which a run counts as stuck
STARTING = 300.0  # time that five processes may take to start, compiling on a slow and busy machine [s]


@dataclass(frozen=True)
class Experiment:
    """What runs: configurations by name or path, and the seed of the sensor noise."""

    table: str
    reference: str
    observer: str
    controller: str
    seed: int
    duration: float


def free_domain() -> int:
    """A ROS domain of this process's own, unless the environment names one."""
    given = os.environ.get("ROS_DOMAIN_ID")
    return int(given) if given else 1 + os.getpid() % 100


def record(experiment: Experiment, bag: Path, progress: Callable[[float], None] = lambda _: None) -> float:
    """Run an experiment as separate processes and record everything to a bag.

    Parameters
    ----------
    progress : called with the part done, 0 … 1, estimated from the clock at the usual rate.

    Returns
    -------
    Wall time of the run with start and stop [s].

    Raises
    ------
    GraphError : a node died, or the run is stuck.
    """
    nodes = [
        NodeSpec("recorder", {"output": str(bag)}),
        NodeSpec("controller", {"controller": experiment.controller}),
        NodeSpec("reference_generator", {"reference": experiment.reference}),
        NodeSpec("plant", {"table": experiment.table, "seed": experiment.seed, "duration": experiment.duration}),
        NodeSpec("observer", {"observer": experiment.observer}),
    ]
    started = time.monotonic()
    usual, limit = 3.0 + experiment.duration, STARTING + experiment.duration * 1000.0 / SLOWEST
    with Graph(nodes, domain_id=free_domain()) as graph:
        while graph.processes["plant"].poll() is None:
            graph.check()
            elapsed = time.monotonic() - started
            if elapsed > limit:
                raise GraphError(f"the run has not ended after {limit:.0f} s")
            progress(min(elapsed / usual, 0.97))
            time.sleep(POLL)
        graph.check(ended=("plant",))
    return time.monotonic() - started
