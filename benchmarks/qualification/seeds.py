"""Qualification on a table that is not as declared: python -m benchmarks.qualification.seeds [--seeds 10] [--save].

The table bergamo with the thesis's soft zone, a specimen of 200 kg on 6 Hz (5 % damping), sensor noise and commands one
sample late. The model is fitted to two recordings (an earthquake and a sweep in closed loop), with the effects that
`close_loop` finds there named. Each line: required spectrum, seed of phases and noise, runs until the TRS passes (at
most 4), mean and largest TRS/RRS of the last run, time. Then the same with the model as declared. --save writes
benchmarks/qualification/seeds.txt.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np

import shake_ros as sr
from shake_ros.core.identification.recordings import Record
from shake_ros.core.iteration.model import refit
from shake_ros.core.plant.parameters import TableParameters
from shake_ros.core.quantities import ShakeError
from shake_ros.declared import effect_candidates, free_parameters
from shake_ros.settings import find, load_table, read_yaml, save_table

SPECTRA = ("ac156", "rg_1_60", "points")
EFFECTS = ("soft_zone", "specimen_resonance", "command_delay")
RUNS, LATE = 4, 1
PLANT = {
    "body.specimen_mass": 200.0,
    "effects.soft_zone.depth": 0.84,
    "effects.specimen_resonance.mass": 200.0,
    "effects.specimen_resonance.frequency": 6.0,
    "effects.specimen_resonance.damping": 0.05,
}


def identified(plant: TableParameters) -> TableParameters:
    """The declared model fitted to two recordings of the plant."""
    records = []
    for seed, reference in enumerate(("earthquake_stiff_soil", "sweep")):
        run = sr.simulate(plant, reference, delay=LATE, seed=100 + seed, observer="linear_soft_zone").recording
        records.append(Record(reference, run.sample_time, run.valve_command, run.position, run.acceleration))
    chosen = [c for c in effect_candidates() if c.effect in EFFECTS]
    return refit(load_table("bergamo"), free_parameters(), chosen, records)


def row(name: str, seed: int, plant: TableParameters, model: TableParameters, settings: str) -> tuple[str, bool]:
    began = time.perf_counter()
    try:
        test = sr.qualify(name, plant, model=model, runs=RUNS, seed=seed, delay=LATE, settings=settings, progress=False)
    except ShakeError as error:
        return f"{name:8s} {seed:4d}  {error}", False
    ratio, spent = test.judgement.ratio, time.perf_counter() - began
    text = f"{name:8s} {seed:4d}  {'passed' if test.passed else 'failed'} {len(test.runs):4d}"
    text += f"  {ratio.min():6.3f} {ratio.mean():6.3f} {ratio.max():7.3f} {spent:7.0f}  {test.reason}"
    return text, test.passed


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--save", action="store_true")
    parser.add_argument("--work", type=Path, default=Path("out"), help="folder for the model and settings")
    given = parser.parse_args()
    given.work.mkdir(parents=True, exist_ok=True)
    content = read_yaml(find("qualification", "default"))
    content["search"]["level"] = 0.0
    settings = given.work / "without_search.yaml"
    settings.write_text(str(content).replace("'", '"'), encoding="utf-8")
    plant = load_table("bergamo").with_values(PLANT)
    began = time.perf_counter()
    model = identified(plant)
    (given.work / "model.yaml").unlink(missing_ok=True)
    save_table(given.work / "model.yaml", model, "Fitted to two recordings.")
    told = {name: model.value(name) for name in (*PLANT, "effects.command_delay.delay", "bulk_modulus.modulus")}
    lines = [
        f"model fitted in {time.perf_counter() - began:.0f} s: {', '.join(f'{k} {v:.4g}' for k, v in told.items())}"
    ]
    lines.append("spectrum seed  verdict runs  lowest   mean largest TRS/RRS, time [s]")
    print("\n".join(lines), flush=True)
    counts = dict.fromkeys(SPECTRA, 0)

    def tell(text: str) -> None:
        lines.append(text)
        print(text, flush=True)
        if given.save:
            Path(__file__).with_suffix(".txt").write_text("\n".join(lines) + "\n", encoding="utf-8")

    for seed in range(given.seeds):
        for name in SPECTRA:
            text, passed = row(name, seed, plant, model, str(settings))
            counts[name] += passed
            tell(text)
    tell(", ".join(f"{name}: {count} of {given.seeds} passed" for name, count in counts.items()))
    tell("model as declared, loop not closed:")
    for name in SPECTRA:
        tell(row(name, 0, plant, load_table("bergamo"), str(settings))[0])
    assert np.isfinite(model.vector()).all()


if __name__ == "__main__":
    main()
