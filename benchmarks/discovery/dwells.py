"""How large a part of the acceleration's changes of sign dwells at zero, with and without backlash?

    python -m benchmarks.discovery.dwells

Tables of hidden_tables.py and foreign_tables.py, which share nothing with the package.
"""

from __future__ import annotations

import numpy as np

from benchmarks.discovery import foreign_tables, hidden_tables
from shake_ros.api.read import recording, recordings
from shake_ros.fit.records import Record
from shake_ros.fit.start.backlash import BACKLASH, LONG, SHARE, dwells, share_of_dwells
from shake_ros.recordings.bags import TableRecording

FIRST, SHARES = 3000, (0.1, 0.3)
FOREIGN = range(2052, 2082)


def declared(seed: int, effect: str, part: float) -> list[Record]:
    """The estimation data of a declared table with one effect."""
    commands = hidden_tables.excitations(seed)
    table = hidden_tables.with_effect(hidden_tables.declared_truth(seed), effect, part, commands, seed)
    runs = list[TableRecording]()
    for name in (n for n in commands if n.startswith("learn")):
        made = hidden_tables.record(table, commands[name], 1.0, np.random.default_rng([seed, 7]))
        times = np.arange(len(commands[name])) * hidden_tables.SAMPLE
        runs += recording(name, times, made["command"], made["position"], acceleration=made["acceleration"])
    return recordings(runs).records("valve_command")


def foreign(case: foreign_tables.Case) -> list[Record]:
    """The estimation data of a table without a data sheet."""
    runs = list[TableRecording]()
    for name in (n for n in foreign_tables.RUNS if n.startswith("learn")):
        made = foreign_tables.record(case, name, 16.0)
        made.pop("noise")
        runs += recording(name, **made)
    return recordings(runs).records("valve_command")


def report(records: list[Record], what: str) -> tuple[bool, bool]:
    """One line of a table; whether it has backlash and whether that shows."""
    ratios = np.concatenate([dwells(r) for r in records])
    print(f"{what:60s} {np.mean(ratios > LONG):6.3f} of {len(ratios)}", flush=True)
    return BACKLASH in what, share_of_dwells(records) > SHARE


def main() -> None:
    """Print every table, then the counts."""
    effects = [(name, part) for name, each in hidden_tables.HIDDEN.items() if each.listed for part in SHARES]
    found = [report(declared(FIRST + i, *each), f"declared: {each[0]} {each[1]:.0%}") for i, each in enumerate(effects)]
    cases = [foreign_tables.case_of(seed) for seed in FOREIGN]
    found += [report(foreign(case), f"foreign: {' + '.join(case.effects) or 'nothing'}") for case in cases]
    for name, has in (("with backlash", True), ("without", False)):
        shows = [shown for there, shown in found if there is has]
        print(f"{name}: more than {SHARE:g} dwell on {sum(shows)} of {len(shows)} tables")


if __name__ == "__main__":
    main()
