"""The command `follow`."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from shake_ros.api.read import read
from shake_ros.cli.arguments import add_figures, add_take, reporting, taken
from shake_ros.data.result_folder import check_folder
from shake_ros.twin.follow import follow

METHOD = """\
The found model runs beside the recordings, corrected towards the sensors. The first seconds of motion show what is
normal; from then on each window of two seconds corrects the slow parameters of the table (flow gain, hydraulic
stiffness, leakage, friction, null shift, mass, delays, sensors) and is tested for a change. A change is named by the
effects that close_loop knows: value, 90 % interval, since when, what else it may be; or that no effect explains it.
DIR gets report.html, report.json and table.yaml, the table as it is known at the end."""


def follow_command(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    p = argparse.ArgumentParser(
        prog="follow",
        description="Follow the parameters of a found table over recordings: what changed, since when, by how much.",
        epilog=METHOD,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    p.add_argument("recordings", nargs="+", metavar="RECORDING", help="recordings of one table in the order of time")
    p.add_argument("--table", required=True, metavar="FILE", help="table.yaml of close_loop, or a name of config/table")
    p.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder of the report")
    p.add_argument("--config", default="default", help="config/twin/NAME.yaml or a file (default: default)")
    add_take(p)
    add_figures(p)
    p.add_argument("--force", action="store_true", help="replace an existing DIR")
    given = p.parse_args(list(arguments))
    check_folder(given.out, given.force)
    found = follow(read(*given.recordings, take=taken(given)), given.table, settings=given.config)
    found.report(given.out, given.force, **reporting("follow", given, arguments))
    print("\n".join(found.lines))
    print(f"report: {given.out / 'report.html'}")
    return 0
