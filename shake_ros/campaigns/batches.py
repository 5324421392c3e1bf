"""Tasks through an engine: in batches, a few at a time, each result as it comes, and a second chance after a death.

A result comes with a hash of all the code that can change it.
"""

from __future__ import annotations

import ast
import functools
import hashlib
import importlib
import importlib.util
import json
import math
import os
import platform
import statistics
import sys
import time
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from dataclasses import dataclass
from importlib.metadata import version
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

from shake_ros.campaigns.engine import Engine
from shake_ros.physics.plant.simulation import use_threads
from shake_ros.quantities import ShakeError, shown
from shake_ros.result_folder import as_json
from shake_ros.settings import config_folder

PACKAGE = Path(__file__).resolve().parent.parent
NO_INFLUENCE = ("shake_ros.report.", "shake_ros.page.", "shake_ros.cli.")  # they show what others have found
NOT_PHYSICS = ("studies", "layouts", "description")  # folders of config/
LIBRARIES = ("numpy", "scipy", "numba", "llvmlite")


@functools.cache
def code_version(function: str) -> str:
    """Hash of what a function's result depends on, 16 hex digits.

    That is its module with every module of the same package and of this one that it imports, at any depth; config/;
    Python, the kind of machine, and the versions of numpy, scipy, numba and llvmlite.

    Parameters
    ----------
    function : `module:function`.
    """
    module = function.partition(":")[0]
    digest = hashlib.sha256(f"{sys.version_info[:3]}{platform.machine()}".encode())
    for name in LIBRARIES:
        digest.update(f"{name} {version(name)}\n".encode())
    for name, path in sorted(sources(module).items()):
        digest.update(f"{name}\n".encode() + hashlib.sha256(path.read_bytes()).digest())
    folder = config_folder()
    for path in sorted(folder.rglob("*.yaml")):
        inside = path.relative_to(folder)
        if inside.parts[0] not in NOT_PHYSICS:
            digest.update(f"{inside}\n".encode() + hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()[:16]


def sources(module: str) -> dict[str, Path]:
    """A module and all that it imports, at any depth, from its own package and from this one: name → file.

    >>> {"shake_ros.quantities", "shake_ros.settings"} <= set(sources("shake_ros.campaigns.batches"))
    True
    """
    places = {"shake_ros": PACKAGE.parent}
    top = module.partition(".")[0]
    spec = importlib.util.find_spec(top)
    if spec is None:
        raise ShakeError(f"module {shown(top)} is not there")
    where = next(iter(spec.submodule_search_locations or ()), spec.origin) or ""
    places.setdefault(top, Path(where).parent)
    if _path(module, places) is None:
        raise ShakeError(f"module {shown(module)} has no source")
    found: dict[str, Path] = {}
    waiting = [module, __name__]
    while waiting:
        name = waiting.pop()
        path = _path(name, places)
        if path is not None and name not in found and not f"{name}.".startswith(NO_INFLUENCE):
            found[name] = path
            waiting += _imports(path)
    return found


def _path(name: str, places: dict[str, Path]) -> Path | None:
    """The file of a module whose package lies in one of the places; None for anything else."""
    parts = name.split(".")
    if parts[0] not in places:
        return None
    whole = places[parts[0]].joinpath(*parts)
    return next((p for p in (whole.with_suffix(".py"), whole / "__init__.py") if p.is_file()), None)


@functools.cache
def _imports(path: Path) -> tuple[str, ...]:
    """Dotted names in a file's imports, with the packages above them; what only type checkers read is left out."""
    found: dict[str, None] = {}
    for name in _named(ast.parse(path.read_text(encoding="utf-8"))):
        parts = name.split(".")
        found.update(dict.fromkeys(".".join(parts[:depth]) for depth in range(1, len(parts) + 1)))
    return tuple(found)


def _named(node: ast.AST) -> Iterator[str]:
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.Import):
            for alias in child.names:
                yield alias.name
                if alias.name == "shake_ros":  # its face gives whatever is asked of it
                    yield from (f"shake_ros.api.{p.stem}" for p in sorted((PACKAGE / "api").glob("*.py")))
        elif isinstance(child, ast.ImportFrom) and child.module:
            yield from (f"{child.module}.{alias.name}" for alias in child.names)
        elif not (isinstance(child, ast.If) and ast.unparse(child.test) == "TYPE_CHECKING"):
            yield from _named(child)


BATCH = 0.15  # wanted length of a batch [s]; short tasks cost by the message else
LARGEST = 2000  # tasks in a batch
LONG = 1.0  # from this mean time of a task on, no batch waits behind another [s]
REMEMBERED = 15  # batches whose times say how long a task is


