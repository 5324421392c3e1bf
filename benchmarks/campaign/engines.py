"""What campaigns cost and survive, on processes of this machine and on a Dask cluster of it.

    python -m benchmarks.campaign.engines [--only speed overhead …] [--save]

Speed-up of two workers over one on fits; overhead of a task; a worker killed in the middle and the rows compared with
those of an undisturbed run; 10 000 short rows and the memory that they take; a study stopped by Ctrl-C and gone on
with. What needs Dask says so where it is not installed. --save keeps the lines of the parts that ran in engines.txt,
beside those of the others.
"""

from __future__ import annotations

import argparse
import importlib.util
import logging
import os
import resource
import signal
import sqlite3
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import shake_ros as sr
from benchmarks import ROOT
from shake_ros.campaigns.batches import Task, TaskOutcome, run
from shake_ros.campaigns.campaign import CampaignFile
from shake_ros.campaigns.engine import Engine, engine

TASKS = "benchmarks.campaign.tasks"
FIT = "benchmarks.identification.interval_coverage:measure"
FITS = 24
ROWS = 10_000
STUDY = "title: Short rows\nmeasure: {measure}\nrows:\n  - {rows}\n"


def outcomes(on: Engine, function: str, given: Iterator[Task], length: float = 0.15) -> list[TaskOutcome]:
    """All outcomes of a function."""
    return [outcome for batch in run(on, function, given, length) for outcome in batch]


def seeds(first: int, last: int, **more: object) -> Iterator[Task]:
    """A task for each seed."""
    return (Task(str(seed), {"seed": seed, **more}) for seed in range(first, last))


@contextmanager
def dask_cluster(workers: int) -> Iterator[str]:
    """The address of a cluster on this machine; the deaths are ours to count."""
    import dask
    from distributed import LocalCluster

    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 0}),
        LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            host="127.0.0.1",
            dashboard_address=None,
            silence_logs=logging.CRITICAL,
        ) as cluster,
    ):
        yield cluster.scheduler_address


@contextmanager
def engines() -> Iterator[Iterator[tuple[str, Engine]]]:
    """Two workers on each engine, one engine after the other."""

    def each() -> Iterator[tuple[str, Engine]]:
        with engine(workers=2) as on:
            yield "2 processes", on
        if importlib.util.find_spec("distributed"):
            with dask_cluster(2) as address, engine(address) as on:
                yield "Dask, 2 workers", on

    yield each()
    if not importlib.util.find_spec("distributed"):
        print("Dask: not shown, distributed is not installed")


def speed() -> Iterator[str]:
    """Speed-up on fits, of one thread each, workers started and warm."""
    seconds = {}
    fits = {"length": 0.3, "forms": "declared", "saturation": None}
    for count in (1, 2):
        with engine(workers=count) as on:
            single = replace(on, threads=1)
            outcomes(single, FIT, seeds(1000, 1000 + count, **fits))
            begun = time.perf_counter()
            found = outcomes(single, FIT, seeds(0, FITS, **fits))
            seconds[count] = time.perf_counter() - begun
        each, clock = (statistics.median(getattr(o, name) for o in found) for name in ("processor", "seconds"))
        failed = sum(o.failed is not None for o in found)
        text = f"{FITS} fits on {count} process{'es' * (count > 1)}: {seconds[count]:.1f} s"
        yield f"{text}, a fit {each:.2f} s of processor in {clock:.2f} s by the clock, {failed} failed"
    yield f"speed-up of 2 processes over 1: {seconds[1] / seconds[2]:.2f}"


def overhead() -> Iterator[str]:
    """Time by the clock of a task that does nothing."""
    with engines() as each:
        for name, on in each:
            outcomes(on, f"{TASKS}:nothing", seeds(0, 20))
            for text, count, length in (("one by one", 2000, 0.0), ("in batches", 20000, 0.15)):
                begun = time.perf_counter()
                outcomes(on, f"{TASKS}:nothing", seeds(0, count), length)
                yield f"{name}, {text}: {1e6 * (time.perf_counter() - begun) / count:.0f} µs a task, {count} tasks"


