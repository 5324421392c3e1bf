"""The one `njit` of the package, with a cache that cannot go stale.

numba keys its cache by the file of the function alone and does not notice an edit in a file that the
function calls into. Here the cache folder of a file carries a hash of that file and of every file of this package that
it imports, at any depth, and of the versions of numba, llvmlite, numpy and Python: an edit makes afresh what can
see it and nothing else, unchanged code starts warm in about a second.

`error_model="numpy"` (division by zero gives inf, as on the hardware) and no `fastmath`: NaN must stay NaN,
and a result must not depend on how a compiler reassociates a sum.
"""

from __future__ import annotations

import functools
import hashlib
import os
import platform
import re
import shutil
import sys
import tempfile
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numba

PACKAGE = Path(__file__).resolve().parent
KEPT_CACHES = 400  # folders, one for each file with compiled functions and state of its sources
IMPORTS = re.compile(
    r"^\s*(?:from\s+shake_ros([\w.]*)\s+import\s+(\([^)]*\)|[^\n]*)|import\s+shake_ros([\w.]*))",
    re.MULTILINE,
)
VERSIONS = f"{sys.version}{platform.machine()}{version('numba')}{version('llvmlite')}{version('numpy')}"


@functools.cache
def _files() -> dict[str, Path]:
    """Files of the package by dotted name; a folder's name means its `__init__`. That of the package imports on demand
    only, and is left out: it names everything."""
    found = {}
    for path in PACKAGE.rglob("*.py"):
        found[".".join(path.relative_to(PACKAGE).with_suffix("").parts).removesuffix("__init__").rstrip(".")] = path
    del found[""]
    return found


@functools.cache
def _read(path: Path) -> tuple[bytes, tuple[Path, ...]]:
    """Hash of a file, and the files of the package that its imports name, with each folder's `__init__` on the way."""
    content, files = path.read_bytes(), _files()
    found: dict[Path, None] = {}
    for package, names, module in IMPORTS.findall(content.decode("utf-8")):
        dotted = (package or module).strip(".")
        parts = dotted.split(".")
        wanted = [".".join(parts[:depth]) for depth in range(len(parts) + 1)]
        wanted += [f"{dotted}.{name}".lstrip(".") for name in re.findall(r"\w+", names)]
        found.update((files[name], None) for name in wanted if name in files)
    return hashlib.sha256(content).digest(), tuple(found)


def imported(path: Path) -> tuple[Path, ...]:
    """Files of the package that a file names in its imports."""
    return _read(path)[1]


def source_hash(path: Path) -> str:
    """Hash of a file, of all that it imports from the package and of the versions that matter, 16 hex digits."""
    seen, waiting = dict[Path, bytes](), [path]
    while waiting:
        here = waiting.pop()
        if here not in seen:
            seen[here], more = _read(here)
            waiting.extend(more)
    digest = hashlib.sha256(VERSIONS.encode())
    for each in sorted(map(str, seen)):
        digest.update(each.removeprefix(str(PACKAGE)).encode() + seen[Path(each)])
    return digest.hexdigest()[:16]


def _cache_root() -> Path:
    """Folder of all caches; the oldest are removed, a read-only home falls back to the folder for temporary files."""
    home = Path(os.environ.get("XDG_CACHE_HOME", "") or Path.home() / ".cache")
    roots = [home / "shake_ros", Path(tempfile.gettempdir()) / f"shake_ros-{os.getuid()}"]
    if os.environ.get("NUMBA_CACHE_DIR"):
        roots.insert(0, Path(os.environ["NUMBA_CACHE_DIR"]))
    for root in roots:
        try:
            root.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=root):
                pass
        except OSError:
            continue
        others = sorted(root.glob("compiled-*"), key=lambda p: p.stat().st_mtime if p.exists() else 0.0)
        for old in others[:-KEPT_CACHES]:
            shutil.rmtree(old, ignore_errors=True)
        return root
    return Path(tempfile.mkdtemp(prefix="shake_ros-"))


ROOT = _cache_root()


@functools.cache
def cache_folder(file: str) -> str:
    """Folder for what is compiled of a file of the package."""
    folder = ROOT / f"compiled-{source_hash(Path(file).resolve())}"
    folder.mkdir(exist_ok=True)
    os.utime(folder)
    return str(folder)


def njit(function: Callable[..., Any]) -> Any:
    """The function compiled in nopython mode without the GIL, kept in this package's own cache folder.

    numba reads the folder from its settings when it decorates. It is set for that moment alone, so that it holds where
    numba was imported before this package, and neither other code nor a child process inherits it.
    """
    return _compiled(function, _nrt=True)


def kernel(function: Callable[..., Any]) -> Any:
    """`njit` for an inner function that makes no array: its array arguments are not counted.

    numba counts the holders of every array at each call by an atomic addition; within a step that was a third of the
    time of a simulation, more where threads share the command.
    """
    return _compiled(function, _nrt=False)


def inlined_kernel(function: Callable[..., Any]) -> Any:
    """`kernel` for one that stands at few places, all within a step: its body is put there instead of a call.

    A call hands over each array as seven numbers; in a step of the table calls took a fifth of the time.
    """
    return _compiled(function, _nrt=False, forceinline=True)


def _compiled(function: Callable[..., Any], **more: bool) -> Any:
    compiler: Any = numba.njit
    settings: Any = numba.config
    before, settings.CACHE_DIR = settings.CACHE_DIR, cache_folder(function.__code__.co_filename)
    try:
        return compiler(cache=True, nogil=True, error_model="numpy", **more)(function)
    finally:
        settings.CACHE_DIR = before
