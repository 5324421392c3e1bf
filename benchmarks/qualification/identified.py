"""The proof of `qualify`: python -m benchmarks.qualification.identified [--model TABLE] [--seeds N] [--save].

The table bergamo with the thesis's soft zone, a specimen of 200 kg of which 150 kg sway at 6 Hz (3 %), the noise of its
sensors, commands one sample late. AC156 at 0.6, RG 1.60 at 0.8 and a user's spectrum at 2 % damping at 0.7 of their
levels are run, at most four runs each, motion and noise of each seed, under three models: that of --model, such as
--identify DIR finds by `close_loop` in two recordings made under gains that know nothing of the table; the table
itself; and the table as it is declared, without closing the loop. Each line: seeds that passed, runs of each, largest
and largest mean TRS/RRS of the last runs, processor time of a seed, and why a test did not pass.
--save writes benchmarks/qualification/identified.txt.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import shake_ros as sr
from shake_ros.core.plant.parameters import TableParameters
from shake_ros.core.quantities import ShakeError
from shake_ros.settings import load_table

HIDDEN = {
    "effects.soft_zone.depth": 0.84,
    "effects.specimen_resonance.mass": 150.0,
    "effects.specimen_resonance.frequency": 6.0,
    "effects.specimen_resonance.damping": 0.03,
    "body.specimen_mass": 200.0,
}
CASES = (("ac156", 0.6), ("rg_1_60", 0.8), ("points", 0.7))
LEARNT, HELD = ("demo_excitation", "earthquake_stiff_soil"), "earthquake_rock"
RUNS, LATE = 4, 1


def plant() -> TableParameters:
    """The table with what its configuration does not tell."""
    return load_table("bergamo").with_values(HIDDEN)


def identify(folder: Path) -> None:
    """What close_loop finds, into a folder."""
    runs = []
    for number, reference in enumerate((*LEARNT, HELD)):
        run = sr.simulate(plant(), reference, delay=LATE, seed=90 + number).write(folder / "recordings" / reference)
        runs.append(run)
    began = time.process_time()
    found = sr.close_loop(sr.model("full", table="bergamo"), estimation=sr.read(*runs[:2]), validation=sr.read(runs[2]))
    print(found)
    print(f"{time.process_time() - began:.0f} s of processor time")
    found.report(folder / "loop")


def tested(required: str, scale: float, model: TableParameters, seeds: int) -> str:
    """The line of a spectrum."""
    passed, runs, largest, mean, reasons, began = 0, [], [], [], set(), time.process_time()
    for seed in range(seeds):
        try:
            found = sr.qualify(
                required, plant(), model=model, scale=scale, seed=seed, runs=RUNS, delay=LATE, progress=False
            )
        except ShakeError as error:
            reasons.add(str(error))
            continue
        passed += found.passed
        runs.append(len(found.runs))
        ratio = found.judgement.ratio
        largest.append(float(ratio.max()))
        mean.append(float(ratio.mean()))
        if not found.passed:
            reasons.add((found.reason or found.moved).split(";")[0])
    spent = (time.process_time() - began) / seeds
    spread = f"{max(largest):5.2f} {max(mean):5.2f}" if largest else "    –     –"
    text = f"{required:8s} x {scale:g}  {passed:2d} of {seeds:2d}  runs {runs}  TRS/RRS {spread}  {spent:4.0f} s"
    return "  ".join([text, *sorted(reasons)])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--identify", metavar="DIR", type=Path)
    parser.add_argument("--model", metavar="TABLE")
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--save", action="store_true")
    given = parser.parse_args()
    if given.identify is not None:
        identify(given.identify)
        return
    declared, exact = load_table("bergamo"), plant().with_values({"effects.command_delay.delay": 1e-3 * LATE})
    models = {"identified": load_table(given.model)} if given.model else {}
    lines = []
    for name, model in {**models, "exact": exact, "declared": declared}.items():
        for required, scale in CASES:
            lines.append(f"{name:10s}  {tested(required, scale, model, given.seeds)}")
            print(lines[-1], flush=True)
            if given.save:
                Path(__file__).with_suffix(".txt").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
