"""What each sensor buys, and what the loss of one costs: python -m benchmarks.control.sensors

The truth is benchmarks.discovery.hidden_tables, an independent simulator, with more than the model knows: friction
200 N above the model's, oil 15 % softer, 120 kg of the specimen's 200 on 7 Hz. Model and law (three-variable, made by
`tune` for the model) are the same in every row, only the observer differs: `model`, which takes the position alone, and
`fused` with the sensors that the row names. The last rows raise the gain of the position by a factor and give the
acceleration the gain that adds a damping ratio to the oil column. Sensors: 8 µm of noise in steps of 4.6 µm;
accelerometer with 0.05 m/s², a bias of 0.2 m/s² that the model does not know and a lag of 2 ms that it knows; chamber
pressures with 0.2 bar. An earthquake of 3 m/s² with one sample of delay, after two seconds of rest. Errors are rms
errors over that of the reference (tracking) or of the motion (estimate), in per cent; `after` counts from the loss of
the sensor, or from its time in rows without one, to the end of the motion. The last column is the largest ringing
(control.metrics).
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.control.hidden_loop import closed_loop
from benchmarks.discovery import hidden_tables as hidden
from shake_ros.api.tune_table import TunedTable, tune_table
from shake_ros.control.closed_loop import ClosedLoop
from shake_ros.control.laws.runner import Controller
from shake_ros.control.laws.three_variable import ThreeVariable
from shake_ros.control.metrics import SETTLING, come_to_rest, ringing, settle_first
from shake_ros.control.observer import OBSERVERS
from shake_ros.control.observer.model import ModelObserver
from shake_ros.control.observer.runner import Observer
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.recordings.reference_file import build_program
from shake_ros.settings import load_table, load_variant

SECONDS, LOST_AT = 8.0, 4.0  # [s] of the earthquake
LAG, BIAS = 0.002, 0.2  # [s], [m/s²] of the accelerometer
PRESSURE_NOISE = 2e4  # [Pa]
ACCELEROMETER, PRESSURES = (0,), (1, 2)
BOTH = (*ACCELEROMETER, *PRESSURES)


class Row(NamedTuple):
    """Sensors beside the position, and what becomes of some of them at LOST_AT: NaN, held or wild.

    faster : factor on the gain of the position. damping : ratio that the acceleration adds to the oil column; zero for
    the gains that `tune` made.
    """

    name: str
    sensors: tuple[int, ...]
    failing: tuple[int, ...] = ()
    how: str = ""
    faster: float = 1.0
    damping: float = 0.0


ROWS = (
    Row("position", ()),
    Row("and accelerometer", ACCELEROMETER),
    Row("and pressures", PRESSURES),
    Row("and both", BOTH),
    Row("both, accelerometer lost", BOTH, ACCELEROMETER, "lost"),
    Row("both, accelerometer frozen", BOTH, ACCELEROMETER, "frozen"),
    Row("both, accelerometer wild", BOTH, ACCELEROMETER, "wild"),
    Row("both, pressures lost", BOTH, PRESSURES, "lost"),
    Row("accelerometer, lost", ACCELEROMETER, ACCELEROMETER, "lost"),
    Row("position, gains x 2, 0.6", (), faster=2.0, damping=0.6),
    Row("accelerometer, x 2, 0.6", ACCELEROMETER, faster=2.0, damping=0.6),
    Row("pressures, x 2, 0.6", PRESSURES, faster=2.0, damping=0.6),
    Row("both, x 2, 0.6", BOTH, faster=2.0, damping=0.6),
    Row("position, gains x 4, 1.2", (), faster=4.0, damping=1.2),
    Row("accelerometer, x 4, 1.2", ACCELEROMETER, faster=4.0, damping=1.2),
    Row("pressures, x 4, 1.2", PRESSURES, faster=4.0, damping=1.2),
    Row("both, x 4, 1.2", BOTH, faster=4.0, damping=1.2),
    Row("  accelerometer lost", BOTH, ACCELEROMETER, "lost", 4.0, 1.2),
)


def model_and_truth() -> tuple[TableParameters, hidden.Truth]:
    """What is known, and what is."""
    own = hidden.declared_truth(1)
    known = {name: getattr(own, there) for name, there in hidden.DECLARED.items()}
    model = load_table("bergamo").with_values(known | {"effects.accelerometer_lag.time_constant": LAG})
    truth = own._replace(
        coulomb=own.coulomb + 200.0, modulus=0.85 * own.modulus, specimen_resonance=120.0, accelerometer_lag=LAG
    )
    return model, truth


def fused(position_only: ModelObserver, model: TableParameters) -> Observer:
    """config/observer/fused.yaml with the β and the dead time of the observer that `tune` made."""
    kind, parameters = load_variant("observer", "fused", OBSERVERS)
    names = ("beta1", "beta2", "beta3", "beta4", "beta5", "loop_delay", "predict")
    same = {name: getattr(position_only, name) for name in names}
    return Observer(kind, parameters.replace(**same), hidden.SAMPLE, model)


def law_of(row: Row, tuned: TunedTable) -> Controller:
    """Three-variable control with the gains of a row."""
    law = tuned.loop()[1]
    given = tuned.best.parameters
    if not row.damping or not isinstance(given, ThreeVariable):
        return law
    beta = tuned.observer
    gain = row.faster * given.feedback_displacement
    damped = 2.0 * row.damping * math.sqrt(-beta.beta1) / beta.beta3
    return Controller(
        law.kind,
        given.replace(
            feedback_displacement=gain,
            reference_displacement=gain,
            feedback_acceleration=damped,
            reference_acceleration=damped,
        ),
        law.sample_time,
        tuned.table,
    )


def noise_of(row: Row, samples: int, seed: int) -> tuple[np.ndarray, int]:
    """Noise of the sensors, and the sample from which the accelerometer repeats itself."""
    rng = np.random.default_rng(seed)
    sizes = hidden.POSITION_NOISE, hidden.ACCELERATION_NOISE, PRESSURE_NOISE, PRESSURE_NOISE
    noise = rng.standard_normal((samples, 4)) * sizes
    lost = round((SETTLING + LOST_AT) / hidden.SAMPLE)
    for column in range(3):
        if column not in row.sensors:
            noise[:, 1 + column] = np.nan
        if column in row.failing and row.how != "frozen":
            wild = 30.0 * rng.standard_normal(samples - lost)
            noise[lost:, 1 + column] = wild if row.how == "wild" else np.nan
    return noise, lost if row.how == "frozen" else samples


def tried(
    row: Row, truth: hidden.Truth, observer: Observer, law: Controller, reference: np.ndarray, seed: int
) -> ClosedLoop:
    """The run behind its rest."""
    noise, frozen_at = noise_of(row, len(reference), seed)
    return closed_loop(truth, observer, law, reference, noise, frozen_at=frozen_at, bias=BIAS).after(SETTLING)


def line_of(name: str, runs: list[ClosedLoop], ahead: int) -> str:
    """A line of the table: the worst of the seeds."""
    lost = round(LOST_AT / hidden.SAMPLE)
    last = round(SECONDS / hidden.SAMPLE)
    whole = 100.0 * np.max([r.tracking_error() for r in runs], axis=0)
    after = []
    for r in runs:
        part = slice(lost, last)
        away = r.truth[part] - r.reference[part]
        after.append(100.0 * np.sqrt(np.mean(away**2, axis=0) / np.mean(r.reference**2, axis=0)))
    seen = []
    for r in runs:
        truth, estimate = r.truth[ahead:], r.estimate[: len(r.estimate) - ahead]
        seen.append(100.0 * np.sqrt(np.mean((estimate - truth) ** 2, axis=0) / np.mean(truth**2, axis=0)))
    shaken = max(ringing(r) for r in runs)
    cells = "".join(f"{x:8.2f}{v:7.2f}{a:7.1f}  " for x, v, a in (whole, np.max(after, axis=0), np.max(seen, axis=0)))
    return f"{name:30s}{cells}{shaken:7.2f}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=2, metavar="N", help="of the sensors' noise, the worst counts")
    parser.add_argument("--save", action="store_true", help="write sensors.txt")
    given = parser.parse_args()
    model, truth = model_and_truth()
    tuned = tune_table(model, laws=["three_variable"], progress=False)
    alone, _ = tuned.loop()
    rows = build_program("earthquake", hidden.SAMPLE).samples(0, round(SECONDS / hidden.SAMPLE))
    reference = settle_first(come_to_rest(rows, hidden.SAMPLE), hidden.SAMPLE)
    ahead = round(alone.lead / hidden.SAMPLE)
    head = "".join(f"{what + ' x / v / a [%]':>24s}" for what in ("tracking", "after", "estimate"))
    lines = [f"{'sensors':30s}{head}  ringing"]
    print(lines[0])
    own = fused(tuned.observer, model)
    for row, observer in ((Row("position, observer `model`", ()), alone), *((row, own) for row in ROWS)):
        law = law_of(row, tuned)
        runs = [tried(row, truth, observer, law, reference, seed) for seed in range(1, given.seeds + 1)]
        lines.append(line_of(row.name, runs, ahead))
        print(lines[-1], flush=True)
    lines.append(
        f"{tuned.best.kind}, {tuned.best.design.bandwidth:.1f} rad/s, adds a damping ratio of "
        f"{tuned.best.design.damping:g}; {given.seeds} seeds, the worst counts"
    )
    print(lines[-1])
    if given.save:
        Path(__file__).with_suffix(".txt").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
