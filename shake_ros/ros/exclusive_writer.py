"""One writer a topic, one node a name: who comes second on this machine is refused before it says anything.

Each name is held by a socket in the abstract namespace of Linux, which has no file and goes with its process, however
that ends; so a node that was killed can start again at once, while discovery still counts it. Where there is no such
namespace nothing is refused. A writer on another machine is found by discovery when the node is to start (`elsewhere`).
"""

from __future__ import annotations

import errno
import hashlib
import socket
import struct
import sys
import time
from collections.abc import Callable
from typing import Any

from shake_ros.quantities import ShakeError

LEASE = 4.0  # a writer that was killed counts for 3 s more (config/fastdds_network.xml)
OTHER = "another graph of these names? End it, or give this one a namespace: --ros-args -r __ns:=/other"


class ExclusiveWriter:
    """The names that one node alone has in a ROS domain: its own and its topics'."""

    def __init__(self, domain: int) -> None:
        self._domain = domain
        self._held: dict[tuple[str, str], socket.socket] = {}

    def take(self, kind: str, name: str) -> None:
        """Take the `node` or `topic` of this full name; ShakeError where a running node has it."""
        if sys.platform != "linux":
            return
        address = "\0shake_ros " + hashlib.sha256(f"{self._domain} {kind} {name}".encode()).hexdigest()
        held = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            held.bind(address)
            held.listen()
        except OSError as error:
            held.close()
            if error.errno != errno.EADDRINUSE:
                return
            holder = _holder(address)
            if holder is None:
                return self.take(kind, name)
            verb = "runs" if kind == "node" else "is published"
            raise ShakeError(f"{kind} {name} {verb} already, by process {holder}: {OTHER}") from None
        self._held[kind, name] = held

    def elsewhere(self, node: Any, wait: Callable[[], None]) -> None:
        """ShakeError where discovery finds another writer of a topic taken here that does not go within LEASE."""
        deadline = time.monotonic() + LEASE
        while found := [name for kind, name in self._held if kind == "topic" and node.count_publishers(name) > 1]:
            if time.monotonic() > deadline:
                raise ShakeError(f"topic {found[0]} is published already, beyond this machine: {OTHER}")
            wait()

    def give_up(self) -> None:
        """Let another node have it all."""
        for held in self._held.values():
            held.close()
        self._held.clear()


def _holder(address: str) -> int | None:
    """Process that holds a name; None where it has just gone."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as asking:
        try:
            asking.connect(address)
        except OSError:
            return None
        return int(struct.unpack("3i", asking.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, 12))[0])
