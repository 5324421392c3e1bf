"""Parameters of every node, read off while the node is built in a frame that only notes what it declares.

Neither rclpy nor a message is imported: stand-ins take their place in `sys.modules`.
"""

from __future__ import annotations

import importlib
import math
import os
import tempfile
from contextlib import suppress
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any, ClassVar
from unittest.mock import MagicMock, patch

from shake_ros.entry_points import NODES
from shake_ros.quantities import ShakeError

ROS = ("rclpy", "rcl_interfaces", "builtin_interfaces", "rosgraph_msgs", "std_srvs")


class Anything(type):
    """A class of ROS in name only: it can be called with anything and has every attribute."""

    def __getattr__(cls, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return MagicMock(name=name)

    def __call__(cls, *_: Any, **__: Any) -> Any:
        return MagicMock(name=cls.__name__)


class StandIn(ModuleType):
    """A module of ROS in name only: whatever is asked of it is such a class."""

    __path__: ClassVar[list[str]] = []

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        kind = Anything(name, (), {"__module__": self.__name__})
        setattr(self, name, kind)
        return kind


class StandIns(MetaPathFinder, Loader):
    """Finds stand-ins for everything that belongs to ROS."""

    def find_spec(self, name: str, path: Any = None, target: Any = None) -> ModuleSpec | None:
        """A stand-in for ROS's own, nothing for all else."""
        top = name.partition(".")[0]
        return ModuleSpec(name, self, is_package=True) if top in ROS or top.endswith("_msgs") else None

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        """An empty stand-in."""
        return StandIn(spec.name)

    def exec_module(self, module: ModuleType) -> None:
        """Nothing to run."""


def declared(name: str) -> dict[str, tuple[Any, Any]]:
    """Name → (value, metadata) of every parameter that a node declares, in their order; those of its frame first."""
    from shake_ros.ros.frame import Frame
    from shake_ros.ros.parameters import LiveSet, NodeParameters, flatten

    found: dict[str, tuple[Any, Any]] = {}

    def declare(_: Any, value: Any, prefix: str = "", accept: Any = None, *, live: bool = False) -> LiveSet[Any]:
        for field, (content, metadata) in flatten(value, prefix).items():
            found[field] = (content, {**metadata, "live": live or metadata.get("live", False)})
        return LiveSet(value, prefix)

    with patch.object(NodeParameters, "declare", declare), suppress(ShakeError):  # the player misses its recording
        importlib.import_module(NODES[name].module).build(Frame(name, MagicMock()))
    return found


def shown(value: Any) -> str:
    """A value as YAML has it, short."""
    text = str(value).lower() if isinstance(value, bool) else f"{value:.6g}" if isinstance(value, float) else str(value)
    return f"`{text}`" if text else "empty"


def table(parameters: dict[str, tuple[Any, Any]]) -> list[str]:
    """Rows of name, value, unit, bounds, meaning; live ones are marked."""
    rows = ["| parameter | default | unit | range | live | meaning |", "|---|---|---|---|---|---|"]
    for name, (value, metadata) in parameters.items():
        low, high = metadata.get("low", -math.inf), metadata.get("high", math.inf)
        bounds = f"{low:g} … {high:g}" if math.isfinite(low) or math.isfinite(high) else ""
        bounds = bounds or ", ".join(f"`{choice}`" for choice in metadata.get("names", ()))
        live = "yes" if metadata.get("live") else ""
        meaning = str(metadata.get("meaning", "")).replace("|", "\\|")
        rows.append(f"| `{name}` | {shown(value)} | {metadata.get('unit', '')} | {bounds} | {live} | {meaning} |")
    return rows


def by_node() -> dict[str, dict[str, tuple[Any, Any]]]:
    """The parameters of every node by its name."""
    here = os.getcwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)  # the recorder opens its folder
        try:
            return {name: declared(name) for name in NODES}
        finally:
            os.chdir(here)


def pages() -> dict[str, str]:
    """One page with a table per node, as the nodes are configured in config/."""
    nodes = by_node()
    first, *others = nodes.values()
    shared = [name for name in first if all(name in other for other in others)]
    text = ["# Node parameters", "", "As declared with the configuration that each node loads by default; a live"]
    text += ["parameter may be changed while the node runs, the others are read-only. Another table, controller,"]
    text += ["observer or reference brings its own parameters.", "", "## Every node", ""]
    text += table({name: first[name] for name in shared})
    for node, parameters in nodes.items():
        text += ["", f"## `{node}`", "", NODES[node].line[0].upper() + NODES[node].line[1:] + ".", ""]
        text += table({name: entry for name, entry in parameters.items() if name not in shared})
    return {"nodes.md": "\n".join(text) + "\n"}
