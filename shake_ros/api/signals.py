"""What an analysis of one recording takes, and the errors that name it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Protocol, TypeAlias, runtime_checkable

from shake_ros.api.read import Recordings
from shake_ros.core.quantities import ShakeError
from shake_ros.data.recordings import TableRecording, read_table_recording


@runtime_checkable
class Recorded(Protocol):
    """A result that can be looked at as a recording, such as a simulation's."""

    @property
    def recordings(self) -> Recordings:
        """It as recordings."""


Source: TypeAlias = str | Path | TableRecording | Recordings | Recorded


def one_recording(source: Source) -> TableRecording:
    """The one recording that a path, recordings or a simulation stand for.

    Raises
    ------
    ShakeError : it cannot be read, or there are several.
    """
    if isinstance(source, str | Path):
        return read_table_recording(source)
    found = source.recordings if isinstance(source, Recorded) else source
    if isinstance(found, TableRecording):
        return found
    if len(found) != 1:
        raise ShakeError(f"one recording is needed, {len(found)} are given: {', '.join(found.names)}")
    return found[0]


@contextmanager
def naming(source: Source) -> Iterator[None]:
    """Errors in the block begin with the recording's path, or its name where it was not read here."""
    try:
        yield
    except ShakeError as error:
        where = source if isinstance(source, str | Path) else one_recording(source).name
        raise ShakeError(f"{where}: {error}") from None
