"""`--live` of a command: the table of the running graph, and the words for who has no ROS 2."""

from __future__ import annotations

import argparse
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from shake_ros.api.live_table import LiveTable
from shake_ros.core.quantities import ShakeError


def live_arguments(parser: argparse.ArgumentParser) -> None:
    """`--live` and `--namespace`."""
    parser.add_argument("--live", action="store_true", help="on the table of the running graph, enabled")
    parser.add_argument("--namespace", default="/shake", metavar="NS", help="of that graph (default: /shake)")


@contextmanager
def live(given: argparse.Namespace) -> Iterator[LiveTable | None]:
    """The live table where one is asked for; ShakeError where there is no graph, or none that may move."""
    if not given.live:
        yield None
        return
    try:
        from shake_ros.ros.live_table import live_table
    except ImportError as error:
        raise ShakeError(f"--live: needs ROS 2 ({error})") from None
    before = {number: signal.signal(number, _interrupted) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        with live_table(given.namespace) as table:
            yield table
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _interrupted(*_: object) -> None:
    """Ctrl-C, or the end of the command from outside: what plays comes to rest, what was set is set back."""
    raise KeyboardInterrupt


def released_by(state: str, name: str) -> str:
    """Who releases what is told; asked at the terminal where no name is given, empty where nobody is there."""
    print(state, flush=True)
    return name or (input("released by (empty: stop here): ").strip() if sys.stdin.isatty() else "")
