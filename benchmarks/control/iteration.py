"""Drive-file iteration on a table with the soft zone: python -m benchmarks.control.iteration [--own] [--loads KG …].

The plant of `compare` (table bergamo with the thesis's soft zone; 8 µm of noise and 16 bits over 300 mm, accelerometer
with noise, commands one sample late), three records, one set of gains, and the feedforward with the horizon that `tune`
gives. Each line: true error of the acceleration and largest error of the response spectrum (5 % damping, 0.5 … 15 Hz),
both in percent, run after run. The first run is under the first model; each later one under that which the recording of
the run before gave (`iterate --refit soft_zone command_delay`). Last, a dead band that is not among what may be fitted,
and the same when it is; and the correction of the drive (`iterate` without --refit) under the model that was fitted.
Runs under the exact model that is never refitted show what the sensors' noise alone makes of the loop. --own gives the
loop gains that `tune` makes for the table, as `iterate --simulate` has them; --loads leaves the dead band out. --save
writes benchmarks/control/iteration.txt, with --own iteration_own.txt.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from shake_ros.api.live_table import OwnLoop, own_loop
from shake_ros.control.closed_loop import ClosedLoop, Loop, simulate
from shake_ros.control.laws import CONTROLLERS
from shake_ros.control.laws.runner import Controller
from shake_ros.control.metrics import spectrum_of
from shake_ros.control.observer import OBSERVERS
from shake_ros.control.observer.runner import Observer
from shake_ros.declared import effect_candidates, free_parameters
from shake_ros.fit.records import Record
from shake_ros.iteration.drive import Iteration, iterate, iterate_model, refit
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.recordings.reference_file import build_program
from shake_ros.settings import find, load_table, load_variant, read_yaml

SAMPLE_TIME, LATE, RUNS = 0.001, 1, 3
HORIZON = float(read_yaml(find("robust_tuning", "default"))["numbers"]["model_horizon"])  # [s] of the feedforward
CONTROLLER, OBSERVER = "super_twisting_model", "model_soft_zone"
RECORDS = ("earthquake_soft_soil", "earthquake_stiff_soil", "earthquake_rock")
LOADS = (0.0, 200.0, 500.0)
EFFECTS = ("soft_zone", "command_delay")
DEPTH, DELAY, BAND = "effects.soft_zone.depth", "effects.command_delay.delay", "effects.spool_deadband.width"
SCALED = (
    "bulk_modulus.modulus",
    "valve.flow_coefficient",
    "friction.coulomb_level",
    "friction.stribeck_rise",
    "friction.viscous",
)


Report = Callable[[float, str, str, "Case"], None]


class Case:
    """A table, a record, and what its runs gave."""

    def __init__(self, table: TableParameters, record: str, own: OwnLoop | None = None) -> None:
        self.table, self.own = table, own
        self.reference = np.array(build_program(record, SAMPLE_TIME).states)
        self.aim = spectrum_of(self.reference[:, 2], SAMPLE_TIME)
        self.line = ""

    def run(self, model: TableParameters, reference: np.ndarray, number: int) -> ClosedLoop:
        if self.own:
            observer, controller = self.own.of(model, SAMPLE_TIME, LATE * SAMPLE_TIME)
        else:
            observer = Observer(*load_variant("observer", OBSERVER, OBSERVERS), SAMPLE_TIME, model)
            kind, parameters = load_variant("controller", CONTROLLER, CONTROLLERS)
            controller = Controller(kind, parameters.replace(model_horizon=HORIZON), SAMPLE_TIME, model)
        run, finite = simulate(Loop(self.table, observer, controller, reference, seed=number, delay=LATE))
        if finite < len(reference):
            raise SystemExit(f"run {number + 1} diverged")
        wanted, true = self.reference[:, 2], run.truth[:, 2]
        error = np.sqrt(np.mean((true - wanted) ** 2)) / np.std(wanted)
        off = np.max(np.abs(spectrum_of(true, SAMPLE_TIME) / self.aim - 1.0))
        self.line += f"  {100.0 * error:7.2f} {100.0 * off:7.2f}"
        return run

    def record(self, model: TableParameters, number: int) -> Record:
        run = self.run(model, self.reference, number)
        return Record(f"run {number}", SAMPLE_TIME, run.command, run.measured[:, 0], run.measured[:, 1])


def learnt(case: Case, model: TableParameters, effects: Sequence[str], settings: Iteration) -> TableParameters:
    """The last model of the runs."""
    free = free_parameters()
    chosen = [c for c in effect_candidates() if c.effect in effects]
    models, _, _ = iterate_model(
        case.reference[:, 2], model, case.record, lambda m, records: refit(m, free, chosen, records), settings
    )
    return models[-1]


def models_of(table: TableParameters) -> dict[str, TableParameters]:
    """First models by name, from a table."""
    late = table.with_values({DELAY: LATE * SAMPLE_TIME})

    def scaled(factor: float) -> Mapping[str, float]:
        return {name: factor * table.value(name) for name in SCALED}

    return {
        "declared": table.with_values({DEPTH: 0.0}),
        "exact": late,
        "20 % high": late.with_values(scaled(1.2)),
        "20 % low": late.with_values(scaled(0.8)),
        "depth 0.6": late.with_values({DEPTH: 0.6}),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--own", action="store_true", help="gains made for the table")
    parser.add_argument("--loads", nargs="+", type=float, metavar="KG", help="these loads alone, without the dead band")
    parser.add_argument("--save", action="store_true")
    arguments = parser.parse_args()
    began = time.perf_counter()
    path = find("iteration", "default")
    settings = Iteration.from_mapping(read_yaml(path), str(path)).replace(good_enough=0.0, least_gain=0.0, runs=RUNS)
    values = read_yaml(find("compare", "default"))["values"]
    lines = [f"{'load':>4s}  {'record':21s} {'first model':18s}  acceleration and spectrum [%], run by run"]

    def report(load: float, record: str, name: str, case: Case) -> None:
        lines.append(f"{load:4.0f}  {record:21s} {name:18s}{case.line}")
        case.line = ""
        print(lines[-1], flush=True)

    print(lines[0])
    for load in arguments.loads or LOADS:
        table = load_table("bergamo").with_values({**values, "body.specimen_mass": load})
        own = own_loop(table) if arguments.own else None
        for record in RECORDS:
            for name, model in models_of(table).items():
                if name == "declared" or load == LOADS[1]:
                    case = Case(table, record, own)
                    learnt(case, model, EFFECTS, settings)
                    report(load, record, name, case)
            case = Case(table, record, own)
            for number in range(RUNS):
                case.run(models_of(table)["exact"], case.reference, number)
            report(load, record, "exact, kept", case)
    if not arguments.loads:
        dead_band(values, settings, report, arguments.own)
    lines.append(f"in {time.perf_counter() - began:.0f} s")
    if arguments.save:
        name = f"{Path(__file__).stem}{'_own' if arguments.own else ''}.txt"
        Path(__file__).with_name(name).write_text("\n".join(lines) + "\n", encoding="utf-8")


def dead_band(values: Mapping[str, float], settings: Iteration, report: Report, with_own: bool) -> None:
    """Runs on a table with a dead band that may not be fitted, may be corrected in the drive, and may be fitted."""
    load, record = LOADS[1], RECORDS[1]
    table = load_table("bergamo").with_values({**values, "body.specimen_mass": load, BAND: 0.01})
    first = models_of(table)["exact"].with_values({BAND: 0.0})
    case = Case(table, record, own_loop(table) if with_own else None)
    fitted = learnt(case, first, EFFECTS, settings)
    report(load, record, "dead band, not let", case)
    iterate(
        case.reference[:, 2],
        case.reference,
        lambda reference, number: case.run(fitted, reference, number).measured[:, 1],
        SAMPLE_TIME,
        settings,
    )
    report(load, record, "  then the drive", case)
    learnt(case, first, (*EFFECTS, "spool_deadband"), settings)
    report(load, record, "dead band, let", case)


if __name__ == "__main__":
    main()
