"""A parameter set as the text of its YAML file."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

from shake_ros.core.quantities import Parameters


def text_of(kind: str, parameters: Parameters, comment: Sequence[str]) -> str:
    """The YAML of a controller or an observer with units and meanings."""
    lines = [f"# {line}" for line in comment] + [f"kind: {kind}"]
    for f in dataclasses.fields(parameters):
        value, unit = getattr(parameters, f.name), f.metadata.get("unit", "")
        if isinstance(value, str):
            if value:
                lines.append(f"{f.name}: {value}")
            continue
        if isinstance(value, bool):
            value = str(value).lower()
        note = f"{unit}, {f.metadata['meaning']}" if unit not in ("", "-") else str(f.metadata["meaning"])
        lines.append(f"{f'{f.name}: {value} ':36s}# {note}")
    return "\n".join(lines) + "\n"
