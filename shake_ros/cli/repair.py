"""Commands from a laboratory's file to a repaired model: import_csv, table, identify, close_loop, follow."""

from __future__ import annotations

import argparse
import json
import shutil
import sys
from collections.abc import Iterable, Sequence
from itertools import count, pairwise
from pathlib import Path

import numpy as np

from shake_ros.api.close_loop import Discovery, close_loop
from shake_ros.api.identify import identify
from shake_ros.api.import_csv import OF_SECOND, SIGNALS, import_csv, import_proposal
from shake_ros.api.live_table import InterlockHeldError
from shake_ros.api.progress import Progress
from shake_ros.api.read import Recordings, read
from shake_ros.api.table import table
from shake_ros.cli.arguments import (
    CommandLine,
    add_data,
    add_declared,
    inputs,
    live,
    read_set,
    released_by,
    reported,
    reporting,
    taken,
)
from shake_ros.declared import MODELS
from shake_ros.experiment_design.next_recording import NextRecording, decide, next_recording
from shake_ros.fit.start.unknown_model import NAME as UNKNOWN
from shake_ros.page.jobs import RECORDED
from shake_ros.physics.plant.parameters import FULL_LAYOUT
from shake_ros.quantities import ShakeError
from shake_ros.result_folder import check_folder, write_json
from shake_ros.twin.follow import follow

ALSO = "--also"
NEEDED = {
    "command": "the valve command; a motion alone does not identify a table",
    "out": "the folder of the recording",
}


IMPORT_METHOD = f"""\
Columns of a table (text, .xlsx, .tdms, .mat) become topics of a recording: valve_command, joint_states, imu, force,
pressures. FILE alone prints its columns and the command that imports them.
COL is a column's name or its number from 1, or the name of a variable of a .mat file. The unit in its heading converts
it to SI units; '*scale' stands in for that, and '*scale+offset' moves its zero as well: 'CHANNEL0*0.01',
'mA*0.125-1.5' for 4 to 20 mA. Options behind {ALSO} belong to that file: its time and its acceleration, and force and
pressures if it has them. How its clock is offset from the first is found by the correlation of acceleration and
position, and reported."""


def import_csv_parser() -> CommandLine:
    """Arguments of the command, and of its first file."""
    command = CommandLine("import_csv", IMPORT_METHOD)
    command.usage = (
        "import_csv FILE | FILE --time COL --command COL [--position COL] [--acceleration COL …] --out BAG "
        f"[options] [{ALSO} FILE --time COL --acceleration COL …]"
    )
    _add_file(command, SIGNALS)
    command.add_argument("--out", type=Path, metavar="BAG", help="folder of the recording")
    command.add_verb(import_csv, "position", "time", "rate", "skip", "decimal", "also")
    return command


def _add_file(command: argparse.ArgumentParser, signals: Iterable[str]) -> None:
    """The arguments of one file."""
    command.add_argument("file", type=Path)
    clock = command.add_mutually_exclusive_group()
    clock.add_argument("--time", metavar="COL[*scale]", help="time [s]")
    clock.add_argument("--rate", type=float, metavar="HZ", help="sampling rate, if no column holds the time")
    for name in signals:
        command.add_argument(f"--{name}", metavar="COL[*scale[+offset]]", help=SIGNALS[name])
    command.add_argument("--skip", type=int, metavar="N", help="lines above the table, if they are not recognised")
    command.add_argument("--decimal", choices=(".", ","), default="", help="if the numbers do not decide it")


def read_arguments(arguments: Sequence[str]) -> argparse.Namespace:
    """The arguments of the first file, and in `also` those of each further one."""
    places = [i for i, word in enumerate(arguments) if word == ALSO]
    first, *others = (arguments[a:b] for a, b in pairwise([0, *places, len(arguments)]))
    second = argparse.ArgumentParser(prog=f"import_csv {ALSO}", allow_abbrev=False)
    _add_file(second, OF_SECOND)
    read, rest = [], list[str]()
    for words in others:
        more, left = second.parse_known_args(words[1:])  # --out and the like may stand behind it too
        read.append({name: value for name, value in vars(more).items() if value is not None})
        rest += left
    named = import_csv_parser().parse_args([*first, *rest])
    named.also = read
    return named


