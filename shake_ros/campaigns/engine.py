"""Which engine: the cores of this machine, or a cluster by its address; both as `concurrent.futures.Executor`.

On this machine a thread waits beside each worker process. A `ProcessPoolExecutor`, as loky's, fails every task in
flight when one of its workers dies, and pebble's workers share one pipe, where a task that is read but not yet
acknowledged is lost with its worker. Here each worker has a pipe of its own: the task that dies with it is known, and
the next one gets a fresh worker.

A cluster is a running Dask scheduler. Needs `pip install 'shake_ros[cluster]'`.
"""

from __future__ import annotations

import ipaddress
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from queue import SimpleQueue
from typing import ParamSpec, TypeVar
from urllib.parse import urlsplit

from shake_ros.physics.plant.simulation import workers as cores
from shake_ros.quantities import ShakeError, shown

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
    """A place for one worker process."""

    def __init__(self) -> None:
        self._worker: tuple[SpawnProcess, Connection] | None = None
        self._over = False

    def call(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> T:
        if self._worker is None or not self._worker[0].is_alive():
            self._worker = self._started()
        process, pipe = self._worker
        if self._over:
            process.kill()
        try:
            pipe.send((fn, args, kwargs))
            done, found = pipe.recv()
        except (EOFError, OSError):
            process.join()
            raise WorkerDied from None
        if not done:
            raise found
        return found  # type: ignore[no-any-return]

    def _started(self) -> tuple[SpawnProcess, Connection]:
        pipe, other = SPAWN.Pipe()
        process = SPAWN.Process(target=_serve, args=(other,), daemon=True)
        with _starting, _quiet_start():
            process.start()
        other.close()
        try:
            pipe.recv()
        except EOFError:
            raise ShakeError(
                "a worker process cannot start: see what it printed; in a script of your own, call it "
                'beneath `if __name__ == "__main__":`'
            ) from None
        return process, pipe

    def end(self, *, at_once: bool = False) -> None:
        """Let the process end when it has done what it does, or at once."""
        self._over = True
        if self._worker is not None:
            process, pipe = self._worker
            if at_once:
                process.kill()
            else:
                pipe.close()
            process.join()


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


def _serve(pipe: Connection) -> None:
    """In a worker: call after call. Ctrl-C is for the process that gives the work, whose end is the worker's own."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    threading.Thread(target=_end_with_parent, daemon=True).start()
    pipe.send("ready")
    while True:
        try:
            fn, args, kwargs = pipe.recv()
        except EOFError:
            return
        try:
            answer = True, fn(*args, **kwargs)
        except Exception as error:
            answer = False, error
        pipe.send(answer)


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)


WAIT = 20.0  # for the scheduler's answer [s]


def check_address(address: str) -> None:
    """Refuse what is not `tls://HOST:PORT`, or `tcp://HOST:PORT` on this machine.

    >>> check_address("tcp://10.0.0.5:8786")
    Traceback (most recent call last):
        ...
    shake_ros.quantities.ShakeError: tcp://10.0.0.5:8786: not encrypted and not on this machine; use tls://
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


def _private(worker: str) -> bool:
    parts = urlsplit(worker)
    return parts.scheme in ("tls", "inproc") or is_loopback(parts.hostname or "")


@dataclass(frozen=True)
class Engine:
    """Where tasks are run."""

    name: str  # for people
    executor: Executor  # takes calls
    width: Callable[[], int]  # how many calls it works on at a time, now
    threads: int  # that one call may use
    died: tuple[type[BaseException], ...]  # what a call fails with whose worker has died
    sure: bool  # whether that call was the one at work, and none that waited behind it


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
    """A scheduler whose workers are encrypted too, or on this machine.

    The certificates of tls:// are those of Dask's own configuration (`distributed.comm.tls`).
    """
    check_address(address)
    try:
        from distributed import Client, Security
        from distributed.scheduler import KilledWorker
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

    def width() -> int:
        return max(sum(client.nthreads().values()), 1)  # at least one, as workers may still come

    try:
        if refused := [worker for worker in client.nthreads() if not _private(worker)]:
            raise ShakeError(f"engine {address}: its worker {refused[0]} is not encrypted and not on this machine")
        executor = client.get_executor(pure=False)
        try:
            yield Engine(f"the cluster {address}", executor, width, 1, (KilledWorker,), False)
        except BaseException:
            executor.shutdown(wait=False)  # cancels what is left
            raise
        executor.shutdown()
    finally:
        client.close()
