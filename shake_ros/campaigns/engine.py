"""Which engine: the cores of this machine, or a cluster by its address; both as `concurrent.futures.Executor`.

On this machine each worker sits behind a `ProcessPoolExecutor` of its own. One executor with several workers (that of
the standard library, loky's) fails every task in flight when one of them dies, and pebble's workers share one pipe,
where a task that is read but not yet acknowledged is lost with its worker. Here a death breaks one executor of one
worker: its task is known, and the next one gets a fresh worker.

A cluster is a running Dask scheduler. Needs `pip install 'shake_ros[cluster]'`.
"""

from __future__ import annotations

import ipaddress
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing.connection import Connection
from queue import SimpleQueue
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar
from urllib.parse import urlsplit

from shake_ros.core.plant.simulation import workers as cores
from shake_ros.core.quantities import ShakeError, shown

if TYPE_CHECKING:
    from distributed import Client


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
                    "a worker process cannot start: see what it printed; in a script of your own, call it "
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


WAIT = 20.0  # for the scheduler's answer [s]


def check_address(address: str) -> None:
    """Refuse what is not `tls://HOST:PORT`, or `tcp://HOST:PORT` on this machine.

    >>> check_address("tcp://10.0.0.5:8786")
    Traceback (most recent call last):
        ...
    shake_ros.core.quantities.ShakeError: tcp://10.0.0.5:8786: not encrypted and not on this machine; use tls://
    """
    try:
        parts = urlsplit(address)
        complete = bool(parts.scheme in ("tls", "tcp") and parts.hostname and parts.port and not parts.path)
    except ValueError:
        complete = False
    if not complete:
        raise ShakeError(f"engine {shown(address)}: is neither tls://HOST:PORT nor tcp://HOST:PORT on this machine")
    if parts.scheme == "tcp" and not is_loopback(parts.hostname or ""):
        raise ShakeError(f"{address}: not encrypted and not on this machine; use tls://")


def is_loopback(host: str) -> bool:
    """Whether a host is this machine, by a name or number that no other can have.

    >>> is_loopback("127.0.0.1"), is_loopback("::1"), is_loopback("localhost"), is_loopback("localhost.example.org")
    (True, True, True, False)
    """
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def connect(address: str) -> Client:
    """A client of the scheduler, whose workers are encrypted too, or on this machine.

    The certificates of tls:// are those of Dask's own configuration (`distributed.comm.tls`).

    Raises
    ------
    ShakeError : the address is refused, Dask is not installed, certificates are missing, nobody answers.
    """
    check_address(address)
    try:
        from distributed import Client, Security
    except ModuleNotFoundError as error:
        if error.name not in ("distributed", "dask"):
            raise
        raise ShakeError(
            "--engine needs the Python package 'distributed', which is not installed: pip install 'shake_ros[cluster]'"
        ) from None
    try:
        security = Security(require_encryption=True) if address.startswith("tls:") else None
        client = Client(address, security=security, timeout=WAIT, set_as_default=False)
    except (OSError, ValueError, TypeError, RuntimeError) as error:
        reason = next((line for line in str(error).splitlines() if line.strip()), type(error).__name__)
        raise ShakeError(f"engine {address}: no connection ({reason})") from None
    refused = [worker for worker in client.nthreads() if not _private(worker)]
    if refused:
        client.close()
        raise ShakeError(f"engine {address}: its worker {refused[0]} is not encrypted and not on this machine")
    return client


def threads(client: Any) -> int:
    """Tasks that the cluster's workers take at a time, now; at least one, as workers may still come."""
    return max(sum(client.nthreads().values()), 1)


def _private(worker: str) -> bool:
    parts = urlsplit(worker)
    return parts.scheme in ("tls", "inproc") or is_loopback(parts.hostname or "")


@dataclass(frozen=True)
class Engine:
    """Where tasks are run.

    Attributes
    ----------
    name : for people.
    executor : takes calls.
    width : how many calls it works on at a time, now.
    threads : that one call may use.
    died : what a call fails with whose worker has died.
    sure : whether that call was the one at work, and none that waited behind it.
    """

    name: str
    executor: Executor
    width: Callable[[], int]
    threads: int
    died: tuple[type[BaseException], ...]
    sure: bool


@contextmanager
def engine(address: str | None = None, workers: int | None = None) -> Iterator[Engine]:
    """An engine for the time of a block; an exception that leaves the block ends what is running at once.

    Parameters
    ----------
    address : of a Dask scheduler, tls://HOST:PORT, or tcp://HOST:PORT on this machine; None for this machine's cores.
    workers : processes on this machine; by default one for each core that this process may use.

    Raises
    ------
    ShakeError : an address that is refused or does not answer; a number of workers that cannot be.
    """
    if workers is not None and workers < 1:
        raise ShakeError(f"{workers} workers: must be at least 1")
    if address is not None:
        if workers is not None:
            raise ShakeError(f"engine {address}: its number of workers is set by the cluster")
        with _cluster(address) as found:
            yield found
        return
    count = workers or cores()
    executor = ProcessWorkers(count)
    try:
        name = f"{count} worker process{'es' * (count > 1)}"
        yield Engine(name, executor, lambda: count, max(cores() // count, 1), (WorkerDied,), True)
    except BaseException:
        executor.shutdown(cancel_futures=True)
        raise
    executor.shutdown()


@contextmanager
def _cluster(address: str) -> Iterator[Engine]:
    client = connect(address)
    try:
        from distributed.scheduler import KilledWorker

        executor = client.get_executor(pure=False)
        try:
            yield Engine(f"the cluster {address}", executor, lambda: threads(client), 1, (KilledWorker,), False)
        except BaseException:
            executor.shutdown(wait=False)  # cancels what is left
            raise
        executor.shutdown()
    finally:
        client.close()
