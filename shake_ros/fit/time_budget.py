"""The time budget of fits: they end where they are once it is over, or once someone has interrupted the search.

A fit asks between its trial points, once it has a Jacobian. The budget belongs to a context, so that one search does
not end the fits of another in the same process.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar


def never() -> bool:
    """Fits go on to their end."""
    return False


_OVER: ContextVar[Callable[[], bool]] = ContextVar("over", default=never)


def time_is_over() -> bool:
    """Whether the time budget of this context is over."""
    return _OVER.get()()


@contextmanager
def within_budget(over: Callable[[], bool]) -> Iterator[None]:
    """Fits within end where they are once `over` says so."""
    token = _OVER.set(over)
    try:
        yield
    finally:
        _OVER.reset(token)
