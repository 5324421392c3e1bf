"""The suite's two tiers, and which of its tests share the machine.

`./shake test` leaves what is marked `second_tier`; `./shake test --all` runs that too. In parallel each worker takes
a file at a time; files that look at the same search of a model go to one worker, so that it is made once. A test
marked `alone` judges what keeps real time, and waits until the other workers pause.
"""

from __future__ import annotations

import fcntl
import os
import tempfile
import time
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parent
ORDER = (  # the first needs nothing compiled, so that one worker alone compiles what the other folders share
    *("test/recordings", "test/cli", "test/api", "test/ros", "test/search", "test/repair", "test/fit"),
    *("test/report", "test/benchmarks"),
)
SHARED = "closed_loops"  # a module whose searches are kept for the length of a process
TURN = "SHAKE_ROS_TEST_TURN"  # where the second tier begins when it has not time for all
LEFT = pytest.StashKey[int]()
DEADLINE = pytest.StashKey[float]()


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--all", action="store_true", help="the second tier too: real time, browser, long searches …")
    parser.addoption("--minutes", type=float, metavar="N", help="skip what has not begun N minutes after the start")


def pytest_configure(config: pytest.Config) -> None:
    config.stash[LEFT] = 0
    os.environ.setdefault(TURN, str(int(time.time())))  # the workers inherit it
    if (minutes := config.getoption("minutes")) is not None:
        config.stash[DEADLINE] = float(os.environ[TURN]) + 60.0 * minutes


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if not config.getoption("all"):
        left = [item for item in items if item.get_closest_marker("second_tier")]
        config.stash[LEFT] = len(left)
        config.hook.pytest_deselected(items=left)
        items[:] = [item for item in items if not item.get_closest_marker("second_tier")]
    if DEADLINE in config.stash:  # another file first each time
        files = list(dict.fromkeys(_group(item.nodeid) for item in items))
        turn = int(os.environ[TURN]) % max(len(files), 1)
        places = {file: (place - turn) % len(files) for place, file in enumerate(files)}
        items.sort(key=lambda item: places[_group(item.nodeid)])
    elif len({item.path for item in items}) > 1:
        items.sort(key=lambda item: _place(item.nodeid))


@cache
def _group(name: str) -> str:
    """The work unit of a test: its file, or what several files share."""
    file = name.split("::")[0]
    return SHARED if SHARED in (ROOT / file).read_text(encoding="utf-8") else file


@cache
def _place(name: str) -> int:
    """Where a test stands in the order of the folders."""
    if _group(name) == SHARED:
        return -1
    return next((place for place, folder in enumerate(ORDER) if name.startswith(folder)), len(ORDER))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """A file at a time, in the order of the collection; a test with which its worker ended is not run again."""
    from xdist.scheduler import LoadScopeScheduling

    class ByGroup(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            return _group(nodeid)

        @property
        def tests_finished(self) -> bool:
            return not self.workqueue and super().tests_finished

        def remove_node(self, node: Any) -> str | None:
            units = self.assigned_work[node]
            left = [(unit, name) for unit in units.values() for name, over in unit.items() if not over]
            for unit, name in left[:1]:
                unit[name] = True
            self.assigned_work[node] = {scope: unit for scope, unit in units.items() if not all(unit.values())}
            super().remove_node(node)
            return left[0][1] if left else None

    config.option.loadscopereorder = False
    return ByGroup(config, log)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    """Side by side with the tests of other workers, or alone. Who waits for the machine lets nobody pass."""
    if "PYTEST_XDIST_WORKER" not in os.environ:
        return (yield)
    alone = item.get_closest_marker("alone") is not None
    locks = Path(tempfile.gettempdir()) / f"shake_ros-test-machine-{os.getuid()}"
    with open(f"{locks}.door", "a") as door, open(f"{locks}.lock", "a") as machine:
        fcntl.flock(door, fcntl.LOCK_EX)
        fcntl.flock(machine, fcntl.LOCK_EX if alone else fcntl.LOCK_SH)
        fcntl.flock(door, fcntl.LOCK_UN)
        return (yield)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    if time.time() > item.config.stash.get(DEADLINE, float("inf")):
        pytest.skip("the time that was given is over")


def pytest_sessionfinish(session: pytest.Session) -> None:
    if (output := getattr(session.config, "workeroutput", None)) is not None:
        output["left"] = session.config.stash[LEFT]


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any) -> None:
    node.config.stash[LEFT] = getattr(node, "workeroutput", {}).get("left", 0)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    if left := terminalreporter.config.stash[LEFT]:
        terminalreporter.write_line(f"{left} tests of the second tier were left out: ./shake test --all runs them too")
