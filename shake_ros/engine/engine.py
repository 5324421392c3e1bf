"""Which engine: the cores of this machine, or a cluster by its address; both as `concurrent.futures.Executor`."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import dataclass

from shake_ros.core.plant.simulation import workers as cores
from shake_ros.core.quantities import ShakeError
from shake_ros.engine.cluster import connect, threads
from shake_ros.engine.processes import ProcessWorkers, WorkerDied


@dataclass(frozen=True)
class Engine:
    """Where tasks are run.

    Attributes
    ----------
    name : for people. executor : takes calls. width : how many calls it works on at a time, now.
    threads : that one call may use. died : what a call fails with whose worker has died. sure : whether
        that call was the one at work, and none that waited behind it.
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
            raise ShakeError(f"engine {address}: the number of its workers is the cluster's own")
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
