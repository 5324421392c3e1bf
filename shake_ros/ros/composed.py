"""Several nodes in one process, until a signal: `python -m shake_ros.ros.composed SPECS`, as `lab --composed` does."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping, Sequence
from typing import Any

from shake_ros.core.quantities import ShakeError
from shake_ros.ros.graph import NodeSpec, run_composed
from shake_ros.ros.interface import NAMESPACE


def command(nodes: Sequence[NodeSpec], lockstep: bool) -> tuple[str, ...]:
    """The command line that runs these nodes."""
    content = {node.executable: dict(node.parameters) for node in nodes}
    return (sys.executable, "-m", "shake_ros.ros.composed", json.dumps({"lockstep": lockstep, "nodes": content}))


def main(arguments: Sequence[str]) -> int:
    """Run them; returns the exit code."""
    content: Mapping[str, Any] = json.loads(arguments[0])
    nodes = [NodeSpec(name, parameters) for name, parameters in content["nodes"].items()]
    try:
        run_composed(nodes, namespace=NAMESPACE, lockstep=content["lockstep"], until_signal=True)
    except ShakeError as error:
        print(f"shake_ros: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