def killed() -> Iterator[str]:
    """Rows of a run whose worker is killed against those of one process that is left alone."""
    with engine(workers=1) as on:
        wanted = {o.task.key: o.figures for o in outcomes(on, f"{TASKS}:sums", seeds(0, 400))}
    with engines() as each:
        for name, on in each:
            for times, what in ((1, "killed once"), (99, "killed at each try of one row")):
                with tempfile.TemporaryDirectory() as folder:
                    given = seeds(0, 400, bad=200, folder=folder, times=times)
                    found = {o.task.key: o for o in outcomes(on, f"{TASKS}:deadly", given)}
                    deaths = len(list(Path(folder).iterdir()))
                same = sum(found[key].figures == wanted[key] for key in wanted)
                failed = [f"row {key}: {o.failed}" for key, o in found.items() if o.failed]
                yield (
                    f"{name}, {what}: {deaths} deaths, {same} of {len(wanted)} rows the same to the last bit"
                    + "".join(f"; {text}" for text in failed)
                )


def memory() -> Iterator[str]:
    """Largest memory of this process before and after a campaign of many short rows."""
    with tempfile.TemporaryDirectory() as folder:
        study = Path(folder) / "short.yaml"
        for count in (10, 1000, ROWS):  # the first one loads what all need
            study.write_text(STUDY.format(measure=f"{TASKS}:nothing", rows=f"seed: {{first: 1, last: {count}}}"))
            before, begun = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, time.perf_counter()
            found = sr.campaign(study, Path(folder) / str(count), workers=2, progress=False)
            grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
            size = (Path(folder) / str(count) / "rows.sqlite").stat().st_size
            yield (
                f"{len(found.rows)} rows in {time.perf_counter() - begun:.1f} s: largest memory "
                f"{before / 1024:.0f} MiB before, {grown / 1024:.1f} MiB more; file {size / 2**20:.1f} MiB"
            )


def stopped() -> Iterator[str]:
    """A study stopped by Ctrl-C three times; how often each row was made."""
    with tempfile.TemporaryDirectory() as folder:
        study, out, log = (Path(folder) / name for name in ("study.yaml", "out", "log"))
        log.mkdir()
        rows = f"seed: {{first: 1, last: 600}}\n    folder: ['{log}']"
        study.write_text(STUDY.format(measure=f"{TASKS}:counted", rows=rows))
        command = [sys.executable, "-m", "shake_ros", "campaign", str(study), "--out", str(out), "--workers", "2"]
        there = []
        for wanted in (100, 250, 400):
            with subprocess.Popen(command, cwd=ROOT, stderr=subprocess.DEVNULL, start_new_session=True) as process:
                while process.poll() is None and _count(out) < wanted:
                    time.sleep(0.05)
                os.killpg(process.pid, signal.SIGINT)
            there.append(f"{_count(out)} rows (exit code {process.returncode})")
        last = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
        with CampaignFile(out, write=False) as file:
            keys = len(file)
        made = [len(path.read_bytes()) for path in log.iterdir()]
        yield f"stopped by Ctrl-C at {', '.join(there)}; then to its end: {keys} rows (exit code {last.returncode})"
        again = sum(made) - len(made)
        yield f"{len(made)} rows were made; {again} were under way at a stop, not yet in the file, and begun again"


def _count(folder: Path) -> int:
    try:
        base = sqlite3.connect(f"file:{folder / 'rows.sqlite'}?mode=ro", uri=True)
        count = int(base.execute("SELECT count(*) FROM rows").fetchone()[0])
        base.close()
    except sqlite3.Error:
        return 0
    return count


PARTS: dict[str, Callable[[], Iterator[str]]] = {
    "speed": speed,
    "overhead": overhead,
    "killed": killed,
    "memory": memory,
    "stopped": stopped,
}


def main() -> None:
    """Run the parts and print their lines."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", choices=PARTS, default=list(PARTS), help="these parts")
    parser.add_argument("--save", action="store_true", help="keep the lines in engines.txt")
    given = parser.parse_args()
    file = Path(__file__).with_suffix(".txt")
    kept = dict(part.split("\n", 1) for part in file.read_text(encoding="utf-8").split("\n\n")) if file.exists() else {}
    for name in given.only:
        head = f"{name} ({time.strftime('%Y-%m-%d')}, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f})"
        print(head, flush=True)
        lines = []
        for line in PARTS[name]():
            lines.append(f"  {line}")
            print(lines[-1], flush=True)
        kept = {old: text for old, text in kept.items() if old.split()[0] != name} | {head: "\n".join(lines)}
    if given.save:
        parts = [f"{head}\n{text.rstrip()}" for name in PARTS for head, text in kept.items() if head.split()[0] == name]
        file.write_text("\n\n".join(parts) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
