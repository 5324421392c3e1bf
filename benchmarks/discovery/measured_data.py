"""What the commands find on data that nobody here made: python -m benchmarks.discovery.measured_data [--only NAME …].

Runs the commands of the package on the recordings under --shared (default: ../shared beside the repository) and prints
what they find: the effects that close_loop names on the six sealed tables and on the four without a data sheet, with
its errors before and after on the recordings held out; the electric table with the reduced model; the EMPS axis; delay
and gain of the MTS actuator. The commands are printed too; what they leave is in out/measured_data. Nothing of the data
is part of the repository.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import math
import shlex
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TextIO

import numpy as np

import shake_ros as sr
from benchmarks import ROOT
from shake_ros import __main__ as shake_ros
from shake_ros.api.progress import SO_FAR

SEALED = ("s1", "s2", "s3", "s4", "s5", "s6")
FOREIGN = ("f1", "f2", "f3", "f4")
ELECTRIC_LEARN = ("SineA02F02", "SineA05F03", "SineA3F08", "RandomA1F05", "SawtoothA1F04")
ELECTRIC_HOLD = ("seisme", "RandomA4F1", "SquareA05F1", "SineA1F1")
ELECTRIC_COLUMNS = ("--time", "t_s", "--command", "ut", "--position", "position")
EMPS_COLUMNS = ("--time", "t", "--command", "vir*0.1", "--position", "qm", "--force", "vir*35.15065188")
MTS_COLUMNS = ("--rate", "1000", "--command", "CHANNEL2*0.01", "--position", "CHANNEL0*0.01")
MTS_FREQUENCIES = (0.5, 5, 10, 15, 20)


def command(*arguments: object) -> tuple[str, float]:
    """Run a command of the package; what it printed and its seconds. Ends where the command fails."""
    given = [str(a) for a in arguments]
    print("$ ./shake " + shlex.join(given), flush=True)
    printed, start = io.StringIO(), time.perf_counter()
    with contextlib.redirect_stdout(printed):
        code = shake_ros.main(given)
    if code != 0:
        raise SystemExit(f"exit code {code}")
    return printed.getvalue(), time.perf_counter() - start


class FirstAnswer:
    """The answers that a command tells of before its end, with the seconds at which it does; a stream of its own."""

    def __init__(self, stream: TextIO) -> None:
        self.stream, self.start, self.lines = stream, time.perf_counter(), list[str]()

    def write(self, text: str) -> int:
        """Pass it on."""
        if SO_FAR in text:
            self.lines.append(f"after {time.perf_counter() - self.start:.0f} s: {text.strip().partition(': ')[2]}")
        return self.stream.write(text)

    def flush(self) -> None:
        """Pass it on."""
        self.stream.flush()

    def isatty(self) -> bool:
        """No bar is drawn over the lines."""
        return False


def per_cent(errors: dict[str, dict[str, float]], channel: str) -> str:
    """Errors of a channel by recording."""
    return ", ".join(f"{name} {100.0 * e[channel]:.2f} %" for name, e in errors.items())


def verdict(out: Path, channel: str, seconds: float) -> str:
    """What a close_loop named, its errors before and after, and what remains."""
    report = json.loads((out / "report.json").read_text(encoding="utf-8"))
    steps = [s["effect"] + "".join(f" or {a}" for a in s["alternatives"]) for s in report["steps"]]
    before, after = (per_cent(report[m]["error"]["hold"], channel) for m in ("baseline", "final"))
    remaining = report["remaining"]
    said = [
        f"  {out.name}: {' + '.join(steps) or 'nothing'}; held-out {channel}: {before} → {after} [{seconds:.0f} s]",
        f"    {remaining['text']}",
    ]
    if remaining["candidates"]:
        doubtful = " + ".join(c["effect"] for c in remaining["candidates"])
        said.append(f"    not established: {doubtful}; {per_cent(remaining['validation_with_candidates'], channel)}")
    return "\n".join(said)


def sealed(data: Path, out: Path) -> None:
    """The six sealed tables, declared by a data sheet."""
    tables(data, out, SEALED)


def foreign(data: Path, out: Path) -> None:
    """The four tables without a data sheet."""
    tables(data, out, FOREIGN, "--config", "unknown")


def tables(data: Path, out: Path, names: Sequence[str], *options: str) -> None:
    """Close the loop on some of the sealed tables."""
    for folder in (data / "sealed" / name for name in names):
        if not folder.is_dir():
            continue
        learn, hold = sorted(folder.glob("learn_*")), sorted(folder.glob("hold_*"))
        place = out / folder.name
        with contextlib.redirect_stderr(FirstAnswer(sys.stderr)) as first:
            _, seconds = command("close_loop", *options, "--learn", *learn, "--hold", *hold, "--out", place, "--force")
        print(verdict(place, "acceleration", seconds), flush=True)
        for line in first.lines:
            print(f"    {line}", flush=True)


def imported(file: Path, out: Path, columns: Sequence[str]) -> Path:
    """A recording made of a file of columns."""
    bag = out / "bags" / file.stem
    command("import_csv", file, *columns, "--out", bag, "--overwrite")
    return bag


def electric(data: Path, out: Path) -> None:
    """The motor-driven shaking table, declared linear."""
    folder = data / "data" / "electric_table"
    bags = {n: imported(folder / f"{n}.csv", out, ELECTRIC_COLUMNS) for n in (*ELECTRIC_LEARN, *ELECTRIC_HOLD)}
    learn, hold = ([bags[n] for n in names] for names in (ELECTRIC_LEARN, ELECTRIC_HOLD))
    place = out / "electric_table"
    arguments = ("--model", "reduced", "--learn", *learn, "--hold", *hold, "--out", place, "--force")
    _, seconds = command("close_loop", *arguments)
    print(verdict(place, "velocity", seconds), flush=True)


def emps(data: Path, out: Path) -> None:
    """The positioning axis: published parameters, then what its four-parameter model lacks, by either file."""
    bags = [imported(data / "data" / "emps" / f"{n}.mat", out, EMPS_COLUMNS) for n in ("DATA_EMPS", "DATA_EMPS_PULSES")]
    print("\n".join(emps_files(bags)))
    both = ("--model", "axis", "--learn", bags[0], "--hold", bags[1])
    printed, _ = command("identify", *both, "--method", "inverse_dynamics", "--out", out / "emps_identify", "--force")
    print("\n".join("  " + line for line in printed.splitlines() if "axis." in line))
    for name, (learn, hold) in (("emps", bags), ("emps_swapped", bags[::-1])):
        arguments = ("--model", "axis", "--learn", learn, "--hold", hold, "--out", out / name, "--force")
        printed, seconds = command("close_loop", *arguments)
        shown = ("free run, ", "of its own, ", "effects.")
        print("\n".join("  " + line for line in printed.splitlines() if any(s in line for s in shown)))
        print(verdict(out / name, "velocity", seconds), flush=True)


def emps_files(bags: Sequence[Path]) -> list[str]:
    """What the two files tell of each other: they follow one reference, and friction differs before the first pulse."""
    (first,), (second,) = (sr.read(bag).records("force") for bag in bags)
    apart = 1e3 * math.sqrt(np.mean((second.position - first.position) ** 2))
    steady = slice(100, 330)  # at 42 mm/s, before the first pulse at 0.343 s
    forces = [float(np.mean(r.commands[steady])) for r in (first, second)]
    ways = [1e3 * float(r.position[steady.stop] - r.position[steady.start]) for r in (first, second)]
    return [
        f"  positions of the two files differ by {apart:.3f} mm rms",
        f"  0.10 to 0.33 s: mean force {forces[0]:.2f} and {forces[1]:.2f} N over {ways[0]:.3f} and {ways[1]:.3f} mm",
    ]


def mts(data: Path, out: Path) -> None:
    """Closed-loop delay and gain of the servo-hydraulic actuator."""
    folder = data / "data" / "mts_actuator"
    bag = imported(folder / "chirp_0A.txt", out, MTS_COLUMNS)
    printed, _ = command("frequency_response", bag, "--at", *MTS_FREQUENCIES, "--out", out / "mts_actuator", "--force")
    print("\n".join("  " + line for line in printed.splitlines()))


DATA: dict[str, Callable[[Path, Path], None]] = {
    "sealed": sealed,
    "foreign": foreign,
    "electric": electric,
    "emps": emps,
    "mts": mts,
}


def main(given: Sequence[str] = tuple(sys.argv[1:])) -> None:
    """Run what is asked for."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument(
        "--shared", type=Path, default=ROOT.parent / "shared", metavar="DIR", help="folder of the data"
    )
    options.add_argument("--only", nargs="+", choices=list(DATA), default=list(DATA))
    options.add_argument("--out", type=Path, default=ROOT / "out" / "measured_data", metavar="DIR")
    chosen = options.parse_args(list(given))
    if not chosen.shared.is_dir():
        raise SystemExit(f"{chosen.shared}: no such folder")
    for name in chosen.only:
        print(f"{name}:", flush=True)
        DATA[name](chosen.shared, chosen.out)


if __name__ == "__main__":
    main()
