"""Which code a result comes from: a hash of all that can change it."""

from __future__ import annotations

import ast
import functools
import hashlib
import importlib.util
import platform
import sys
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path

from shake_ros.core.quantities import ShakeError, shown
from shake_ros.settings import config_folder

PACKAGE = Path(__file__).resolve().parent.parent
NO_INFLUENCE = ("shake_ros.report", "shake_ros.page", "shake_ros.cli")  # they show what others have found
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

    >>> {"shake_ros.core.quantities", "shake_ros.settings"} <= set(sources("shake_ros.engine.version"))
    True
    """
    roots = {"shake_ros": PACKAGE}
    top = module.partition(".")[0]
    if top not in roots:
        found = _folder_of(top)
        if found is None:
            return {**_closure(["shake_ros.engine.batches"], roots), module: _file_of(top)}
        roots[top] = found
    if _path(module, roots) is None:
        raise ShakeError(f"module {shown(module)} is not there")
    return _closure([module, "shake_ros.engine.batches"], roots)


def _closure(first: list[str], roots: dict[str, Path]) -> dict[str, Path]:
    found: dict[str, Path] = {}
    waiting = list(first)
    while waiting:
        name = waiting.pop()
        path = _path(name, roots)
        if path is not None and name not in found and not f"{name}.".startswith(tuple(f"{n}." for n in NO_INFLUENCE)):
            found[name] = path
            waiting += _imports(path)
    return found


def _path(name: str, roots: dict[str, Path]) -> Path | None:
    """The file of a module of the roots; None for anything else."""
    top, *inner = name.split(".")
    if top not in roots:
        return None
    whole = roots[top].joinpath(*inner)
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


def _folder_of(top: str) -> Path | None:
    """The folder of a package by its name; None where it is a single file."""
    spec = importlib.util.find_spec(top)
    if spec is None:
        raise ShakeError(f"module {shown(top)} is not there")
    places = list(spec.submodule_search_locations or ())
    return Path(places[0]) if places else None


def _file_of(top: str) -> Path:
    spec = importlib.util.find_spec(top)
    if spec is None or spec.origin is None or not Path(spec.origin).is_file():
        raise ShakeError(f"module {shown(top)} has no source")
    return Path(spec.origin)
