"""A run of a table of another laboratory, from the simulator that shares no code with the package."""

from __future__ import annotations

from functools import cache

import numpy as np

from benchmarks.discovery import foreign_tables as foreign
from shake_ros.fit.records import Record


@cache
def foreign_run(seed: int) -> Record:
    """Twelve seconds of random motion at 500 Hz, nothing hidden."""
    rng = np.random.default_rng([seed, 2026])
    truth = foreign.table(rng)
    laboratory = foreign.laboratory(truth, rng)._replace(rate=500.0, anti_alias=200.0)
    made = foreign.record(foreign.Case(seed, truth, laboratory, ()), "learn_random", 12.0)
    return Record("run", 0.002, made["command"] / laboratory.volts, made["position"], made["acceleration"])
