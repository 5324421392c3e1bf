"""Parameter files as rcl reads them: whom their sections address, and what a node must be told about it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from shake_ros.settings import read_yaml

OPTION = "--params-file"
PARAMETERS = "ros__parameters"


def _leaves(content: Any, prefix: str = "") -> Iterator[str]:
    """Dotted names of all values."""
    for name, value in content.items() if isinstance(content, Mapping) else ():
        if isinstance(value, Mapping):
            yield from _leaves(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}"


def sections(content: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Node name, as a file writes it, and its parameters.

    >>> list(sections({"lab": {"plant": {"ros__parameters": {"seed": 2}}}, "/**": {"ros__parameters": {"seed": 3}}}))
    [('lab/plant', {'seed': 2}), ('/**', {'seed': 3})]
    """
    for name, inner in content.items() if isinstance(content, Mapping) else ():
        if name == PARAMETERS:
            yield path, inner
        else:
            yield from sections(inner, f"{path}/{name}" if path else str(name))


class ParameterFiles:
    """The parameter files that a node is started with.

    Parameters
    ----------
    node : its full name. arguments : ROS arguments.

    Attributes
    ----------
    shared : parameters that a file gives to several nodes at once.
    warnings : a line for each section that names this node without its namespace, and so another node.
    """

    def __init__(self, node: str, arguments: Sequence[str]) -> None:
        self.shared: set[str] = set()
        self.warnings: list[str] = []
        for option, file in zip(arguments, arguments[1:], strict=False):
            for name, parameters in sections(read_yaml(Path(file))) if option == OPTION else ():
                full = f"/{name.lstrip('/')}"
                if "*" in name:
                    self.shared.update(_leaves(parameters))
                elif full != node and full.rsplit("/", 1)[-1] == node.rsplit("/", 1)[-1]:
                    self.warnings.append(f"{file}: '{name}:' is {full}; for this node write '{node}:'")
