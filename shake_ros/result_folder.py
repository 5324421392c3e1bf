"""Files of a result: written whole or not at all, and nothing is replaced that was not meant to be."""

from __future__ import annotations

import json
import math
import os
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from shake_ros.quantities import ShakeError


def refuse_existing(*paths: Path, force: bool) -> None:
    """ShakeError for the first file or folder that is there already, unless it may be replaced."""
    for path in paths:
        if path.exists() and not force:
            raise ShakeError(f"{path}: exists already (--force replaces it)")


@contextmanager
def writing() -> Iterator[None]:
    """Files that cannot be written in the block are a ShakeError."""
    try:
        yield
    except OSError as error:
        raise ShakeError(f"{error.filename}: cannot be written ({error.strerror})") from None


def check_folder(out: Path, force: bool) -> None:
    """Refuse an existing result folder, or one that cannot be made: before the work, not after it."""
    refuse_existing(out, force=force)
    above = next((folder for folder in out.absolute().parents if folder.exists()), None)
    if above is None or not above.is_dir() or not os.access(above, os.W_OK):
        raise ShakeError(f"{out}: cannot be created (no permission to write in {above})")


@contextmanager
def new_folder(out: Path, *, force: bool = False) -> Iterator[Path]:
    """Make a result folder whole or not at all: the block fills a hidden neighbour, which then takes its place.

    Raises
    ------
    ShakeError : where the folder exists already and `force` is not set, or cannot be made.
    """
    refuse_existing(out, force=force)
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        workshop = Path(tempfile.mkdtemp(prefix=f".{out.name}-", dir=out.parent))
    except OSError as error:
        raise ShakeError(f"{out}: cannot be created ({error.strerror})") from None
    try:
        yield workshop
        workshop.chmod(0o755)
        if out.exists():
            _exchange(workshop, out)
        else:
            os.replace(workshop, out)
    except BaseException:
        shutil.rmtree(workshop, ignore_errors=True)
        raise


def _exchange(workshop: Path, out: Path) -> None:
    """Put the new folder where the old one is; the old one stays where that fails."""
    attic = Path(tempfile.mkdtemp(prefix=f".{out.name}-old-", dir=out.parent))
    try:
        os.replace(out, attic / "old")
        try:
            os.replace(workshop, out)
        except BaseException:
            os.replace(attic / "old", out)
            raise
    except OSError as error:
        raise ShakeError(f"{out}: cannot be replaced ({error.strerror})") from None
    finally:
        shutil.rmtree(attic, ignore_errors=True)


def as_json(content: Any) -> Any:
    """Content of a JSON file: numbers of numpy as Python's, tuples as lists, null for each number that is none.

    >>> as_json({"error": float("nan"), "names": ("a", "b")})
    {'error': None, 'names': ['a', 'b']}
    """
    if isinstance(content, Mapping):
        return {str(key): as_json(value) for key, value in content.items()}
    if isinstance(content, tuple | list):
        return [as_json(value) for value in content]
    if hasattr(content, "tolist"):
        return as_json(content.tolist())
    return None if isinstance(content, float) and not math.isfinite(content) else content


def write_json(path: Path, content: Any) -> None:
    """Write `as_json`, readable by people."""
    path.write_text(json.dumps(as_json(content), indent=1) + "\n", encoding="utf-8")
