"""Do the standard errors cover the truth? python benchmarks/interval_coverage.py [--seeds 100]

Fits the declared model to short recordings of tables that lack nothing, made by benchmarks/hidden_tables.py, one table
and one noise per seed, and counts how often the 90 % interval (value ± 1.645 standard errors) holds the true value.
A parameter at a bound has no standard error and is counted apart. Wanted: 80 to 97 %. The fit starts from the truth, so
that what is looked at is the interval and not the search. The friction of the other simulator saturates over a width
that takes as much off near rest as the declared tanh(v/(1 mm/s)) does, so that the truth lies within the model;
`--saturation 0.0007` shows what a wrong width does to the friction's parameters. `--own` makes the data with the
package's own simulator: then
no difference between simulators is in it.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT), str(ROOT / "benchmarks")]

import hidden_tables as hidden  # noqa: E402

from shake_ros.cli.fitting import declared_parameters  # noqa: E402
from shake_ros.core.identification.fit import fit  # noqa: E402
from shake_ros.core.identification.free_parameters import FreeParameters  # noqa: E402
from shake_ros.core.identification.recordings import Record, RecordingProblem  # noqa: E402
from shake_ros.core.identification.uncertainty import Estimate, estimates  # noqa: E402
from shake_ros.core.plant.parameters import TableParameters  # noqa: E402
from shake_ros.core.plant.simulation import run  # noqa: E402
from shake_ros.settings import load_table  # noqa: E402

SAME_DEFICIT = 2.0 * 0.693 * 1e-3  # ∫(1 − v/w) dv = ∫(1 − tanh(v/(1 mm/s))) dv for this width w [m/s]
QUANTILE = 1.645  # of the 90 % interval
TRUE_FIELD = {
    "friction.coulomb_level": "coulomb",
    "friction.stribeck_rise": "rise",
    "friction.stribeck_decay": "decay",
    "friction.viscous": "viscous",
    "bulk_modulus.modulus": "modulus",
    "leakage.internal": "internal",
    "leakage.external": "external",
    "valve.flow_coefficient": "flow",
}


def true_table(truth: hidden.Truth) -> TableParameters:
    """The package's table with the true values."""
    return load_table("bergamo").with_values({n: getattr(truth, f) for n, f in TRUE_FIELD.items()})


def own_record(name: str, table: TableParameters, commands: np.ndarray, seed: int) -> Record:
    """A recording by the package's own simulator, under commands that kept the independent table centred."""
    rng = np.random.default_rng(seed)
    out = run(table, commands, hidden.SAMPLE)
    position = out[:, 0] + hidden.POSITION_NOISE * rng.standard_normal(len(commands))
    position = np.round(position / hidden.POSITION_STEP) * hidden.POSITION_STEP
    acceleration = out[:, 2] + hidden.ACCELERATION_NOISE * rng.standard_normal(len(commands))
    return Record(name, hidden.SAMPLE, commands, position, acceleration)


def fitted(seed: int, length: float, own: bool, saturation: float) -> tuple[hidden.Truth, list[Estimate]]:
    """Truth and estimates of one seed."""
    truth = hidden.declared_truth(seed)._replace(saturation=saturation)
    rng = np.random.default_rng(seed)
    records = []
    for name, excitation in hidden.excitations(seed, length).items():
        if not name.startswith("learn"):
            continue
        made = hidden.record(truth, excitation, 1.0, rng)
        if own:
            records.append(own_record(name, true_table(truth), made["command"], seed + len(name)))
        else:
            records.append(Record(name, hidden.SAMPLE, made["command"], made["position"], made["acceleration"]))
    problem = RecordingProblem(records)
    free = FreeParameters(true_table(truth), declared_parameters("full"))
    result = fit(problem, free, free.start(), evaluations=20, tolerance=1e-6)
    return truth, estimates(result, problem.blocks())


def main() -> None:
    """Run all seeds and print the coverage of each parameter."""
    command = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    command.add_argument("--seeds", type=int, default=100)
    command.add_argument("--length", type=float, default=1.0, help="scale of the recordings' durations")
    command.add_argument(
        "--saturation", type=float, default=SAME_DEFICIT, help="width of the data's dry friction [m/s]"
    )
    command.add_argument("--own", action="store_true", help="data of the package's own simulator")
    given = command.parse_args()
    scores: dict[str, list[float]] = {name: [] for name in TRUE_FIELD}
    errors: dict[str, list[float]] = {name: [] for name in TRUE_FIELD}
    start = time.perf_counter()
    for seed in range(given.seeds):
        truth, found = fitted(seed, given.length, given.own, given.saturation)
        for e in found:
            true = float(getattr(truth, TRUE_FIELD[e.name]))
            if e.std_error:
                scores[e.name].append((e.value - true) / e.std_error)
                errors[e.name].append((e.value - true) / true)
    print(f"{given.seeds} seeds, {time.perf_counter() - start:.0f} s")
    print(f"{'parameter':28} {'cover':>6}  {'cases':>5}  {'mean score':>10}  {'rms score':>9}  {'rms rel. error':>14}")
    for name, values in scores.items():
        z, relative = np.array(values), np.array(errors[name])
        cover = 100.0 * np.mean(np.abs(z) < QUANTILE)
        row = f"{cover:5.1f}%  {len(z):5d}  {np.mean(z):10.2f}  {np.sqrt(np.mean(z**2)):9.2f}"
        print(f"{name:28} {row}  {np.sqrt(np.mean(relative**2)):14.5f}")


if __name__ == "__main__":
    main()
