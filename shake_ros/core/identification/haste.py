"""Whether fits are to end where they are: the minutes of a search are over, or someone has interrupted it.

A fit asks between its trial points, once it has a Jacobian. What asks is known within a context alone, so that one
search does not hurry another of the same process.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar


def never() -> bool:
    """Fits go on to their end."""
    return False


_ASKED: ContextVar[Callable[[], bool]] = ContextVar("asked", default=never)


def hurried() -> bool:
    """Whether a fit of this context is to end where it is."""
    return _ASKED.get()()


@contextmanager
def in_haste(asked: Callable[[], bool]) -> Iterator[None]:
    """Fits within end where they are once `asked` says so."""
    token = _ASKED.set(asked)
    try:
        yield
    finally:
        _ASKED.reset(token)
