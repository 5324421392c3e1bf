"""What every command with a report shares: static copies of its charts, and the line that made it."""

from __future__ import annotations

import argparse
import shlex
from collections.abc import Sequence
from typing import TypedDict

from shake_ros.report.chart import FORMATS


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
