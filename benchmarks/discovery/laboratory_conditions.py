"""What becomes of recordings as laboratories make them? One condition per row, through the real command line.

    python -m benchmarks.discovery.laboratory_conditions [--only CONDITION …] [--minutes N] [--out DIR]

Two tables of foreign_tables.py (nothing of shake_ros is imported for them): one with a quadratic drag, one with nothing
hidden. Each condition changes one thing of the laboratory, the table or the files; what a laboratory would hand over is
written as text, then `import_csv` and `close_loop --config unknown` are run on it as a user runs them.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import re
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks import ROOT
from benchmarks.discovery import foreign_tables as foreign
from benchmarks.discovery.disturbances import (
    Columns,
    Disturbance,
    cells_empty,
    clipped,
    drifting,
    every,
    jitter,
    moved,
    own_clock,
    rows_absent,
    rows_twice,
    scaled,
    sine,
    spikes,
    steps,
    swapped,
    without,
)
from shake_ros import __main__ as shake_ros

SEEDS = {"drag": 457, "nothing": 425}  # one hidden effect, which is quadratic_drag; none
RUNS = ("learn_quake", "learn_random", "hold_quake")
SECONDS = 20.0  # of each recording
RATE = {"rate": 256.0, "anti_alias": 102.4}  # of a laboratory where nothing else is said, and its filter [Hz]
FINE = {"rate": 500.0, "anti_alias": 100.0}  # of one whose acceleration can be sampled anew
SIGNALS = {"time": "t", "command": "u", "position": "x", "acceleration": "a"}
ROUNDED = {"t": "%.9f", "a": "%.6g"}  # how a laboratory writes its columns


class Table(NamedTuple):
    """A text file: its columns, and the arguments with which it is imported."""

    columns: Columns
    arguments: tuple[str, ...]


@dataclass(frozen=True)
class Condition:
    """One way in which a laboratory's recordings differ from clean ones.

    Attributes
    ----------
    name : in a few words. disturb : changes the columns of a run. table : key of SEEDS.
    laboratory, truth : what is changed of them. arguments : of the import, instead of those of the four columns.
    split : signals that go to a second file, with their disturbance. runs : that are made. expected : effects that the
    condition itself brings, and that are right to name.
    """

    name: str
    disturb: Disturbance = lambda run, rng: run
    table: str = "nothing"
    laboratory: Mapping[str, float] = field(default_factory=lambda: RATE)
    truth: Mapping[str, float] = field(default_factory=dict)
    arguments: tuple[str, ...] = ("--time", "t", "--command", "u", "--position", "x", "--acceleration", "a")
    split: Disturbance | None = None
    runs: tuple[str, ...] = RUNS
    seconds: float = SECONDS
    expected: tuple[str, ...] = ()


TWO_FILES = ("--time", "t", "--command", "u", "--position", "x")
SECOND_FILE = ("--time", "ts", "--acceleration", "a")
FOUR = ("--time", "t", "--command", "u", "--position", "x", "--acceleration", "a")


def columns(**changes: str) -> tuple[str, ...]:
    """Arguments of the import with other columns."""
    return tuple(w for name, column in (SIGNALS | changes).items() if column for w in (f"--{name}", column))


CONDITIONS = (
    Condition("clean"),
    Condition("clean, 500 Hz with a filter of 100 Hz", laboratory=FINE),
    Condition("two files, own clocks", split=own_clock, arguments=TWO_FILES, laboratory=FINE),
    Condition("4 to 20 mA, not stated", scaled("u", 8.0, 12.0)),
    Condition("4 to 20 mA", scaled("u", 8.0, 12.0), arguments=columns(command="u*0.125-1.5")),
    Condition("command in mA about zero", scaled("u", 20.0)),
    Condition("command in per cent", scaled("u", 100.0)),
    Condition("2 % of rows absent", rows_absent(0.02)),
    Condition("2 % of rows absent, bridged", rows_absent(0.02), arguments=(*FOUR, "--bridge", "3")),
    Condition("0.1 % of rows absent", rows_absent(0.001)),
    Condition("0.1 % of cells empty", cells_empty(0.001)),
    Condition("2 % of cells empty, bridged", cells_empty(0.02), arguments=(*FOUR, "--bridge", "3")),
    Condition("rows twice", rows_twice),
    Condition("stamps off by 5 %", jitter(0.05)),
    Condition("stamps off by 30 %", jitter(0.3)),
    Condition("time from 1e9 s", every(lambda t, rng: t + 1e9, "t")),
    Condition("time in ms", scaled("t", 1e3), arguments=columns(time="t*0.001")),
    Condition("time in ms, not stated", scaled("t", 1e3)),
    Condition("spikes in the command", spikes),
    Condition("command recorded 4 ms late", moved(1)),
    Condition("command recorded 8 ms late", moved(2)),
    Condition("command recorded 4 ms early", moved(-1)),
    Condition("acceleration clipped at 60 %", clipped("a", 0.6)),
    Condition("command clipped at 60 %", clipped("u", 0.6)),
    Condition("no acceleration", without("a"), arguments=columns(acceleration="")),
    Condition("no position", without("x"), arguments=columns(position="")),
    Condition("100 Hz", laboratory={"rate": 100.0, "anti_alias": 40.0}),
    Condition("200 Hz", laboratory={"rate": 200.0, "anti_alias": 80.0}),
    Condition("200 Hz, accelerometer filter of 8 ms", laboratory={"rate": 200.0, "anti_alias": 28.1}),
    Condition("1000 Hz", laboratory={"rate": 1000.0, "anti_alias": 400.0}),
    Condition("5000 Hz", laboratory={"rate": 5000.0, "anti_alias": 2000.0}),
    Condition("10000 Hz", laboratory={"rate": 10000.0, "anti_alias": 4000.0}),
    Condition("position in steps of 10 µm", laboratory=RATE | {"step": 1e-5}),
    Condition("position in steps of 100 µm", laboratory=RATE | {"step": 1e-4}),
    Condition("acceleration of 12 bit", steps("a", 40.0 / 4096)),
    Condition("bias of the acceleration drifts by 0.2 m/s²", drifting("a", 0.2)),
    Condition("zero of the position drifts by 1 mm", drifting("x", 1e-3)),
    Condition("slow position transducer", truth={"position_sensor_lag": 4e-3}, expected=("position_sensor_lag",)),
    Condition("position in mm, not stated", scaled("x", 1e3)),
    Condition("acceleration in g, not stated", scaled("a", 1.0 / 9.80665)),
    Condition("acceleration with its sign turned", scaled("a", -1.0)),
    Condition("command and position swapped", swapped),
    Condition("recordings of two tables", runs=(*RUNS, "other")),
    Condition("5 s of data", runs=("learn_quake", "hold_quake"), seconds=5.0),
    Condition("a sine alone", sine),
    Condition("clean, with a drag", table="drag"),
    Condition("two files, own clocks, with a drag", table="drag", split=own_clock, arguments=TWO_FILES),
    Condition("spikes in the command, with a drag", spikes, table="drag"),
    Condition("command recorded 4 ms late, with a drag", moved(1), table="drag"),
    Condition("acceleration clipped at 60 %, with a drag", clipped("a", 0.6), table="drag"),
    Condition("no acceleration, with a drag", without("a"), table="drag", arguments=columns(acceleration="")),
    Condition("100 Hz, with a drag", table="drag", laboratory={"rate": 100.0, "anti_alias": 40.0}),
    Condition("position in steps of 100 µm, with a drag", table="drag", laboratory=RATE | {"step": 1e-4}),
)


def case_of(asked: Condition) -> foreign.Case:
    """The table and its laboratory under a condition."""
    case = foreign.case_of(SEEDS[asked.table])
    return foreign.Case(
        case.seed, case.truth._replace(**asked.truth), case.laboratory._replace(**asked.laboratory), case.effects
    )


def files(asked: Condition, case: foreign.Case, name: str) -> tuple[list[Table], float]:
    """The text files of one run, and its noise over the size of its acceleration [-]."""
    if name == "other":  # a run of the other table among those of this one
        case, name = foreign.case_of(SEEDS["drag"]), "learn_random"
    made = foreign.record(case, name, asked.seconds)
    noise = float(made.pop("noise")) / float(np.std(made["acceleration"]))
    rng = np.random.default_rng([case.seed, RUNS.index(name), 11])
    run = asked.disturb({SIGNALS[n]: values for n, values in made.items()}, rng)
    if asked.split is None:
        return [Table(run, asked.arguments)], noise
    second = asked.split(run, rng)
    first = {n: values for n, values in run.items() if n not in second}
    return [Table(first, asked.arguments), Table(second, SECOND_FILE)], noise


def write(path: Path, run: Columns) -> None:
    """A text file with a line of names; a value that is not there is an empty cell."""
    rows = np.column_stack(list(run.values()))
    shapes = [ROUNDED.get(name, "%.9g") for name in run]
    with path.open("w", encoding="utf-8") as file:
        file.write(",".join(run) + "\n")
        for row in rows.tolist():
            cells = ("" if value != value else shape % value for shape, value in zip(shapes, row, strict=True))
            file.write(",".join(cells) + "\n")


class Ran(NamedTuple):
    """What a command left: exit code, standard output, standard error, seconds."""

    code: int
    out: str
    error: str
    seconds: float


def command(*arguments: object) -> Ran:
    """Run a command of the package, as its entry point does."""
    out, error, start = io.StringIO(), io.StringIO(), time.perf_counter()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(error):
        try:
            code = shake_ros.main([str(a) for a in arguments])
        except SystemExit as ended:
            if ended.code != 2:  # of argparse
                raise
            code = 2
    return Ran(code, out.getvalue(), error.getvalue(), time.perf_counter() - start)


def said(text: str, names: Sequence[str]) -> list[str]:
    """The lines of a text without progress and names of the runs, each once."""
    lines: dict[str, None] = {}
    for line in text.replace("\r", "\n").splitlines():
        for name in names:  # the folder comes first
            line = line.replace(f"{name}: ", "").replace(f"{name}/", "").replace(name, "RUN")
        if line.strip() and not line.startswith("close_loop: "):
            lines[line.strip()] = None
    return list(lines)


def judged(asked: Condition, case: foreign.Case, report: Any, noise: Mapping[str, float]) -> str:
    """What a report names, what of it is wrong, and its errors on the runs held out."""
    named = [s["effect"] + "".join(f" or {a}" for a in s["alternatives"]) for s in report["steps"]]
    right = {*case.effects, *asked.expected}
    wrong = [s["effect"] for s in report["steps"] if not right & {s["effect"], *s["alternatives"]}]
    error = report["final"]["error"]["hold"]
    over = [e["acceleration"] / noise[n] for n, e in error.items() if "acceleration" in e]
    velocities = [100.0 * e["velocity"] for e in error.values() if "velocity" in e]
    about = f"{np.mean(over):.2f} times the noise" if over else "no acceleration"
    about += f", velocity {np.mean(velocities):.2f} %" if velocities else ", no velocity"
    return f"{' + '.join(named) or 'nothing'}; wrong: {', '.join(wrong) or 'none'}; {about}"


def measure(asked: Condition, out: Path, minutes: float) -> list[str]:
    """Lines of one condition."""
    case, noise, heard, folders = case_of(asked), {}, [], []
    place = out / re.sub(r"\W+", "_", asked.name)
    place.mkdir(parents=True, exist_ok=True)
    for name in asked.runs:
        tables, noise[name] = files(asked, case, name)
        arguments: list[object] = []
        for number, table in enumerate(tables):
            path = place / f"{name}_{number}.csv"
            write(path, table.columns)
            arguments += [*(["--also"] if number else []), path, *table.arguments]
        folders.append(place / name)
        ran = command("import_csv", *arguments, "--out", folders[-1], "--overwrite")
        heard.append(ran)
        if ran.code:
            lines = said(ran.error, RUNS)
            return [f"{asked.name}: import refused with exit code {ran.code}", *(f"    {line}" for line in lines[:3])]
    learn, hold = ([f for f in folders if f.name.startswith(role)] for role in (("learn", "other"), "hold"))
    given = ("--config", "unknown", "--minutes", minutes, "--learn", *learn, "--hold", *hold)
    ran = command("close_loop", *given, "--out", place / "report", "--force")
    told = [line for line in ran.out.splitlines() if re.search("taken (?!out of the rec)|taken out$|later than", line)]
    everything = [*(h.out for h in heard[:1]), *(h.error for h in heard), ran.error, *told]
    hears = said("\n".join(everything), [str(place), *RUNS])
    if ran.code:
        return [f"{asked.name}: refused with exit code {ran.code} [{ran.seconds:.0f} s]", *(f"    {x}" for x in hears)]
    report = json.loads((place / "report" / "report.json").read_text(encoding="utf-8"))
    return [
        f"{asked.name}: {judged(asked, case, report, noise)} [{ran.seconds:.0f} s]",
        *(f"    {line}" for line in hears),
    ]


def main(given: Sequence[str] = tuple(sys.argv[1:])) -> None:
    """Run what is asked for."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    names = [c.name for c in CONDITIONS]
    options.add_argument("--only", nargs="+", choices=names, default=names, metavar="CONDITION")
    options.add_argument("--minutes", type=float, default=2.0, help="of each search")
    options.add_argument("--out", type=Path, default=ROOT / "out" / "laboratory_conditions", metavar="DIR")
    chosen = options.parse_args(list(given))
    for asked in CONDITIONS:
        if asked.name in chosen.only:
            print("\n".join(measure(asked, chosen.out, chosen.minutes)), flush=True)


if __name__ == "__main__":
    main()
