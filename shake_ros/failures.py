"""Errors in the steps that follow a result: each is named, and the result stays, less what its step adds.

A search takes minutes. What it has found must not be lost to an error in a test of its residual or in a chart of its
page, so whoever writes a report spans a net under these steps. Whoever does not meets the error where it happens.
"""

from __future__ import annotations

import os
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

PACKAGE = f"shake_ros{os.sep}"


@dataclass(frozen=True)
class Failure:
    """A step that ended in an error. step : its name. cause : the error in one line. trace : where it came from."""

    step: str
    cause: str
    trace: tuple[str, ...]

    @classmethod
    def of(cls, step: str, error: Exception) -> Failure:
        """The failure of a step by an error that has been raised."""
        frames = traceback.extract_tb(error.__traceback__)
        own = [f for f in frames if PACKAGE in f.filename] or list(frames)
        where = f" ({os.path.basename(own[-1].filename)}, line {own[-1].lineno})" if own else ""
        said = " ".join(f"{type(error).__name__}: {error}".split()).rstrip(":")
        return cls(step, f"{said}{where}", tuple(f"{f.filename}:{f.lineno} {f.name}" for f in frames))

    def __str__(self) -> str:
        return f"the step '{self.step}' failed: {self.cause}"


class Failures:
    """The steps that failed, in their order.

    Parameters
    ----------
    raising : raise each error where it happens instead of noting it.

    Examples
    --------
    >>> failures = Failures()
    >>> with failures.step("margins"):
    ...     margin = 1 / 0
    >>> [failure.step for failure in failures], failures.all[0].cause.split(" (")[0]
    (['margins'], 'ZeroDivisionError: division by zero')
    """

    def __init__(self, raising: bool = False) -> None:
        self._raising = raising
        self._found: list[Failure] = []

    @property
    def all(self) -> tuple[Failure, ...]:
        """The failures so far."""
        return tuple(self._found)

    def __iter__(self) -> Iterator[Failure]:
        return iter(self._found)

    def __len__(self) -> int:
        return len(self._found)

    @contextmanager
    def step(self, name: str) -> Iterator[None]:
        """A step that may fail: what is made in it must have a value before."""
        try:
            yield
        except Exception as error:
            if self._raising:
                raise
            self._found.append(Failure.of(name, error))


RAISING = Failures(raising=True)