def import_csv_command(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    given = read_arguments(list(arguments))
    if not any(getattr(given, name) is not None for name in ("time", "rate", "out", *SIGNALS)):
        print(import_proposal(given.file, skip=given.skip, decimal=given.decimal))
        return 0
    for name, why in NEEDED.items():
        if getattr(given, name) is None:
            raise ShakeError(f"{given.file}: --{name} is needed: {why}")
    recording = import_csv(**vars(given))
    ranges = ", ".join(
        f"{name} {np.nanmin(values):.4g} … {np.nanmax(values):.4g}"
        for name in SIGNALS
        if (values := recording.valve_command if name == "command" else getattr(recording, name)) is not None
        and np.isfinite(values).any()
    )
    print(f"{given.out}: {len(recording)} samples, every {recording.sample_time * 1e3:.6g} ms, {ranges}")
    for finding in recording.findings:
        print(f"  {finding}")
    if recording.load is not None:
        print("  load pressure: identify and close_loop fit it as well")
    return 0


OPTIONS = (  # option, factor to SI, help
    ("bore", 1e-3, "bore of the cylinder [mm]"),
    ("rod", 1e-3, "diameter of the rod, the same on both sides unless --single-rod [mm]"),
    ("stroke", 1e-3, "full stroke [mm]"),
    ("rated-flow", 1.0 / 60000.0, "rated flow of the valve [l/min]"),
    ("rated-drop", 1e5, "pressure drop of the rated flow, both edges together [bar] (default: 70)"),
    ("supply", 1e5, "supply pressure, absolute [bar]"),
    ("table-mass", 1.0, "table with rod and piston [kg]"),
    ("specimen-mass", 1.0, "specimen [kg] (default: 0)"),
    ("hose-volume", 1e-3, "oil in both lines between valve and cylinder [l] (default: 0)"),
    ("valve-frequency", 1.0, "frequency of the valve at -90 degrees of phase [Hz]"),
    ("valve-damping", 1.0, "damping ratio of the valve [-]"),
)


def table_command(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    command = CommandLine("table")
    for name, _, text in OPTIONS:
        command.add_argument(f"--{name}", type=float, metavar="NUMBER", help=text)
    command.add_argument("--single-rod", action="store_true", help="the rod is on side B alone: unequal areas")
    command.add_argument("--out", type=Path, required=True, metavar="FILE", help="YAML file to write")
    command.add_argument("--force", action="store_true", help="replace an existing file")
    given = command.parse_args(arguments)
    factors = {name.replace("-", "_"): factor for name, factor, _ in OPTIONS}
    values = {name: getattr(given, name) for name in factors}
    made = table(
        single_rod=given.single_rod, **{n: factors[n] * value for n, value in values.items() if value is not None}
    )
    path = made.save(given.out, given.force)
    print("\n".join([*(f"assumed: {line}" for line in made.assumed), f"table: {path}"]))
    return 0


def identify_command(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    command = CommandLine("identify")
    add_data(command, ("estimation",))
    add_declared(command)
    command.add_verb(identify)
    given = command.read(arguments)
    return reported(identify(*inputs(given), **command.options(given)), given)


def close_loop_command(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    command = CommandLine("close_loop")
    add_data(command, ("estimation", "validation"))
    add_declared(command)
    command.add_verb(close_loop)
    command.add_argument(
        "--test", type=Path, nargs="+", default=[], metavar="BAG", help="recordings that no decision uses: test data"
    )
    command.add_argument(
        "--next",
        action="store_true",
        help="design a motion that decides between the remaining answers; DIR/next gets it as a reference, with a page",
    )
    command.add_argument(
        "--interlock", metavar="NAME", help="with --next: the motion keeps its limits (config/interlock or a file)"
    )
    command.add_live()
    command.add_argument(
        "--most", type=int, default=2, metavar="N", help="with --live: make at most N recordings (default: 2)"
    )
    command.add_argument("--acknowledge", default="", metavar="NAME", help="with --live: who releases every motion")
    given = command.read(arguments)
    if given.interlock and not given.next:
        raise ShakeError("--interlock: is for --next")
    if given.live and (not given.next or given.interlock):
        raise ShakeError("--live: is for --next; the limits are those of the graph's own interlock")
    if given.most < 1:
        raise ShakeError(f"--most {given.most}: 1 or more")
    if given.next and given.model not in ("full", UNKNOWN):
        raise ShakeError(f"--next: needs the model full or unknown, not {given.model}")
    if given.tune and MODELS[given.model].layout is not FULL_LAYOUT:
        raise ShakeError(f"--tune: needs a valve and hydraulics, which the model {given.model} does not have")
    with live(given) as table:  # what will be moved in the end must be there and enabled now
        if table is not None:
            table.check()
    found = close_loop(*inputs(given), test=read_set(given, given.test), **command.options(given))
    found.report(given.out, given.force, **reporting(given))
    with found.failures.step("text"):
        print(found)
    if found.tuned and not found.tuned.sound and not given.force:
        print("controller.yaml and observer.yaml are not written: the closed loop oscillates (--force writes them)")
    answers = [found]
    if given.live:
        with found.failures.step("next recording"):
            decide_live(answers, given)
    elif given.next:
        with found.failures.step("next recording"):
            asked = next_recording(found, interlock=given.interlock)
            print("\n".join([*asked.lines(), f"next recording: {write_next(asked, given.out)}"]))
    page = given.out / "report.html"
    print(f"report: {page if page.exists() else given.out / 'report.json'}")
    failures = [failure for answer in answers for failure in answer.failures]
    for failure in failures:
        print(f"shake_ros close_loop: {failure}", file=sys.stderr)
    return 1 if failures else 0


def decide_live(answers: list[Discovery], given: argparse.Namespace) -> None:
    """Play what settles open questions on the table of the running graph, record it, and decide again.

    Each further answer is reported before the table moves again, and added to the answers.
    """
    with live(given) as table:
        assert table is not None

        def folder() -> Path:
            return given.out / "decided" if len(answers) > 1 else given.out

        def play(asked: NextRecording) -> Recordings | None:
            write_next(asked, folder())
            bag = unused(given.out / "recordings")
            state = "\n".join([*asked.lines(), f"{table.words}: the table moves as described"])
            if not released_by(state, given.acknowledge):
                print("nobody released it (--acknowledge NAME says who does): the search ends with what it has")
                return None
            try:
                with Progress("recording") as bar:
                    bar(f"{bag.name}: the table moves", 0.0)
                    made = table.play(asked.motion_at(table.sample_time), bag.name)
            except InterlockHeldError as held:
                print(f"{held}; the search ends with what it has", file=sys.stderr)
                return None
            shutil.copytree(made, bag)
            print(f"{RECORDED}{bag}", flush=True)
            return read(bag)

        def keep(more: Discovery) -> None:
            answers.append(more)
            out = more.report(given.out / "decided", force=True, **reporting(given))
            print(more, f"report: {out}", sep="\n", flush=True)

        table.check()
        interlock = table.interlock()
        decided = decide(answers[0], play, most=given.most, minutes=given.minutes, extended=keep, interlock=interlock)
    if decided.last is not None:
        write_next(decided.last, folder())
        print("\n".join(decided.last.lines()))


def write_next(asked: NextRecording, out: Path) -> Path:
    """The motion and its page in the folder `next` of a result, next.json beside report.json, which has it too."""
    folder, report = asked.write(out / "next", force=True), out / "report.json"
    content = (folder / "next.json").replace(out / "next.json").read_text(encoding="utf-8")
    write_json(report, {**json.loads(report.read_text(encoding="utf-8")), "next": json.loads(content)})
    return folder


def unused(folder: Path) -> Path:
    """The first next_1, next_2, … in a folder that is not there yet."""
    return next(path for k in count(1) if not (path := folder / f"next_{k}").exists())


FOLLOW_METHOD = """\
The found model runs beside the recordings, corrected towards the sensors. The first seconds of motion show what is
normal; from then on each window of two seconds corrects the slow parameters of the table (flow gain, hydraulic
stiffness, leakage, friction, null shift, mass, delays, sensors) and is tested for a change. A change is named by the
effects that close_loop knows: value, 90 % interval, since when, what else it may be; or that no effect explains it.
Over recordings of several days also what each parameter does from day to day: steps, trend, and the date on which it
leaves its limits in config/twin, with an interval.
DIR gets report.html, report.json and table.yaml, the table as it is known at the end."""


def follow_command(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    p = CommandLine("follow", FOLLOW_METHOD)
    p.add_argument(
        "recordings",
        nargs="+",
        metavar="RECORDING",
        help="recordings of one table in the order of time, or a folder of them named in that order",
    )
    p.add_argument("--table", required=True, metavar="FILE", help="table.yaml of close_loop, or a name of config/table")
    p.add_folder("folder of the report")
    p.add_verb(follow, settings="config")
    p.add_take()
    p.add_figures()
    given = p.read(arguments)
    check_folder(given.out, given.force)
    return reported(follow(read(*given.recordings, take=taken(given)), given.table, **p.options(given)), given)
