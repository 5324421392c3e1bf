"""Random and broken files against every reader: a value or one clear ShakeError line may come of them, and soon.

    python -m benchmarks.recordings.fuzz [--reader NAME …] [--count 100000] [--first 0] [--seed 1] [--save]

Readers: recordings (rosbag2 folders with mcap and sqlite3, compressed and not, with their metadata.yaml), accelerograms
and configurations (YAML into the parameters of every kind). Input i is a mutation of a small sound one that depends on
seed and i alone, so `--first i --count 1` repeats it. Each runs in a child process with a limit of processor
time and memory; a failing one is kept in out/fuzz. Exit status 0 where nothing failed. Last figures: fuzz.txt.
"""

from __future__ import annotations

import argparse
import dataclasses
import multiprocessing
import os
import random
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

from tqdm import tqdm

from benchmarks import ROOT
from benchmarks.recordings import seeds
from shake_ros import settings
from shake_ros.bridge.emulator import EmulatorParameters
from shake_ros.bridge.table_link import BridgeParameters
from shake_ros.control.laws import CONTROLLERS
from shake_ros.control.observer import OBSERVERS
from shake_ros.quantities import ShakeError
from shake_ros.realtime import RealtimeParameters
from shake_ros.recordings.accelerograms import read_accelerogram
from shake_ros.recordings.bags import read_table_recording
from shake_ros.recordings.bags.bag import METADATA
from shake_ros.recordings.reference_file import load_reference
from shake_ros.safety.machine import PowerUnitParameters

LIMIT = 2.0  # of processor time for one input [s]
STILL = 120.0  # a child that makes no progress for so long by the wall clock has hung [s]
MEMORY = 3 << 30  # of the address space beyond what the process has at its start [bytes]
BATCH = 500  # inputs of one child process
WITHOUT_METADATA = 0.85  # share of recordings without metadata.yaml, whose parsing takes longer than all the rest
BOMBS = 0.0002
KEPT = ROOT / "out" / "fuzz"
MEMORY_FOLDER = Path("/dev/shm")


class Hang(BaseException):
    """An input took longer than LIMIT."""


def read_configuration(path: Path) -> object:
    """The file as what its name says."""
    kind = path.stem
    if kind == "table":
        return settings.load_table(str(path))
    if kind == "interlock":
        return settings.load_interlock(str(path))
    if kind == "reference":
        return load_reference(str(path))
    if kind in ("controller", "observer"):
        return settings.load_variant(kind, str(path), CONTROLLERS if kind == "controller" else OBSERVERS)
    content = settings.read_yaml(path)
    if kind == "bridge":
        return BridgeParameters.from_mapping(content, str(path))
    section = content.pop("power_unit" if kind == "emulator" else "realtime", {}) if isinstance(content, dict) else {}
    if kind == "emulator":
        PowerUnitParameters.from_mapping(section, str(path))
        return EmulatorParameters.from_mapping(content, str(path))
    return RealtimeParameters.from_mapping(section, str(path))


@dataclasses.dataclass(frozen=True)
class Reader:
    """How one kind of input is made and read."""

    make: Callable[[Path], list[seeds.Files]]
    mutate: seeds.Mutate
    read: Callable[[Path], object]
    suffix: str = ""


READERS = {
    "recordings": Reader(seeds.recordings, seeds.mutated_bytes, read_table_recording),
    "accelerograms": Reader(lambda _: seeds.accelerograms(), seeds.mutated_text, read_accelerogram),
    "configurations": Reader(lambda _: seeds.configurations(), seeds.mutated_text, read_configuration, ".yaml"),
}


def mutation(reader: Reader, sound: list[seeds.Files], seed: int, number: int) -> seeds.Files:
    """Input `number`: one of the sound ones with one or all of its files changed, a file less, or a bomb."""
    chance = random.Random(f"{seed}:{number}")
    if reader.mutate is seeds.mutated_bytes and chance.random() < BOMBS:
        return chance.choice(seeds.bombs())
    files = dict(chance.choice(sound))
    if METADATA in files and chance.random() < WITHOUT_METADATA:
        del files[METADATA]
    others = [data for one in sound for data in one.values()]
    names = list(files)
    changed = names if chance.random() < 0.2 else [chance.choice(names)]
    for name in changed:
        mutate = seeds.mutated_text if name.endswith(".yaml") else reader.mutate
        files[name] = mutate(files[name], chance, others)
    if len(files) > 1 and chance.random() < 0.03:
        del files[chance.choice(names)]
    return files


def written(reader: Reader, files: seeds.Files, folder: Path) -> Path:
    """The files in an empty folder; the path that the reader is given."""
    for old in folder.iterdir():
        old.unlink()
    for name, data in files.items():
        (folder / (name + reader.suffix)).write_bytes(data)
    if reader.read is read_table_recording:
        return folder
    return folder / (next(iter(files)) + reader.suffix)


