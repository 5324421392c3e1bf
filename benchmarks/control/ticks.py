"""Processor time of a tick: python -m benchmarks.control.ticks

One loop as the nodes step it, on a simulated table under an earthquake of 3 m/s²: each observer that carries the table,
each law that `tune` makes under its virtual table, both predicting through 5 ms of dead time, and the load that is
followed. The time of the thread, so that other work on the machine does not count; a sample of 1 kHz has 1000 µs, which
observer and controller have each to themselves in processes of their own, and share in one (`lab --composed`).
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np

from shake_ros.control.laws import CONTROLLERS
from shake_ros.control.laws.runner import Controller
from shake_ros.control.linear_loop import LAWS
from shake_ros.control.observer import OBSERVERS
from shake_ros.control.observer.law import work
from shake_ros.control.observer.load import LoadTracker, LoadTracking, track
from shake_ros.control.observer.runner import Observer
from shake_ros.physics.plant.table import Table
from shake_ros.recordings.reference_file import build_program
from shake_ros.settings import find, load_table, load_variant, read_yaml

DT, SAMPLES, FIRST = 1e-3, 3000, 500  # the first samples compile
DELAY = 5e-3  # [s]
SEERS = ("model", "fused")


def loop_of(law: str, seer: str) -> tuple[Observer, Controller]:
    """A law's tuned configuration under the table's model, and an observer, both predicting."""
    model = load_table("bergamo")
    kind, parameters = load_variant("controller", f"{law}_tuned", CONTROLLERS)
    predicting = {"loop_delay": DELAY, "predict": True}
    own = Controller(kind, parameters.replace(model="bergamo", **predicting), DT, model)
    name, numbers = load_variant("observer", seer, OBSERVERS)
    return Observer(name, numbers.replace(**predicting), DT, model), own


def timed(law: str, seer: str) -> np.ndarray:
    """Processor time of observer, law and load tracker at each sample, (n, 3) [µs]."""
    observer, controller = loop_of(law, seer)
    path = find("load", "default")
    tracker = LoadTracker(LoadTracking.from_mapping(read_yaml(path), str(path)), load_table("bergamo"), DT, DELAY)
    followed, copies, space = tracker.initial_state(), tracker.model.copy(), work()
    table = Table(load_table("bergamo"), DT, seed=1)
    program, waiting = build_program("earthquake", DT), [0.0] * round(DELAY / DT)
    plant, state, seen, u = table.initial_state(0.0), controller.initial_state(), observer.initial_state(0.0), 0.0
    found = np.empty((SAMPLES, 3))
    for k in range(SAMPLES):
        m = table.measure(plant, k)
        times = [time.thread_time_ns()]
        seen, estimate = observer.step(seen, m.position, u, (m.acceleration, m.pressure_a, m.pressure_b))
        times.append(time.thread_time_ns())
        before = u
        state, u = controller.step(state, program.at(k), estimate)
        times.append(time.thread_time_ns())
        track(followed, tracker.fixed, copies, m.position, m.acceleration, before, space)
        times.append(time.thread_time_ns())
        found[k] = 1e-3 * np.diff(times)
        waiting.append(u)
        plant = table.advance(plant, waiting.pop(0))
    return found[FIRST:]


def line_of(name: str, times: np.ndarray) -> str:
    """A line of the table."""
    return f"{name:34s}{np.median(times):10.0f}{np.percentile(times, 99.0):10.0f}{np.max(times):10.0f}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--save", action="store_true", help="write ticks.txt")
    given = parser.parse_args()
    lines = [f"{'processor time of a tick [us]':34s}{'median':>10s}{'99 %':>10s}{'largest':>10s}"]
    for seer in SEERS:
        times = timed("three_variable", seer)
        lines.append(line_of(f"observer {seer}", times[:, 0]))
    lines.append(line_of("load that is followed", times[:, 2]))
    lines += [line_of(f"controller {law}", timed(law, "model")[:, 1]) for law in LAWS]
    print("\n".join(lines))
    if given.save:
        Path(__file__).with_suffix(".txt").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
