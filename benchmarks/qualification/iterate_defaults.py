"""The defaults of `iterate --simulate`: python -m benchmarks.qualification.iterate_defaults [--save].

Every table and record of config at three loads, commands one sample late; the first model is the table as it is
declared, with 200 kg, and knows neither load nor delay. Each line: what every run missed of the acceleration within the
band, the specimen that the model of the best run has, and whether the iteration converged. The drive is corrected under
gains made for the table; the specimen is weighed by the forces of the first run.
--fixed_gains runs under super_twisting_model and model_soft_zone, made for the table bergamo with a soft zone.
--tables NAME… takes some tables. --save writes benchmarks/qualification/iterate_defaults.txt.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import shake_ros as sr
from shake_ros.quantities import ShakeError

TABLES = ("bergamo", "bergamo_cavitation", "bergamo_measured", "bergamo_table_6_9")
RECORDS = ("earthquake", "earthquake_rock", "earthquake_stiff_soil", "earthquake_soft_soil")
LOADS = (0.0, 200.0, 500.0)
OWN, FIXED = ("own", "own"), ("model_soft_zone", "super_twisting_model")  # observer, controller


def iterated(played: sr.SimulatedTable, record: str, runs: int) -> tuple[str, bool]:
    """Errors of the runs, the specimen, and what is wrong; whether nothing is."""
    try:
        found = sr.iterate_simulated(record, played, runs=runs)
    except ShakeError as error:
        return str(error), False
    specimen = found.model.value("body.specimen_mass") if found.model is not None else float("nan")
    errors = " ".join(f"{100.0 * e:7.2f}" for e in found.missed)
    wrong = found.wrong.split(":")[0]
    return f"{errors}  {specimen:6.0f} kg  {wrong or 'converged'}", not wrong


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tables", nargs="+", choices=TABLES, default=TABLES)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--fixed_gains", action="store_true")
    parser.add_argument("--save", action="store_true")
    given = parser.parse_args()
    began = time.process_time()
    lines = [f"{'table':18s} {'load [kg]':>9s}  {'record':21s}  missed [%], run by run; specimen of the model"]
    print(lines[0])
    good = 0
    for table in given.tables:
        played = sr.SimulatedTable(table, *(FIXED if given.fixed_gains else OWN), delay=1, progress=False)
        for load in LOADS:
            played.changes = {"body.specimen_mass": load}
            for record in RECORDS:
                text, converged = iterated(played, record, given.runs)
                good += converged
                lines.append(f"{table:18s} {load:9.0f}  {record:21s} {text}")
                print(lines[-1], flush=True)
    lines.append(f"{good} of {len(lines) - 1} converged; {time.process_time() - began:.0f} s of processor time")
    print(lines[-1])
    if given.save:
        Path(__file__).with_suffix(".txt").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