def outcome(reader: Reader, path: Path) -> str:
    """`read`, `refused`, or what else came of it: the name of an exception, a hang, a refusal of several lines."""

    def give_up(*_: object) -> None:
        raise Hang

    signal.signal(signal.SIGPROF, give_up)
    signal.setitimer(signal.ITIMER_PROF, LIMIT)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            reader.read(path)
        return "read"
    except ShakeError as error:
        text = str(error)
        return "refused" if "\n" not in text and len(text) < 2000 else f"unclear: {text[:200]!r} …"
    except Hang:
        return "hang"
    except BaseException:
        return traceback.format_exc(limit=-4)
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)


def child(name: str, sound: list[seeds.Files], seed: int, numbers: range, state: Any, results: Any) -> None:
    """Read a batch; `state` holds the input under way, so that a death can be told."""
    reader = READERS[name]
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY, used + MEMORY))
    counts: Counter[str] = Counter()
    failures: list[tuple[int, str]] = []
    slowest = (0.0, -1)
    with tempfile.TemporaryDirectory(dir=MEMORY_FOLDER if MEMORY_FOLDER.is_dir() else None) as temporary:
        for number in numbers:
            state.value = number
            path = written(reader, mutation(reader, sound, seed, number), Path(temporary))
            started = time.process_time()
            said = outcome(reader, path)
            slowest = max(slowest, (time.process_time() - started, number))
            if said in ("read", "refused"):
                counts[said] += 1
            else:
                counts["failed"] += 1
                failures.append((number, said))
    results.send((counts, failures, slowest))


def batch(
    name: str, sound: list[seeds.Files], seed: int, numbers: range
) -> tuple[Counter[str], Any, tuple[float, int]]:
    """One batch in a child process; a child that dies or hangs costs its input, and the batch goes on behind it."""
    context = multiprocessing.get_context("fork")
    state = context.Value("q", numbers.start)
    receive, send = context.Pipe(duplex=False)
    process = context.Process(target=child, args=(name, sound, seed, numbers, state, send), daemon=True)
    process.start()
    send.close()
    last, since = numbers.start, time.monotonic()
    while not receive.poll(0.2):
        if state.value != last:
            last, since = state.value, time.monotonic()
        if time.monotonic() - since > STILL:
            process.kill()
    try:
        found = receive.recv()
        process.join()
        return found
    except EOFError:
        process.join()
        died = int(state.value)
        how = "killed after a hang" if process.exitcode == -signal.SIGKILL else f"died with {process.exitcode}"
        before, behind = (
            batch(name, sound, seed, part) if part else (Counter(), [], (0.0, -1))
            for part in (range(numbers.start, died), range(died + 1, numbers.stop))
        )
        counts = before[0] + behind[0] + Counter({"failed": 1})
        return counts, [*before[1], (died, how), *behind[1]], max(before[2], behind[2])


def fuzz(name: str, count: int, seed: int, first: int = 0) -> tuple[Counter[str], list[tuple[int, str]], float, int]:
    """Feed `count` inputs to a reader; counts of outcomes, failures by number, the slowest [s] and its number."""
    reader = READERS[name]
    counts: Counter[str] = Counter()
    failures: list[tuple[int, str]] = []
    slowest = (0.0, -1)
    with tempfile.TemporaryDirectory() as temporary:
        sound = reader.make(Path(temporary))
        seeds.bombs()
        with tqdm(total=count, desc=name, disable=not sys.stderr.isatty()) as bar:
            for begin in range(first, first + count, BATCH):
                numbers = range(begin, min(begin + BATCH, first + count))
                more, failed, slow = batch(name, sound, seed, numbers)
                counts += more
                slowest = max(slowest, slow)
                for number, said in failed:
                    failures.append((number, said))
                    keep(name, reader, mutation(reader, sound, seed, number), number)
                bar.update(len(numbers))
    return counts, failures, *slowest


def keep(name: str, reader: Reader, files: seeds.Files, number: int) -> None:
    """The files of a failing input in out/fuzz."""
    folder = KEPT / f"{name}_{number}"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    written(reader, files, folder)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--reader", action="append", choices=READERS, help="only this one; may be repeated")
    parser.add_argument("--count", type=int, default=100_000, help="inputs to each reader")
    parser.add_argument("--first", type=int, default=0, help="number of the first input")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--save", action="store_true", help="write fuzz.txt as well")
    given = parser.parse_args()
    said, failed = [f"python -m benchmarks.recordings.fuzz --count {given.count} --seed {given.seed}", ""], 0
    for name in given.reader or READERS:
        started = time.monotonic()
        counts, failures, slowest, number = fuzz(name, given.count, given.seed, given.first)
        failed += len(failures)
        said.append(
            f"{name}: {sum(counts.values())} inputs, {counts['read']} read, {counts['refused']} refused with one line, "
            f"{len(failures)} failed; slowest {1e3 * slowest:.0f} ms (input {number}); "
            f"{time.monotonic() - started:.0f} s"
        )
        print(said[-1], flush=True)
        for kind, example in {text.strip().splitlines()[-1]: (n, text) for n, text in failures}.items():
            print(
                f"  {sum(text.strip().endswith(kind) for _, text in failures)} times, e.g. {example[0]}: {example[1]}"
            )
    if given.save:
        Path(__file__).with_suffix(".txt").write_text("\n".join(said) + "\n", encoding="utf-8")
    return 1 if failed else 0


if __name__ == "__main__":
    os.nice(2)
    sys.exit(main())
