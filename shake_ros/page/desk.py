"""What the page wants of the graph. The node in ros/ answers; the server knows no more of it than this."""

from __future__ import annotations

from concurrent.futures import Future
from typing import Any, NamedTuple, Protocol


class Answer(NamedTuple):
    """How a request ended, and a line on it for the operator."""

    done: bool
    text: str


class Desk(Protocol):
    """The graph as the server sees it; everything may be called from any thread."""

    def status(self) -> dict[str, Any]:
        """What changes: nodes, interlock, trips, harmonics, processes, recording."""
        ...

    def parameters(self) -> dict[str, list[dict[str, Any]]]:
        """Node → parameters with value, unit, range, meaning, and whether they are live."""
        ...

    def ask(self, what: str, **how: Any) -> Future[Answer]:
        """`enable`, `stop`, `reset`, `set`, `record`, `stop_recording`, `restart`, `table`, `model`."""
        ...
