"""Tracking of the closed loop on tables with hidden effects: python -m benchmarks.control.tracking [--save].

Table bergamo with 200 kg and one effect each; position with 8 µm of noise and 16 bits over 300 mm, one sample of
delay. For each reference and effect: normalised root mean square error of position, velocity, acceleration in percent
with (a) the thesis's super-twisting gains, (b) the re-tuned ones, (c) these under the virtual table of the declared
model, (d) under that of the true model, both with the observer that carries the same model. --save writes
benchmarks/control/tracking.txt.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

from shake_ros.control.closed_loop import Loop, run_batch
from shake_ros.control.laws import CONTROLLERS
from shake_ros.control.laws.runner import Controller
from shake_ros.control.observer import OBSERVERS
from shake_ros.control.observer.runner import Observer
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.recordings.reference_file import build_program
from shake_ros.settings import load_table, load_variant

SAMPLE_TIME = 0.001
LONGEST = 6000
REFERENCES = {"earthquake": 0, "sine_20mm_2hz": 1000}  # name → first sample that counts
EFFECTS: dict[str, dict[str, float]] = {
    "none": {},
    "spool_deadband": {"effects.spool_deadband.width": 0.03},
    "valve_null_shift": {"effects.valve_null_shift.offset": 0.03},
    "asymmetric_flow_gain": {"effects.asymmetric_flow_gain.asymmetry": 0.2},
    "slow_valve": {"effects.slow_valve.slowdown": 0.6},
    "supply_droop": {"effects.supply_droop.resistance": 2e10},
    "soft_zone": {"effects.soft_zone.depth": 0.8},
    "payload_error": {"effects.payload_error.mass": 300.0},
    "specimen_resonance": {"effects.specimen_resonance.mass": 150.0, "effects.specimen_resonance.frequency": 8.0},
    "command_delay": {"effects.command_delay.delay": 0.004},
}


def observer(name: str, model: TableParameters | None = None) -> Observer:
    """The observer of a configuration."""
    kind, parameters = load_variant("observer", name, OBSERVERS)
    return Observer(kind, parameters, SAMPLE_TIME, model)


def controller(name: str, model: TableParameters | None = None) -> Controller:
    """The controller of a configuration."""
    kind, parameters = load_variant("controller", name, CONTROLLERS)
    return Controller(kind, parameters, SAMPLE_TIME, model)


def rows() -> list[str]:
    """The table of figures, line by line."""
    declared = load_table("bergamo")
    lines = [
        f"{'reference':14s} {'hidden effect':21s}"
        + "".join(f"{c:>21s}" for c in ("printed", "tuned", "declared", "true"))
    ]
    for reference, first in REFERENCES.items():
        program = build_program(reference, SAMPLE_TIME)
        samples = min(program.length, LONGEST)
        for effect, values in EFFECTS.items():
            truth = declared.with_values(values)
            pairs = (
                (observer("linear_bergamo"), controller("super_twisting")),
                (observer("linear_bergamo"), controller("super_twisting_tuned")),
                (observer("model", declared), controller("super_twisting_tuned", declared)),
                (observer("model", truth), controller("super_twisting_tuned", truth)),
            )
            states = program.samples(0, samples)
            loops = [Loop(truth, estimator, law, states, seed=3, delay=1) for estimator, law in pairs]
            line = f"{reference:14s} {effect:21s}"
            for run in run_batch(loops, lambda _, run: run):
                x, v, a = 100.0 * run.tracking_error(first)
                line += f"   {x:5.2f} {v:5.2f} {a:5.1f}"
            lines.append(line)
            print(line, flush=True)
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--save", action="store_true")
    arguments = parser.parse_args()
    began = time.perf_counter()
    lines = rows()
    lines.append(f"in {time.perf_counter() - began:.0f} s")
    if arguments.save:
        Path(__file__).with_suffix(".txt").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
