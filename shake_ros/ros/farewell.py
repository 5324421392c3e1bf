"""The end of a process whose nodes have finished, whatever the middleware does with it.

Fast DDS 3.2 may never come back from the destruction of a participant while peers leave as well: `set_listener` waits,
again and again and with the interpreter's lock, for a discovery callback that waits for the lock of `set_listener`. Of
graphs of seven nodes that end together on a busy machine, one in a hundred had such a node. No Python code runs any
more then, not even a signal's handler, so a timer of the C library ends the process.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from contextlib import contextmanager

CLOCK_MONOTONIC = 1
SIGEV_THREAD = 2


class _Event(ctypes.Structure):
    """`struct sigevent` of Linux: call `function(value)` in a thread of its own."""

    _fields_ = [
        ("value", ctypes.c_void_p), ("signal", ctypes.c_int), ("notify", ctypes.c_int),
        ("function", ctypes.c_void_p), ("attributes", ctypes.c_void_p), ("rest", ctypes.c_byte * 32),
    ]  # fmt: skip


class _Times(ctypes.Structure):
    """`struct itimerspec`: interval and first expiry."""

    _fields_ = [(name, ctypes.c_long) for name in ("again", "again_ns", "seconds", "nanoseconds")]


def _library() -> ctypes.CDLL | None:
    """The one with timers: libc, before glibc 2.34 librt; none elsewhere."""
    for name in (None, "librt.so.1"):
        try:
            found = ctypes.CDLL(name)
            found.timer_create  # noqa: B018  (is it there?)
        except (OSError, AttributeError):
            continue
        return found
    return None


@contextmanager
def ends_within(seconds: float, code: int = 0) -> Iterator[None]:
    """End this process with an exit code, there and then, where the block takes longer [s]."""
    library = _library()
    if library is None:
        yield
        return
    leave = ctypes.cast(ctypes.CDLL(None)._exit, ctypes.c_void_p)
    event = _Event(value=code, notify=SIGEV_THREAD, function=leave.value)
    timer = ctypes.c_void_p()
    if library.timer_create(CLOCK_MONOTONIC, ctypes.byref(event), ctypes.byref(timer)):
        yield
        return
    whole = int(seconds)
    times = _Times(seconds=whole, nanoseconds=int((seconds - whole) * 1e9))
    library.timer_settime(timer, 0, ctypes.byref(times), None)
    try:
        yield
    finally:
        library.timer_delete(timer)
