"""What the page asks of the graph, which the node in ros/ answers, and of `lab`; what the twin has published.

The line between `lab` and its page is JSON, a line each, over a socket in a folder that only this user can enter.
"""

from __future__ import annotations

import contextlib
import json
import socket
from collections.abc import Mapping, Sequence
from concurrent.futures import Future
from pathlib import Path
from typing import Any, NamedTuple, Protocol


class Answer(NamedTuple):
    """How a request ended, and a line on it for the operator."""

    done: bool
    text: str


class Desk(Protocol):
    """The graph as the server sees it; everything may be called from any thread. namespace : of its nodes."""

    namespace: str

    def status(self) -> dict[str, Any]:
        """What changes: nodes, interlock, trips, harmonics, processes, recording."""
        ...

    def parameters(self) -> dict[str, list[dict[str, Any]]]:
        """Node → parameters with value, unit, range, meaning, and whether they are live."""
        ...

    def twin(self) -> dict[str, Any]:
        """What the twin has found: see `TwinHistory`."""
        ...

    def ask(self, what: str, **how: Any) -> Future[Answer]:
        """`enable`, `stop`, `reset`, `set`, `record`, `stop_recording`, `restart`, `table`, `model`."""
        ...


LARGEST = 1 << 20  # bytes of a line


class Line:
    """One end of the line: what came in as whole messages, what goes out without waiting."""

    def __init__(self, end: socket.socket) -> None:
        end.setblocking(False)
        self.end = end
        self._rest = b""
        self.open = True

    def send(self, message: dict[str, Any]) -> None:
        """One message; where the other end is gone, nothing."""
        try:
            self.end.settimeout(1.0)
            self.end.sendall(json.dumps(message).encode() + b"\n")
        except OSError:
            self.open = False
        finally:
            with contextlib.suppress(OSError):
                self.end.setblocking(False)

    def take(self) -> list[dict[str, Any]]:
        """All messages that have come."""
        while self.open:
            try:
                data = self.end.recv(65536)
            except BlockingIOError:
                break
            except OSError:
                data = b""
            self.open = bool(data) and len(self._rest) < LARGEST
            self._rest += data
        *whole, self._rest = self._rest.split(b"\n")
        return [json.loads(line) for line in whole]

    def close(self) -> None:
        """Hang up."""
        self.open = False
        self.end.close()


class Exchange:
    """The lab's end: one page at a time, the newest."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / "lab"
        self.listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self.listener.bind(str(self.path))
        self.listener.listen(1)
        self.listener.setblocking(False)
        self.line: Line | None = None

    def take(self) -> list[dict[str, Any]]:
        """What the page asks for."""
        with contextlib.suppress(BlockingIOError):
            end, _ = self.listener.accept()
            self.line = Line(end)
        return self.line.take() if self.line else []

    def send(self, message: dict[str, Any]) -> None:
        """To the page, where there is one."""
        if self.line and self.line.open:
            self.line.send(message)

    def close(self) -> None:
        """No more pages."""
        if self.line:
            self.line.close()
        self.listener.close()


def call_lab(path: str) -> Line:
    """The page's end."""
    end = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    end.connect(path)
    return Line(end)


MOST = 400  # windows that are kept; of the older ones every other, again and again


class TwinStatus(NamedTuple):
    """A status of the topic `twin`. name : behind `twin`; text : for a person; values : by key."""

    name: str
    level: int
    text: str
    values: Mapping[str, str]


class TwinHistory:
    """Filled by the node, read by the server's thread."""

    def __init__(self) -> None:
        # ends of the windows since the reference [s], parameters with their curves, changes
        self.content: dict[str, Any] = {"time": [], "parameters": [], "changes": []}

    def add(self, stamp: float, statuses: Sequence[TwinStatus]) -> None:
        """A window: its end [s]; statuses of table, parameters and changes. A new reference begins anew."""
        from shake_ros.report.text import unit_of  # slow to import

        found: dict[str, Any] = {"time": [], "parameters": [], "changes": []}
        table, *rest = statuses
        if table.values["state"] != "learning":
            before = self.content
            kept = slice(None, None, 1 if len(before["time"]) < MOST else 2)
            found["time"] = [*before["time"][kept], stamp]
            past = {one["name"]: one for one in before["parameters"]}
            for name, level, text, values in rest:
                if "since" in values:
                    found["changes"].append({**values, "level": level, "since": int(values["since"]) * 1e-9})
                    continue
                factor, unit = unit_of(values["unit"])
                curves = {
                    key: [*past.get(name, {key: []})[key][kept], float(f"{factor * float(values[key]):.6g}")]
                    for key in ("value", "low", "high")
                }
                found["parameters"].append({"name": name, "unit": unit, "text": text, **curves})
        self.content = found
