"""The one `njit` of the package, with a cache that cannot go stale.

numba keys its cache by the file of the function alone and does not notice an edit in a file that the
function calls into. Here the cache folder's name carries a hash of every source file of `core`, which
imports nothing of the package outside itself, and of the versions of numba, llvmlite, numpy and Python:
any edit there starts a fresh folder, an unchanged core starts warm in about a second.

`error_model="numpy"` (division by zero gives inf, as on the hardware) and no `fastmath`: NaN must stay NaN,
and a result must not depend on how a compiler reassociates a sum.
"""

from __future__ import annotations

import hashlib
import os
import platform
import shutil
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba

CORE = Path(__file__).resolve().parent
KEPT_CACHES = 8


def source_hash(core: Path = CORE) -> str:
    """Hash of the core's sources and of the versions that compiled code depends on, 16 hex digits."""
    digest = hashlib.sha256()
    for path in sorted(core.rglob("*.py")):
        digest.update(str(path.relative_to(core)).encode())
        digest.update(path.read_bytes())
    from importlib.metadata import version

    digest.update(
        f"{sys.version}{platform.machine()}{version('numba')}{version('llvmlite')}{version('numpy')}".encode()
    )
    return digest.hexdigest()[:16]


def _cache_folder() -> str:
    """Folder for compiled code; the oldest of earlier ones are removed, a read-only home falls back to /tmp."""
    home = Path(os.environ.get("XDG_CACHE_HOME", "") or Path.home() / ".cache")
    roots = [home / "shake_ros", Path(tempfile.gettempdir()) / f"shake_ros-{os.getuid()}"]
    if os.environ.get("NUMBA_CACHE_DIR"):
        roots.insert(0, Path(os.environ["NUMBA_CACHE_DIR"]))
    for root in roots:
        folder = root / f"compiled-{source_hash()}"
        try:
            folder.mkdir(parents=True, exist_ok=True)
            os.utime(folder)
        except OSError:
            continue
        others = sorted(root.glob("compiled-*"), key=lambda p: p.stat().st_mtime if p.exists() else 0.0)
        for old in others[:-KEPT_CACHES]:
            shutil.rmtree(old, ignore_errors=True)
        return str(folder)
    return tempfile.mkdtemp(prefix="shake_ros-")


FOLDER = _cache_folder()


def njit(function: Callable[..., Any]) -> Any:
    """The function compiled in nopython mode without the GIL, kept in this package's own cache folder.

    numba reads the folder from its settings when it decorates. It is set for that moment alone, so that it holds where
    numba was imported before this package, and neither other code nor a child process inherits it.
    """
    settings: Any = numba.config
    before, settings.CACHE_DIR = settings.CACHE_DIR, FOLDER
    try:
        return numba.njit(cache=True, nogil=True, error_model="numpy")(function)
    finally:
        settings.CACHE_DIR = before
