"""Commands that move a table run by run: commission, iterate, qualify."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from shake_ros.api.live_table import OWN, NotReleasedError
from shake_ros.api.read import read
from shake_ros.api.record_scale import accelerogram
from shake_ros.cli.arguments import CommandLine, changes, live, released_by, reported, taken
from shake_ros.commissioning.commission import commission
from shake_ros.iteration.iterate import Iterated, iterate, iterate_simulated
from shake_ros.iteration.table import SimulatedTable
from shake_ros.qualification.qualify import qualify
from shake_ros.qualification.result import Qualification, certified
from shake_ros.qualification.sequence import FILE, TestSequence, qualify_sequence, sequence_of
from shake_ros.quantities import ShakeError
from shake_ros.result_folder import check_folder

COMMISSION_METHOD = """\
A gentle motion under gains that do not depend on the table; the model fitted to it; observer and gains for that model;
a higher level, and again, until the full motion has been run with gains of its own; at the highest level close_loop
looks for missing effects. With --live this is done on the table of the running graph (./shake lab), whose interlock
gets each level's limits. Before each run its largest values and those limits are shown, and Enter releases it; the
limits grow with the level. DIR gets table.yaml, controller.yaml, observer.yaml, interlock.yaml, commission.html,
commission.json and the recordings. Exit code 1 if it ended before the last step, with the reason on the last line."""


def asked(text: str) -> bool:
    """Show a step and ask the operator."""
    print(text, flush=True)
    try:
        return input("press Enter to release it, anything else to end: ").strip() == ""
    except EOFError:
        raise ShakeError("commission: nobody at the terminal can release the step (--yes releases all)") from None


def shown(text: str) -> bool:
    """Show a step that is released beforehand."""
    print(text, flush=True)
    return True


def commission_command(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    p = CommandLine("commission", COMMISSION_METHOD)
    p.add_folder("folder for table, gains and evidence")
    p.add_verb(commission, settings="config")
    p.add_live()
    p.add_argument("--yes", action="store_true", help="release every step, for scripts")
    given = p.read(arguments)
    if given.delay < 0:
        raise ShakeError(f"--delay {given.delay}: samples, 0 or more")
    check_folder(given.out, given.force)
    with live(given) as table:
        found = commission(**p.options(given), live=table, release=shown if given.yes else asked)
    if found.steps:
        found.report(given.out, given.force, command=given.line)
        print(f"written: {given.out}")
    print(found)
    if not found.complete:
        print(f"ended: {found.reason}", file=sys.stderr)
    return 0 if found.complete else 1


ITERATE_METHOD = """\
BAG… are runs of the same motion, oldest first, each recorded from the start of its reference, with imu and reference.
DIR gets report.html, drive.csv (time and acceleration) and drive.yaml, a reference: -p reference:=DIR/drive.yaml
plays it.
With --simulate the runs are made on a simulated closed loop, under gains that are made for the table, and the
response spectra are in the report; the specimen is weighed by the forces of the first run, and DIR gets model.yaml.
Runs are ranked by what they missed within the band; exit code 1 where they diverge or have not converged, with the
effect that the model lacks, as close_loop finds it in the runs.
With --refit the motion stays as it is and the model of the feedforward is fitted to the last run, the parameters of
config/identification/full.yaml and those of the named effects; DIR gets model.yaml, which the controller's and the
observer's configurations name as their model for the next run."""


