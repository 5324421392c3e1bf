"""iterate: the drive of the next run from the acceleration that the last one missed."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from shake_ros.api.iterate import iterate, iterate_simulated
from shake_ros.api.iterated import Iterated
from shake_ros.api.own_loop import OWN
from shake_ros.api.read import read
from shake_ros.api.simulated_table import SimulatedTable
from shake_ros.cli.fitting import change
from shake_ros.cli.reporting import add_figures, add_take, reporting, taken
from shake_ros.core.quantities import ShakeError

METHOD = """\
BAG… are runs of the same motion, oldest first, each recorded from the start of its reference, with imu and reference.
DIR gets report.html, drive.csv (time and acceleration) and drive.yaml, a reference: -p reference:=DIR/drive.yaml
plays it.
With --simulate the runs are made on the closed loop of the core, under gains that are made for the table, and the
response spectra are in the report; the specimen is weighed by the forces of the first run, and DIR gets model.yaml.
Runs are ranked by what they missed within the band; exit code 1 where they diverge or have not converged, with the
effect that the model lacks, as close_loop finds it in the runs.
With --refit the motion stays as it is and the model of the feedforward is fitted to the last run, the parameters of
config/identification/full.yaml and those of the named effects; DIR gets model.yaml, which the controller's and the
observer's configurations name as their model for the next run."""


def parser() -> argparse.ArgumentParser:
    """The command line."""
    p = argparse.ArgumentParser(
        prog="iterate",
        description="Correct the drive of a shaking table by what the last run missed.",
        epilog=METHOD,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    p.add_argument("bags", nargs="*", metavar="BAG", type=Path)
    add_take(p)
    p.add_argument("--wanted", required=True, metavar="REFERENCE", help="the motion that the table should make")
    p.add_argument("--out", required=True, metavar="DIR", type=Path)
    p.add_argument("--config", default="default", help="config/iteration/NAME.yaml or a file (default: default)")
    p.add_argument("--simulate", type=int, metavar="N", help="make at most N runs on the simulated table")
    p.add_argument("--table", default="bergamo", help="with --simulate: the table (default: bergamo)")
    p.add_argument(
        "--set", nargs="+", action="extend", default=[], metavar="KEY=VALUE", help="with --simulate: change it"
    )
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
    p.add_argument("--force", action="store_true", help="replace an existing DIR")
    add_figures(p)
    return p


def main(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    given = parser().parse_args(list(arguments))
    if bool(given.bags) == (given.simulate is not None):
        raise ShakeError("give either recordings or --simulate N")
    result = _from_recordings(given) if given.simulate is None else _simulated(given)
    result.report(given.out, given.force, **reporting("iterate", given, arguments))
    if given.simulate is not None:
        return _told(result)
    for path, error in zip(given.bags, result.missed, strict=True):
        print(f"{path}: acceleration missed by {100.0 * error:.2f} % within the band")
    if result.factor < 1.0:
        print(f"the next drive was scaled by {result.factor:.3f} to stay within its limits")
    if result.drive is not None:
        print(f"next drive: {given.out / 'drive.yaml'}")
    else:
        print(f"model of the next run: {given.out / 'model.yaml'}")
    return _told(result)


def _told(result: Iterated) -> int:
    """What is wrong, why, and what to do, on standard error; the exit code."""
    if not result.wrong:
        return 0
    print(f"the iteration {result.wrong}", file=sys.stderr)
    if result.first_model is None:
        print("--model TABLE names the table as it is known; what it lacks is then sought in the runs", file=sys.stderr)
    else:
        print("close_loop on the runs, for what the model lacks; a minute or more", flush=True)
        print(result.lacking(progress=False), file=sys.stderr)
    return 1


def _from_recordings(given: argparse.Namespace) -> Iterated:
    runs = read(*given.bags, take=taken(given))
    if given.refit is not None:
        for finding in runs[-1:].findings:
            print(finding, file=sys.stderr)
    return iterate(given.wanted, runs, settings=given.config, model=given.model, refit=given.refit)


def _simulated(given: argparse.Namespace) -> Iterated:
    table = SimulatedTable(
        given.table,
        given.observer,
        given.controller,
        given.delay,
        progress=lambda text, _: print(text),
        changes=dict(map(change, given.set)),
    )
    more = {"settings": given.config, "model": given.model, "refit": given.refit}
    result = iterate_simulated(given.wanted, table, runs=given.simulate, **more)
    best = f"run {result.best + 1}, which missed {100.0 * result.missed[result.best]:.2f} % within the band"
    print(f"{result.reason}; the best is {best}")
    return result
