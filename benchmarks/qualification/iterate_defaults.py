"""The defaults of `iterate --simulate`: python -m benchmarks.qualification.iterate_defaults [--save].

Every table and record of config at three loads, commands one sample late; the model is the table as it is declared and
knows neither load nor delay. Each line: what two runs missed of the acceleration within the band, the model fitted in
between (`--refit command_delay`), and whether the iteration converged.
--tables NAME… takes some tables. --save appends to benchmarks/qualification/iterate_defaults.txt.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import shake_ros as sr
from shake_ros.core.quantities import ShakeError

TABLES = ("bergamo", "bergamo_cavitation", "bergamo_measured", "bergamo_table_6_9")
RECORDS = ("earthquake", "earthquake_rock", "earthquake_stiff_soil", "earthquake_soft_soil")
LOADS = (0.0, 200.0, 500.0)


def iterated(table: str, load: float, record: str) -> str:
    """Errors of two runs, and what is wrong."""
    played = sr.SimulatedTable(table, delay=1, progress=False, changes={"body.specimen_mass": load})
    try:
        found = sr.iterate_simulated(record, played, runs=2, refit=["command_delay"])
    except ShakeError as error:
        return str(error)
    return " ".join(f"{100.0 * e:8.2f}" for e in found.missed) + (
        "   " + found.wrong.split(":")[0] if found.wrong else ""
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tables", nargs="+", choices=TABLES, default=TABLES)
    parser.add_argument("--save", action="store_true")
    given = parser.parse_args()
    lines = [f"{'table':18s} {'load [kg]':>9s}  {'record':21s}  missed [%], run 1 and 2"]
    print(lines[0])
    for table in given.tables:
        for load in LOADS:
            for record in RECORDS:
                lines.append(f"{table:18s} {load:9.0f}  {record:21s} {iterated(table, load, record)}")
                print(lines[-1], flush=True)
    if given.save:
        with Path(__file__).with_suffix(".txt").open("a", encoding="utf-8") as file:
            file.write("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