class Task(NamedTuple):
    """A call to be made. key : the caller's own; given : keyword arguments of the function, plain values."""

    key: str
    given: Mapping[str, Any]


class TaskOutcome(NamedTuple):
    """What came of a task."""

    task: Task
    figures: str | None  # what the function returned, as JSON text; None where it failed, and then `failed` says why
    failed: str | None
    # seconds, processor: time it took by the clock and of the processor [s]
    seconds: float
    processor: float
    worker: str  # machine and process


@dataclass
class _Batch:
    """Tasks on their way, and how many workers have died of them."""

    tasks: list[Task]
    deaths: int = 0


class _Lost(Exception):
    """A worker that cannot do what is asked: another version, no such module."""


def function_of(name: str) -> Callable[..., Any]:
    """The function that `module:function` names.

    >>> function_of("math:hypot")(3, 4)
    5.0
    """
    module, _, function = name.partition(":")
    try:
        found = getattr(importlib.import_module(module), function)
    except (ImportError, ValueError, AttributeError) as error:
        raise ShakeError(f"{shown(name)} is not a function that can be imported as module:function ({error})") from None
    if not callable(found):
        raise ShakeError(f"{shown(name)} is not a function")
    return found  # type: ignore[no-any-return]


def run(
    engine: Engine, function: str, tasks: Iterable[Task], length: float = BATCH
) -> Generator[list[TaskOutcome], None, None]:
    """Outcomes of a function for all tasks, batch by batch as they come and not in their order.

    Only what is being worked on, and as much again where tasks are short, is held at a time. A task whose worker dies
    is given out again by itself; when it takes a second one along, it has failed and the rest goes on.

    Parameters
    ----------
    function : `module:function`; it takes a task's values by name and returns what can be written as JSON.
    length : wanted of a batch [s].

    Raises
    ------
    ShakeError : the workers have other sources than this process, or the engine is lost.
    """
    version = code_version(function)
    left, again = iter(tasks), deque[_Batch]()
    flying: dict[Future[list[TaskOutcome]], _Batch] = {}
    times = deque[float](maxlen=REMEMBERED)
    while True:
        mean = statistics.median(times) if times else math.inf
        most = engine.width() * (1 if mean > LONG else 2)
        suspect = bool(again) or any(batch.deaths for batch in flying.values())
        while len(flying) < (1 if suspect and not engine.sure else most):
            some = again.popleft() if again else _Batch(list(islice(left, _size(mean, length))))
            if not some.tasks:
                break
            flying[engine.executor.submit(work, function, some.tasks, version, engine.threads)] = some
            suspect |= some.deaths > 0  # runs alone where it is unclear whose death it was
        if not flying:
            return
        for future in wait(flying, timeout=1.0, return_when=FIRST_COMPLETED).done:
            some = flying.pop(future)
            try:
                done = future.result()
            except engine.died:
                yield from _died(some, again)
                continue
            except CancelledError:
                raise ShakeError(f"{engine.name} is lost; finished rows are kept") from None
            except _Lost as error:
                raise ShakeError(str(error)) from None
            times.append(sum(o.seconds for o in done) / len(done))
            yield done


def _size(mean: float, length: float) -> int:
    """Tasks of a mean time [s] that make a batch; one while the time is not known."""
    return min(max(math.ceil(length / max(mean, 1e-9)), 1), LARGEST)


def _died(some: _Batch, again: deque[_Batch]) -> Iterator[list[TaskOutcome]]:
    """Second chances, each task by itself; or the end of a single task's."""
    if some.deaths and len(some.tasks) == 1:
        yield [TaskOutcome(some.tasks[0], None, "its worker died twice", 0.0, 0.0, "")]
    else:
        again.extend(_Batch([task], 1) for task in some.tasks)


def work(function: str, tasks: list[Task], version: str, threads: int) -> list[TaskOutcome]:
    """In a worker: the outcomes of a batch, each task on so many threads."""
    use_threads(threads)
    try:
        call, own = function_of(function), code_version(function)
    except ShakeError as error:
        raise _Lost(f"a worker on {platform.node()}: {error}") from None
    if own != version:
        raise _Lost(f"a worker on {platform.node()} has other sources than this process ({own}, not {version})")
    return [_one(call, task) for task in tasks]


def _one(call: Callable[..., Any], task: Task) -> TaskOutcome:
    where = f"{platform.node()} {os.getpid()}"
    clock, processor = time.perf_counter(), time.process_time()
    figures, failed = None, None
    try:
        figures = json.dumps(as_json(call(**task.given)), sort_keys=True)
    except (Exception, SystemExit) as error:  # a row that says so, and the others go on
        failed = f"{type(error).__name__}: {error}"
    return TaskOutcome(task, figures, failed, time.perf_counter() - clock, time.process_time() - processor, where)
