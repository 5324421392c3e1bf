"""Which number a process has among those of its ROS domain: one that nobody has, nor has had and left behind.

A process that ends by SIGKILL leaves its port of Fast DDS's shared-memory transport behind. Whoever wrote to it goes on
writing there; a new process with the same number is not heard for many seconds, or ever. Fast DDS would take the first
number whose UDP ports are free, which is that of the killed one. The profiles of config/ read the number from the
environment.
"""

from __future__ import annotations

import itertools
import os
import socket
from contextlib import suppress
from pathlib import Path

VARIABLE = "SHAKE_ROS_PARTICIPANT"
ANY_NUMBER = -1  # Fast DDS takes the first
NUMBERS = 100  # as many as the profiles' `maxInitialPeersRange`
MEMORY = Path("/dev/shm")
LOOPBACK = "127.0.0.1"
BASE, GAIN, DISCOVERY, DATA, STEP = 7400, 250, 10, 11, 2  # port numbers of the DDS standard

_turn = itertools.count(os.getpid())


def domain_of(given: int | None) -> int:
    """The domain that is meant: given, of the environment, or 0."""
    text = os.environ.get("ROS_DOMAIN_ID", "")
    return given if given is not None else int(text) if text.isdigit() else 0


def _is_free(port: int) -> bool:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        try:
            one.bind((LOOPBACK, port))
        except OSError:
            return False
    return True


def _left_behind(port: int, folder: Path) -> list[Path]:
    """Files of a port in shared memory."""
    return [path for path in (folder / f"fastdds_port{port}", folder / f"fastdds_port{port}_el") if path.exists()]


def choose(domain: int, folder: Path = MEMORY) -> int:
    """A free number; where only those of the killed are left, one of these, after what it left is removed.

    Two processes that start at once begin to look at different places.
    """
    first = BASE + GAIN * domain
    start = next(_turn)
    numbers = [(start + k) % NUMBERS for k in range(NUMBERS)]
    free = [n for n in numbers if _is_free(first + DISCOVERY + STEP * n) and _is_free(first + DATA + STEP * n)]
    for number in free:
        if not _left_behind(first + DATA + STEP * number, folder):
            return number
    number = free[0] if free else numbers[0]
    for path in _left_behind(first + DATA + STEP * number, folder):
        with suppress(OSError):
            path.unlink()
    return number
