"""The engine of this machine: worker processes that die without taking anything along but their own task.

Each worker sits behind a `ProcessPoolExecutor` of its own. One executor with several workers (that of the standard
library, loky's) fails every task in flight when one of them dies, and pebble's workers share one pipe, where a task
that is read but not yet acknowledged is lost with its worker. Here a death breaks one executor of one worker: its task
is known, and the next one gets a fresh worker.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing.connection import Connection
from queue import SimpleQueue
from typing import ParamSpec, TypeVar

from shake_ros.core.quantities import ShakeError

P = ParamSpec("P")
T = TypeVar("T")
ONE_THREAD = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")  # read at the start
SPAWN = multiprocessing.get_context("spawn")  # a fork would copy the locks of threads that are running
_starting = threading.Lock()


class WorkerDied(Exception):
    """The process that worked on a task has died."""


class ProcessWorkers(ThreadPoolExecutor):
    """An executor whose calls run in processes, one call at a time in each; a thread waits beside each process.

    A call whose process dies fails with WorkerDied; all others go on. Processes end with the executor, and with the
    process that made it, however that ends.

    Parameters
    ----------
    count : of processes.
    """

    def __init__(self, count: int) -> None:
        super().__init__(count, thread_name_prefix="worker")
        self._seats: SimpleQueue[_Seat] = SimpleQueue()
        self._all = [_Seat() for _ in range(count)]
        for seat in self._all:
            self._seats.put(seat)

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """A call in one of the processes; it and what it returns are pickled."""
        return super().submit(self._elsewhere, fn, *args, **kwargs)

    def _elsewhere(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> T:
        seat = self._seats.get()
        try:
            return seat.call(fn, *args, **kwargs)
        finally:
            self._seats.put(seat)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the processes; with `cancel_futures` at once, whatever they do."""
        if cancel_futures:
            for seat in self._all:
                seat.end(at_once=True)
        super().shutdown(wait, cancel_futures=cancel_futures)
        for seat in self._all:
            seat.end()


class _Seat:
    """A place for one worker process, and the executor in front of it."""

    def __init__(self) -> None:
        self._pool: ProcessPoolExecutor | None = None
        self._life: Connection | None = None  # the process ends when this is closed
        self._over = False
        self._changing = threading.Lock()

    def call(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> T:
        try:
            future = self._begun(fn, *args, **kwargs)
        except BrokenProcessPool:  # it died while it had nothing to do
            self._pool = None
            future = self._begun(fn, *args, **kwargs)
        try:
            return future.result()
        except BrokenProcessPool:
            self._pool = None
            raise WorkerDied from None

    def _begun(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """A call given to a process that runs."""
        pool = self._taken()
        try:
            return pool.submit(fn, *args, **kwargs)
        except RuntimeError:  # of a broken executor, or of one that is shut down
            if self._over:
                raise WorkerDied from None
            raise

    def _taken(self) -> ProcessPoolExecutor:
        """The executor of a process that runs."""
        if self._pool is None and not self._over:
            _, life = self._emptied()
            if life is not None:
                life.close()
            watched, self._life = SPAWN.Pipe(duplex=False)
            fresh = ProcessPoolExecutor(1, mp_context=SPAWN, initializer=_begin, initargs=(watched,))
            with _starting, _quiet_start():
                begun = fresh.submit(os.getpid)
            try:
                begun.result()
            except BrokenProcessPool:
                if self._over:
                    raise WorkerDied from None
                raise ShakeError(
                    "a worker process cannot start: what it printed says why; in a script of your own, call it "
                    'beneath `if __name__ == "__main__":`'
                ) from None
            finally:
                watched.close()
            self._pool = fresh
        pool = self._pool
        if self._over or pool is None:
            self.end(at_once=True)
            raise WorkerDied
        return pool

    def end(self, *, at_once: bool = False) -> None:
        """Let the process end when it has done what it does, or at once."""
        self._over = True
        pool, life = self._emptied()
        if at_once and life is not None:
            life.close()
        if pool is not None:
            pool.shutdown(cancel_futures=True)
        if life is not None:
            life.close()

    def _emptied(self) -> tuple[ProcessPoolExecutor | None, Connection | None]:
        """What the seat held, for one caller alone: the thread of a call ends its seat too."""
        with self._changing:
            held = self._pool, self._life
            self._pool = self._life = None
        return held


@contextmanager
def _quiet_start() -> Iterator[None]:
    """Processes started in the block have one thread of BLAS, and no Ctrl-C before they say what it is to do.

    One thread, so that sums are made in one order whatever the machine.
    """
    before = {name: os.environ.get(name) for name in ONE_THREAD}
    os.environ.update(dict.fromkeys(ONE_THREAD, "1"))
    signals = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, signals)
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _begin(watched: Connection) -> None:
    """In a worker: Ctrl-C is for the process that gives the work, whose end is the worker's own."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})

    def watch() -> None:
        try:
            watched.recv()  # nothing comes; it returns when the other end is closed, if only by a death
        except (EOFError, OSError):
            os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
