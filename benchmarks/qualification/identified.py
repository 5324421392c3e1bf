"""The proof of `qualify`: python -m benchmarks.qualification.identified [--model TABLE] [--kept FILE].

The table bergamo with the thesis's soft zone, a specimen of 200 kg of which 150 kg sway at 6 Hz (3 %), the noise of its
sensors, commands one sample late. AC156 at 0.6, RG 1.60 at 0.8 and a user's spectrum at 2 % damping at 0.7 of their
levels are run, at most four runs each, motion and noise of each seed, under three models: that of --model, such as
--identify DIR finds by `close_loop` in two recordings made under gains that know nothing of the table; the table
itself; and the table as it is declared, without closing the loop. Each line: seeds that passed, runs of each, largest
and largest mean TRS/RRS of the last runs, processor time of a seed, and why a test did not pass.
--kept FILE keeps each test as it ends; a second call goes on where the first was cut off. --save writes
benchmarks/qualification/identified.txt.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from pathlib import Path
from typing import Any

import shake_ros as sr
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.quantities import ShakeError
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
MODELS = "identified", "exact", "declared"


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


def tested(required: str, scale: float, model: TableParameters, seed: int) -> dict[str, Any]:
    """What one test came to."""
    began = time.process_time()
    row: dict[str, Any] = {"passed": False, "runs": 0, "largest": math.nan, "mean": math.nan}
    try:
        found = sr.qualify(
            required, plant(), model=model, scale=scale, seed=seed, runs=RUNS, delay=LATE, progress=False
        )
    except ShakeError as error:
        row["why"] = str(error)
    else:
        ratio = found.assessment.ratio
        row |= {"passed": found.passed, "runs": len(found.runs)}
        row |= {"largest": float(ratio.max()), "mean": float(ratio.mean())}
        row["why"] = "" if found.passed else (found.reason or found.moved).split(";")[0]
    return {**row, "seconds": time.process_time() - began}


def line(name: str, required: str, scale: float, rows: list[dict[str, Any]]) -> str:
    """The line of a model and a spectrum."""
    runs = " ".join(str(row["runs"]) for row in rows)
    largest, mean = (max(row[key] for row in rows) for key in ("largest", "mean"))
    passed, spent = sum(row["passed"] for row in rows), sum(row["seconds"] for row in rows) / len(rows)
    text = f"{name:10s}  {required:8s} x {scale:g}  {passed:2d} of {len(rows):2d}  runs {runs:20s}"
    return "  ".join([f"{text}  TRS/RRS {largest:5.2f} {mean:5.2f}  {spent:4.0f} s", *sorted({r["why"] for r in rows})])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--identify", metavar="DIR", type=Path)
    parser.add_argument("--model", metavar="TABLE")
    parser.add_argument("--models", nargs="+", default=list(MODELS), choices=MODELS)
    parser.add_argument("--seeds", nargs="+", type=int, default=[10], help="of all models, or one number for each")
    parser.add_argument("--kept", metavar="FILE", type=Path)
    parser.add_argument("--save", action="store_true")
    given = parser.parse_args()
    if given.identify is not None:
        identify(given.identify)
        return
    declared, exact = load_table("bergamo"), plant().with_values({"effects.command_delay.delay": 1e-3 * LATE})
    if given.model is None and "identified" in given.models:
        parser.error("give --model TABLE, as --identify DIR leaves it in DIR/loop, or --models exact declared")
    models = {"exact": exact, "declared": declared}
    if given.model is not None:
        models["identified"] = load_table(given.model)
    kept = json.loads(given.kept.read_text(encoding="utf-8")) if given.kept and given.kept.exists() else {}
    lines = []
    for place, name in enumerate(given.models):
        model, seeds = models[name], given.seeds[min(place, len(given.seeds) - 1)]
        for required, scale in CASES:
            for seed in range(seeds):
                key = f"{name} {required} {seed}"
                kept[key] = kept.get(key) or tested(required, scale, model, seed)
                if given.kept:
                    given.kept.write_text(json.dumps(kept, indent=1), encoding="utf-8")
            rows = [kept[f"{name} {required} {seed}"] for seed in range(seeds)]
            lines.append(line(name, required, scale, rows))
            print(lines[-1], flush=True)
            if given.save:
                Path(__file__).with_suffix(".txt").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
