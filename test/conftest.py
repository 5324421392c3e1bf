"""Fixtures of the suite: foreign data, a ROS domain of one's own, and the check that no process stays behind."""

from __future__ import annotations

import fcntl
import itertools
import os
import signal
import tempfile
import time
import uuid
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
MARK = "SHAKE_ROS_TEST_SESSION"
LOWEST_DOMAIN, HIGHEST_DOMAIN = 1, 100
GRACE = 3.0  # seconds that a process may take to end after its test

os.environ.setdefault("PYTHONHASHSEED", "0")
os.environ.setdefault("MPLBACKEND", "Agg")
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
os.environ[MARK] = uuid.uuid4().hex  # every process that a test starts inherits it and can be found by it

_turn = itertools.count(os.getpid())


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder of measured data beside the repository; the test is skipped where it is absent."""
    folder = ROOT.parent / "shared"
    if not (folder / "measured").is_dir():
        pytest.skip("needs the measured data folder ../shared beside the repository, which is not here")
    return folder


@pytest.fixture
def ros_domain() -> Iterator[int]:
    """A ROS domain that no other test, no other run of the suite and nothing else on this machine uses.

    It is set in the environment, traffic stays on this machine, and the test fails where a process outlives it.
    """
    yield from _own_domain()


@pytest.fixture(scope="module")
def shared_ros_domain() -> Iterator[int]:
    """The same for the tests of a module that look at one graph."""
    yield from _own_domain()


def _own_domain() -> Iterator[int]:
    domain, lock = _reserve_domain()
    try:
        with pytest.MonkeyPatch.context() as environment:
            environment.setenv("ROS_DOMAIN_ID", str(domain))
            yield domain
        left = _wait_for_end(f"ROS_DOMAIN_ID={domain}")
    finally:
        os.close(lock)
    if left:
        pytest.fail(f"left behind: {'; '.join(left)}")


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session: pytest.Session) -> None:
    if session.config.getoption("numprocesses", None):  # each worker has looked after its own
        return
    left = _wait_for_end()
    if left:
        print(f"\nERROR: processes left behind by the tests (ended now): {'; '.join(left)}")
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def _reserve_domain() -> tuple[int, int]:
    """A free domain and the open lock file that keeps it, until that is closed or this process ends."""
    busy = _udp_ports()
    count = HIGHEST_DOMAIN - LOWEST_DOMAIN + 1
    for _ in range(2 * count):
        domain = LOWEST_DOMAIN + next(_turn) % count
        first_port = 7400 + 250 * domain  # the DDS port numbers of a domain
        if any(first_port <= port < first_port + 250 for port in busy):
            continue
        path = Path(tempfile.gettempdir()) / f"shake_ros-test-domain-{domain}-{os.getuid()}.lock"
        lock = os.open(path, os.O_RDWR | os.O_CREAT, 0o600)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            os.close(lock)
            continue
        return domain, lock
    raise RuntimeError("no ROS domain is free on this machine")


def _udp_ports() -> set[int]:
    ports = set()
    for table in (Path("/proc/net/udp"), Path("/proc/net/udp6")):
        if table.is_file():
            ports |= {int(line.split()[1].rsplit(":", 1)[1], 16) for line in table.read_text().splitlines()[1:]}
    return ports


def _wait_for_end(setting: str = "") -> list[str]:
    """Command lines of the processes that the tests started (with `setting` in their environment) and that stay.

    They get GRACE seconds, then they are killed.
    """
    deadline = time.monotonic() + GRACE
    while (left := _started_here(setting)) and time.monotonic() < deadline:
        time.sleep(0.05)
    for process in left:
        try:
            os.kill(process, signal.SIGKILL)
        except ProcessLookupError:
            continue
    return [f"{process} {name}" for process, name in left.items()]


def _started_here(setting: str) -> dict[int, str]:
    wanted = {f"{MARK}={os.environ[MARK]}", setting} - {""}
    found = {}
    for folder in Path("/proc").glob("[0-9]*"):
        if int(folder.name) == os.getpid():
            continue
        try:
            environment = set((folder / "environ").read_bytes().decode(errors="replace").split("\0"))
            command = (folder / "cmdline").read_bytes().decode(errors="replace").replace("\0", " ").strip()
        except OSError:  # ended meanwhile, or another user's
            continue
        if wanted <= environment and "multiprocessing.resource_tracker" not in command:
            found[int(folder.name)] = command[:200]
    return found
