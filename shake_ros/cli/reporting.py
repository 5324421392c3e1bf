"""What commands share: charts as files and the line that made a report; recordings and what is taken of them."""

from __future__ import annotations

import argparse
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TypedDict

from shake_ros.api.read import Recordings, read
from shake_ros.core.quantities import ShakeError
from shake_ros.data.recordings.bag import SUFFIXES
from shake_ros.report.chart import FORMATS

CHOSEN = ("joint", "publishers", "covariance", "clock")  # kinds of findings on what was read in place of what


class Reporting(TypedDict):
    """Arguments of a result's `report`."""

    figures: str | None
    command: str


def add_figures(command: argparse.ArgumentParser) -> None:
    """The option --figures."""
    command.add_argument("--figures", choices=FORMATS, help="write the report's charts as files as well, for a paper")


def reporting(name: str, given: argparse.Namespace, arguments: Sequence[str]) -> Reporting:
    """What `report` is told."""
    return {"figures": given.figures, "command": shlex.join(["./shake", name, *map(str, arguments)])}


def add_take(command: argparse.ArgumentParser) -> None:
    """The option --take."""
    command.add_argument(
        "--take",
        action="append",
        default=[],
        metavar="SIGNAL=WHAT",
        help="of several, read this topic (/…), joint (name) or publisher (number): joint_states=x_axis; repeatable",
    )


def taken(given: argparse.Namespace) -> dict[str, list[str | int]]:
    """What --take names, by signal."""
    found: dict[str, list[str | int]] = {}
    for text in given.take:
        name, equals, what = text.partition("=")
        if not (equals and what):
            raise ShakeError(f"--take {text}: expected SIGNAL=WHAT, as joint_states=x_axis")
        found.setdefault(name, []).append(what)
    return found


def source(path: Path, given: argparse.Namespace) -> Recordings | Path:
    """A recording, whose choice of topic, joint, publisher and clock goes to standard error; or another file's path."""
    if path.is_file() and not path.name.endswith(SUFFIXES):
        return path
    runs = read(path, take=taken(given))
    for recording in runs:
        for finding in recording.findings:
            if finding.kind in CHOSEN:
                print(f"{recording.name}: {finding}", file=sys.stderr)
    return runs
