"""Hidden tables closed once per session, for all tests that look at a side of the result.

`named(case)` searches a short recording with another held out; `command(case)` runs the whole command on bags. Both
try the full list of effects (but for SHORT_LISTS) with short fits.
"""

from __future__ import annotations

import contextlib
import functools
import io
import tempfile
from pathlib import Path
from typing import Any, NamedTuple
from unittest import mock

import numpy as np
from hidden_table import SAMPLE_TIME, Hidden, record

from shake_ros import __main__
from shake_ros.api import close_loop as close_loop_verb
from shake_ros.api.fitted import fit_data
from shake_ros.api.read import read
from shake_ros.declared import effect_candidates, free_parameters
from shake_ros.failures import RAISING
from shake_ros.fit.free_parameters import FreeParameters
from shake_ros.fit.least_squares import Fit, fit, never
from shake_ros.fit.recording_problem import RecordingProblem
from shake_ros.fit.records import Record
from shake_ros.recordings.bags import write_table_recording
from shake_ros.repair import close_loop as closing
from shake_ros.repair.close_loop import LoopClosure
from shake_ros.search.problem import ModelStructure, SearchProblem
from shake_ros.search.selection import Selection
from shake_ros.settings import load_search, load_table

SECONDS = 3.0
LEAN = load_search().replace(
    most_refitted=2,
    continued_evaluations=8,
    converging_evaluations=12,
)
DEAD_BAND = 0.02
CASES: dict[str, dict[str, Any]] = {
    "nothing": {},
    "spool_deadband": {"hidden": Hidden(dead_band=DEAD_BAND)},
    "soft_zone": {"soft_zone_depth": 0.6},
    "asymmetric_flow_gain": {"hidden": Hidden(flow_asymmetry=0.1)},
    "payload_error": {"mass": 750.0},
}
CLOSE_LOOP = closing.close_loop
COMMANDS = ("nothing", "spool_deadband")
SHORT_LISTS = {
    "payload_error": ("payload_error", "tank_back_pressure"),
}
_folder = tempfile.TemporaryDirectory(prefix="shake_ros-closed-")


TUNED = "spool_deadband"  # the case whose command also makes gains


class Named(NamedTuple):
    """A search with what it was done on."""

    search: Selection
    problem: SearchProblem


class Command(NamedTuple):
    """A run of `close_loop`: exit code, what it printed, its folder, and the result inside."""

    code: int
    printed: str
    out: Path
    result: LoopClosure
    learn: list[Record]
    hold: list[Record]


def recording(case: str, seed: int, name: str, seconds: float = SECONDS) -> Record:
    """A recording of a case's table as a fit takes it."""
    made = record(seed, seconds, **CASES[case])
    return Record(name, SAMPLE_TIME, made.commands, made.position, made.acceleration)


def bag(case: str, seed: int, path: Path, seconds: float = SECONDS, *, position: bool = True) -> Path:
    """The same recording as a rosbag2 folder, with its position or without."""
    made = record(seed, seconds, **CASES[case])
    time = np.arange(len(made.commands)) * SAMPLE_TIME
    return write_table_recording(path, time, made.commands, made.position if position else None, made.acceleration)


def problem_of(learn: list[Record], hold: list[Record]) -> SearchProblem:
    """The problem of two sets of recordings that are too short for pieces."""
    structure = ModelStructure(load_table("bergamo"), ())
    return SearchProblem.of(structure, learn, hold, LEAN, lambda text, part: None)


@functools.cache
def declared_fit(case: str) -> tuple[Fit, RecordingProblem]:
    """The declared model fitted to the learning recording of a case, from the catalogue's values."""
    problem = RecordingProblem([recording(case, 1, "learn")])
    free = FreeParameters(load_table("bergamo"), free_parameters())
    return fit(problem, free, free.start(), evaluations=15, tolerance=1e-4), problem


@functools.cache
def named(case: str) -> Named:
    """The search for what a case's table has beyond the declared model; from the command where that runs anyway."""
    if case in COMMANDS:
        run = command(case)
        return Named(run.result.search, problem_of(run.learn, run.hold))
    problem = problem_of([recording(case, 1, "learn")], [recording(case, 2, "hold")])
    pool = tuple(c for c in effect_candidates() if c.effect in SHORT_LISTS.get(case, (c.effect,)))
    structure = ModelStructure(load_table("bergamo"), tuple(free_parameters()), candidates=pool)
    given = problem.estimation.records, problem.validation.records, problem.progress, never, RAISING
    return Named(closing.searched(problem, structure, *given)[1], problem)


@functools.cache
def command(case: str, *, position: bool = True) -> Command:
    """`close_loop` on two bags of a case's table, with their positions or without."""
    folder = Path(_folder.name) / (case if position else f"{case}_without_position")
    learn, hold = (bag(case, seed, folder / n, position=position) for seed, n in ((1, "learn"), (2, "hold")))
    results: list[LoopClosure] = []

    def kept(*arguments: Any, **more: Any) -> LoopClosure:
        results.append(CLOSE_LOOP(*arguments, **more))
        return results[-1]

    output, out = io.StringIO(), folder / "out"
    given = ["close_loop", "--learn", str(learn), "--hold", str(hold), "--out", str(out)]
    given += ["--tune"] if case == TUNED and position else []
    with (
        mock.patch.object(closing, "close_loop", kept),
        mock.patch.object(close_loop_verb, "search_settings", return_value=LEAN),
        contextlib.redirect_stdout(output),
        contextlib.redirect_stderr(io.StringIO()),
    ):
        code = __main__.main(given)
    records = fit_data(read(learn), read(hold), "valve_command")
    return Command(code, output.getvalue(), out, results[0], *records)
