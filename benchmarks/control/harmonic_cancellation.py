"""Harmonic cancellation of the 2 Hz sine of 20 mm: python -m benchmarks.control.harmonic_cancellation [--save].

THD of the true acceleration by `signals.thd` in windows of 4 s, orders to 25 and, in the last one, to 100, with
the fundamental's amplitude over the wanted one. Position with 8 µm of noise and 16 bits over 300 mm, accelerometer with
noise, commands one sample late; config/harmonic_cancellation.yaml, switched on from the start. Tables: the one
fitted to the runs measured on the real table (`bergamo_measured`, which distorts the sine about as that one does) with
three loads; the declared one with the thesis's soft zone; the declared one with soft zone, dead band and more friction.
--save writes benchmarks/control/harmonic_cancellation.txt.
"""

from __future__ import annotations

import argparse
import math
import time
from pathlib import Path

import numpy as np

from shake_ros.control.closed_loop import ClosedLoop, Loop, run_batch
from shake_ros.control.laws import CONTROLLERS
from shake_ros.control.laws.harmonic_cancellation import HarmonicCancellation
from shake_ros.control.laws.runner import Controller
from shake_ros.control.metrics import distortion
from shake_ros.control.observer import OBSERVERS
from shake_ros.control.observer.runner import Observer
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.settings import find, load_table, load_variant, read_yaml
from shake_ros.signals.thd import harmonics

SAMPLE_TIME, LATE, SECONDS, WINDOW = 0.001, 1, 84.0, 4.0
FREQUENCY, AMPLITUDE, MANY = 2.0, 0.02, 100
SHOWN = (8.0, 16.0, 24.0, 32.0, 40.0, 48.0, 56.0, 64.0, 80.0)
LOOPS = {
    "feedforward PI": ("feedforward_pi", "linear_bergamo"),
    "super-twisting": ("super_twisting_soft_zone", "linear_soft_zone"),
}


def sine(amplitude: float, seconds: float) -> np.ndarray:
    """The sine with a smooth start of 1 s, (n, 3)."""
    time = np.arange(round(seconds / SAMPLE_TIME)) * SAMPLE_TIME
    start = np.clip(time, 0.0, 1.0)
    start = start * start * (3.0 - 2.0 * start)
    omega = 2.0 * math.pi * FREQUENCY
    wave = np.column_stack([np.sin(omega * time), omega * np.cos(omega * time), -(omega**2) * np.sin(omega * time)])
    return np.asarray(amplitude * wave * start[:, None])


def cases() -> list[tuple[str, TableParameters, str, float]]:
    """(name, table, loop, amplitude [m])."""
    measured, declared = load_table("bergamo_measured"), load_table("bergamo")
    values = read_yaml(find("compare", "default"))["values"]
    rough = {"effects.spool_deadband.width": 0.06, "friction.coulomb_level": 400.0, "friction.stribeck_rise": 300.0}
    loads = [(f"measured, {load:.0f} kg", measured.with_values({"body.specimen_mass": load})) for load in (0, 200, 500)]
    tables = [*loads, ("soft zone", declared.with_values(values)), ("rough", declared.with_values({**values, **rough}))]
    found = [(name, table, "feedforward PI", AMPLITUDE) for name, table in tables]
    found += [(f"{name}, 15 mm", table, "feedforward PI", 0.015) for name, table in loads[1:2]]
    found += [(name, table, "super-twisting", AMPLITUDE) for name, table in loads[1:2]]
    return found


def loop(table: TableParameters, name: str, amplitude: float, cancellation: HarmonicCancellation | None) -> Loop:
    """The loop with or without cancellation."""
    law, estimator = LOOPS[name]
    controller = Controller(*load_variant("controller", law, CONTROLLERS), SAMPLE_TIME)
    observer = Observer(*load_variant("observer", estimator, OBSERVERS), SAMPLE_TIME)
    seconds = 12.0 if cancellation is None else SECONDS
    return Loop(table, observer, controller, sine(amplitude, seconds), delay=LATE, cancellation=cancellation)


def window(run: ClosedLoop, begin: float) -> np.ndarray:
    """The true acceleration of a window."""
    first = round(begin / SAMPLE_TIME)
    return run.truth[first : first + round(WINDOW / SAMPLE_TIME), 2]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--save", action="store_true")
    arguments = parser.parse_args()
    began = time.perf_counter()
    path = find("harmonic_cancellation", "default")
    settings = HarmonicCancellation.from_mapping(read_yaml(path), str(path))
    wanted = cases()

    def judge(i: int, run: ClosedLoop) -> str:
        amplitude = wanted[i][3] * (2.0 * math.pi * FREQUENCY) ** 2
        found = [100.0 * distortion(window(run, begin), FREQUENCY, SAMPLE_TIME) for begin in SHOWN]
        last = window(run, SHOWN[-1])
        many = harmonics(np.arange(len(last)) * SAMPLE_TIME, last, FREQUENCY, MANY)
        text = "".join(f"{thd:6.1f}" for thd in found)
        return f"{text}   {100.0 * many.thd:6.1f}   {many.amplitude[0] / amplitude:6.3f}"

    without = run_batch(
        [loop(table, law, size, None) for _, table, law, size in wanted],
        lambda i, run: 100.0 * distortion(window(run, 8.0), FREQUENCY, SAMPLE_TIME),
    )
    with_it = run_batch([loop(table, law, size, settings) for _, table, law, size in wanted], judge)
    head = f"{'table':24s} {'law':15s} {'without':>8s}" + "".join(f"{f'{b:.0f} s':>6s}" for b in SHOWN)
    lines = [head + f"   {'to 100':>6s}   {'fund.':>6s}"]
    for (name, _, law, _), before, text in zip(wanted, without, with_it, strict=True):
        lines.append(f"{name:24s} {law:15s} {before:8.1f}{text}")
    lines.append(f"THD [%]; in {time.perf_counter() - began:.0f} s")
    print("\n".join(lines))
    if arguments.save:
        Path(__file__).with_suffix(".txt").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
