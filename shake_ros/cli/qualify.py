"""qualify: from a required response spectrum to the certificate."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from shake_ros.api.live_table import NotReleasedError
from shake_ros.api.qualification import Qualification, certified
from shake_ros.api.qualify import qualify
from shake_ros.api.record_scale import accelerogram
from shake_ros.api.sequence import FILE, TestSequence, qualify_sequence, sequence_of
from shake_ros.cli.fitting import change
from shake_ros.cli.live import live, live_arguments, released_by
from shake_ros.core.quantities import ShakeError
from shake_ros.data.results import check_folder

METHOD = """\
RRS is a name of config/required_spectra or a YAML file: a code's formula, or points at any damping; its key `rules`
names the code that judges (config/qualification_rules). A motion with a strong part of 20 s is synthesised and matched
to it, refused where it does not fit the table, run on the simulated table and corrected until the test response
spectrum passes. With --live the table of the running graph (./shake lab) is moved instead, once somebody has released
the test: at the prompt, or by --acknowledge NAME. DIR gets certificate.html, certificate.pdf (A4), certificate.json
and the recordings with their SHA-256. Exit code 1 where the test did not pass, with the reason on the last line."""


def parser() -> argparse.ArgumentParser:
    """The command line."""
    p = argparse.ArgumentParser(
        prog="qualify",
        description="Qualify a specimen on the shaking table against a required response spectrum.",
        epilog=METHOD,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    p.add_argument("required", nargs="?", metavar="RRS", help="required spectrum: a known name or a YAML file")
    p.add_argument("--table", default="bergamo", help="the simulated table (default: bergamo)")
    p.add_argument("--set", nargs="+", action="extend", default=[], metavar="KEY=VALUE", help="change a value of it")
    p.add_argument("--model", help="identified table of the feedforward (default: --table as it is declared)")
    p.add_argument("--out", type=Path, metavar="DIR", help="folder for the certificate and the recordings")
    p.add_argument("--scale", type=float, default=1.0, help="factor on the required levels (default: 1)")
    p.add_argument("--rules", help="code that judges, in place of the one that RRS names")
    p.add_argument("--record", metavar="FILE", help="accelerogram to start from, in place of random phases")
    p.add_argument("--channel", type=int, default=0, help="its component, from 1, where it has several")
    p.add_argument("--refit", nargs="*", metavar="EFFECT", help="fit --model, with these effects, between the runs")
    p.add_argument("--runs", type=int, help="most runs (default: of config/qualification)")
    p.add_argument("--seed", type=int, default=0, help="of phases and sensor noise (default: 0)")
    p.add_argument("--delay", type=int, default=0, help="samples by which a command acts late (default: 0)")
    p.add_argument("--specimen", default="", help="what is tested, for the certificate")
    p.add_argument("--config", default="default", help="config/qualification/NAME.yaml or a file (default: default)")
    p.add_argument(
        "--sequence",
        metavar="PLAN",
        help="tests in turn, by config/qualification_sequences; goes on where it stopped",
    )
    p.add_argument("--acknowledge", default="", metavar="NAME", help="who releases the next test")
    p.add_argument("--acknowledge-all", default="", metavar="NAME", help="who releases all tests that are left")
    live_arguments(p)
    p.add_argument(
        "--from", dest="source", type=Path, metavar="DIR", help="judge the recordings of a certificate again"
    )
    p.add_argument("--force", action="store_true", help="replace an existing DIR")
    return p


def main(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    given = parser().parse_args(list(arguments))
    if (given.required is None) == (given.source is None):
        raise ShakeError("give either a required spectrum or --from DIR")
    if given.source is not None:
        return _again(given.source)
    if given.out is None:
        raise ShakeError("give --out DIR, the folder for the certificate")
    if given.sequence is not None:
        return _sequence(given)
    return _test(given)


def _test(given: argparse.Namespace) -> int:
    """One test and its certificate."""
    check_folder(given.out, given.force)
    try:
        with live(given) as table:
            result = qualify(
                given.required,
                given.table,
                record=None if given.record is None else accelerogram(given.record, given.channel),
                refit=given.refit,
                live=table,
                release=lambda state: released_by(state, given.acknowledge or given.acknowledge_all),
                **_asked(given),
            )
    except NotReleasedError as error:
        print(f"{error}; --acknowledge NAME says who releases it", file=sys.stderr)
        return 1
    result.report(given.out, given.force)
    print(result.verdicts)
    for when, found in (("before", result.before), ("after", result.after)):
        if found is not None:
            print(f"resonance {when} the test: {found}")
    print(f"certificate: {given.out / 'certificate.html'}, {given.out / 'certificate.pdf'}")
    if result.passed:
        print(f"passed in {_runs(result)}")
        return 0
    print(f"not passed: {result.reason or result.moved or 'a rule does not hold'}", file=sys.stderr)
    if given.refit is None:
        print("the drive was corrected; --refit EFFECT … fits the model to the runs instead", file=sys.stderr)
    return 1


def _asked(given: argparse.Namespace) -> dict[str, Any]:
    """What a test and a sequence of tests are both asked with."""
    return {
        "model": given.model,
        "rules": given.rules,
        "scale": given.scale,
        "set": dict(map(change, given.set)),
        "settings": given.config,
        "runs": given.runs,
        "seed": given.seed,
        "delay": given.delay,
        "specimen": given.specimen,
        "progress": lambda text, _: print(text),
    }


def _sequence(given: argparse.Namespace) -> int:
    """The tests of a sequence that can be run now."""
    if given.record is not None or given.refit is not None:
        raise ShakeError("--sequence goes without --record and --refit")
    if given.force:
        raise ShakeError("--sequence goes on where it stopped and replaces nothing; remove the folder to begin anew")
    names = [given.acknowledge] if given.acknowledge else []

    def acknowledge(state: str) -> str:
        print(state)
        if given.acknowledge_all:
            return str(given.acknowledge_all)
        asked = not given.acknowledge and sys.stdin.isatty()
        return input("released by (empty: stop here): ").strip() if asked else names.pop() if names else ""

    with live(given) as table:
        found = qualify_sequence(
            given.required,
            given.out,
            acknowledge,
            given.table,
            plan=given.sequence,
            live=table,
            **_asked(given),
        )
    return _told(found, given.out)


def _told(found: TestSequence, out: Path) -> int:
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
    """The verdicts of a certificate's recordings, and whether they are those that it tells."""
    if (source / FILE).is_file():
        found, differences = sequence_of(source)
        for line in differences:
            print(line, file=sys.stderr)
        if not differences:
            print(f"reproduced: {len(found.done)} tests, every file and every figure as certified")
        return 1 if differences else 0
    result, differences = certified(source)
    print(result.verdicts)
    for line in differences:
        print(line, file=sys.stderr)
    if differences:
        return 1
    print(f"reproduced: {_runs(result)}, every file and every figure as certified")
    return 0