def iterate_command(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    p = CommandLine("iterate", ITERATE_METHOD)
    p.add_recordings(nargs="*")
    p.add_argument("--wanted", required=True, metavar="REFERENCE", help="the motion that the table should make")
    p.add_folder("folder of the report and of the next drive or model")
    p.add_verb(iterate, "model", "refit", settings="config")
    p.add_argument("--simulate", type=int, metavar="N", help="make at most N runs on the simulated table")
    p.add_argument("--table", default="bergamo", help="with --simulate: the table (default: bergamo)")
    p.add_set("with --simulate: change it")
    p.add_argument("--observer", default=OWN, help="with --simulate (default: own, made for --table)")
    p.add_argument("--controller", default=OWN, help="with --simulate (default: own, made for --table)")
    p.add_argument(
        "--model",
        help="table of the model feedforward and of an observer that has a model (default with --simulate: --table as "
        "it is declared, without --set)",
    )
    p.add_argument("--delay", type=int, default=0, help="with --simulate: samples a command is late (default: 0)")
    p.add_argument(
        "--refit", nargs="*", metavar="EFFECT", help="fit --model, with these effects, instead of correcting the drive"
    )
    p.add_figures()
    given = p.read(arguments)
    if bool(given.bags) == (given.simulate is not None):
        raise ShakeError("give either recordings or --simulate N")
    how = {name: getattr(given, name) for name in ("settings", "model", "refit")}
    if given.simulate is not None:
        return _report_iteration(_simulated(given, how), given)
    runs = read(*given.bags, take=taken(given))
    if given.refit is not None:
        for finding in runs[-1:].findings:
            print(finding, file=sys.stderr)
    return _report_iteration(iterate(given.wanted, runs, **how), given)


def _report_iteration(result: Iterated, given: argparse.Namespace) -> int:
    """Write and print the result; what is wrong, why, and what to do, on standard error; the exit code."""
    reported(result, given)
    what, file = ("next drive", "drive.yaml") if result.drive is not None else ("model of the next run", "model.yaml")
    print(f"{what}: {given.out / file}")
    if not result.wrong:
        return 0
    print(f"the iteration {result.wrong}", file=sys.stderr)
    if result.first_model is None:
        print(
            "--model TABLE names the table as it is known; close_loop then looks for what it lacks in the runs",
            file=sys.stderr,
        )
    else:
        print("close_loop on the runs, for missing effects; a minute or more", flush=True)
        print(result.lacking(progress=False), file=sys.stderr)
    return 1


def _simulated(given: argparse.Namespace, how: Mapping[str, Any]) -> Iterated:
    def shown(text: str, _: float) -> None:
        print(text)

    table = SimulatedTable(
        given.table, given.observer, given.controller, given.delay, progress=shown, changes=changes(given)
    )
    return iterate_simulated(given.wanted, table, runs=given.simulate, **how)


QUALIFY_METHOD = """\
RRS is a name of config/required_spectra or a YAML file: a code's formula, or points at any damping; its key `rules`
names the rules to apply (config/qualification_rules). A motion with a strong part of 20 s is synthesised and matched
to it, refused where it does not fit the table, run on the simulated table and corrected until the test response
spectrum passes. With --live the table of the running graph (./shake lab) is moved instead, once somebody has released
the test: at the prompt, or by --acknowledge NAME. DIR gets certificate.html, certificate.pdf (A4), certificate.json
and the recordings with their SHA-256. Exit code 1 where the test did not pass, with the reason on the last line."""


def qualify_command(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    p = CommandLine("qualify", QUALIFY_METHOD)
    p.add_argument("required", nargs="?", metavar="RRS", help="required spectrum: a known name or a YAML file")
    p.add_argument("--out", type=Path, metavar="DIR", help="folder for the certificate and the recordings")
    p.add_verb(qualify, "record", "refit", settings="config")
    p.add_argument("--record", metavar="FILE", help="accelerogram to start from, instead of random phases")
    p.add_argument("--channel", type=int, default=0, help="its component, from 1, if it has several")
    p.add_argument("--refit", nargs="*", metavar="EFFECT", help="fit --model, with these effects, between the runs")
    p.add_argument(
        "--sequence",
        metavar="PLAN",
        help="tests in turn, by config/qualification_sequences; continues where it stopped",
    )
    p.add_argument("--acknowledge", default="", metavar="NAME", help="who releases the next test")
    p.add_argument("--acknowledge-all", default="", metavar="NAME", help="who releases all remaining tests")
    p.add_live()
    p.add_argument(
        "--from", dest="source", type=Path, metavar="DIR", help="check the recordings of a certificate again"
    )
    p.add_argument("--force", action="store_true", help="replace an existing DIR")
    given = p.read(arguments)
    if (given.required is None) == (given.source is None):
        raise ShakeError("give either a required spectrum or --from DIR")
    if given.source is not None:
        return _again(given.source)
    if given.out is None:
        raise ShakeError("give --out DIR, the folder for the certificate")
    options = {**p.options(given), "progress": lambda text, _: print(text)}
    return _test(given, options) if given.sequence is None else _sequence(given, options)


def _test(given: argparse.Namespace, options: Mapping[str, Any]) -> int:
    """One test and its certificate."""
    check_folder(given.out, given.force)
    try:
        with live(given) as table:
            result = qualify(
                given.required,
                record=None if given.record is None else accelerogram(given.record, given.channel),
                refit=given.refit,
                live=table,
                release=lambda state: released_by(state, given.acknowledge or given.acknowledge_all),
                **options,
            )
    except NotReleasedError as error:
        print(f"{error}; --acknowledge NAME names the person who releases it", file=sys.stderr)
        return 1
    result.report(given.out, given.force)
    print(result)
    print(f"certificate: {given.out / 'certificate.html'}, {given.out / 'certificate.pdf'}")
    if result.passed:
        print(f"passed in {_runs(result)}")
        return 0
    print(f"not passed: {result.reason or result.moved or 'a rule does not hold'}", file=sys.stderr)
    if given.refit is None:
        print("the drive was corrected; --refit EFFECT … fits the model to the runs instead", file=sys.stderr)
    return 1


def _sequence(given: argparse.Namespace, options: Mapping[str, Any]) -> int:
    """The tests of a sequence that can be run now."""
    if given.record is not None or given.refit is not None:
        raise ShakeError("--sequence cannot be combined with --record and --refit")
    if given.force:
        raise ShakeError("--sequence continues where it stopped and replaces nothing; remove the folder to start again")
    names = [given.acknowledge] if given.acknowledge else []

    def acknowledge(state: str) -> str:
        print(state)
        if given.acknowledge_all:
            return str(given.acknowledge_all)
        asked = not given.acknowledge and sys.stdin.isatty()
        return input("released by (empty: stop here): ").strip() if asked else names.pop() if names else ""

    with live(given) as table:
        found = qualify_sequence(given.required, given.out, acknowledge, plan=given.sequence, live=table, **options)
    return _report_sequence(found, given.out)


def _report_sequence(found: TestSequence, out: Path) -> int:
    """What came of a sequence, and the exit code."""
    for done in found.done:
        print(f"{done.stage.name}: {'passed' if done.test.passed else 'not passed'} in {_runs(done.test)}")
        for shift in found.shifts(done):
            print(f"  resonance since the first test: {shift}")
    print(f"sequence: {out / 'sequence.html'}")
    if found.passed:
        print(f"passed: {len(found.done)} of {len(found.plan.stages)} tests")
        return 0
    waits = "waits for an acknowledgement; --acknowledge NAME releases one test, --acknowledge-all NAME all"
    print(f"not passed: {found.reason}" if found.reason else waits, file=sys.stderr)
    return 1


def _runs(result: Qualification) -> str:
    """How many runs, in words."""
    return f"{len(result.runs)} {'run' if len(result.runs) == 1 else 'runs'}"


def _again(source: Path) -> int:
    """The verdicts of a certificate's recordings, and whether they agree with it."""
    if (source / FILE).is_file():
        found, differences = sequence_of(source)
        for line in differences:
            print(line, file=sys.stderr)
        if not differences:
            print(f"reproduced: {len(found.done)} tests, every file and every figure as certified")
        return 1 if differences else 0
    result, differences = certified(source)
    print(result)
    for line in differences:
        print(line, file=sys.stderr)
    if differences:
        return 1
    print(f"reproduced: {_runs(result)}, every file and every figure as certified")
    return 0
