"""What the node `twin` has published, as the page shows it: each followed parameter over time, and the changes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

MOST = 400  # windows that are kept; of the older ones every other, again and again


class TwinStatus(NamedTuple):
    """A status of the topic `twin`. name : behind `twin`; text : for a person; values : by key."""

    name: str
    level: int
    text: str
    values: Mapping[str, str]


class TwinHistory:
    """Filled by the node, read by the server's thread.

    Attributes
    ----------
    content : ends of the windows since the reference [s], parameters with their curves, changes.
    """

    def __init__(self) -> None:
        self.content: dict[str, Any] = {"time": [], "parameters": [], "changes": []}

    def add(self, stamp: float, statuses: Sequence[TwinStatus]) -> None:
        """A window: its end [s]; statuses of table, parameters and changes. A new reference begins anew."""
        from shake_ros.report.text import unit_of  # slow to import

        found: dict[str, Any] = {"time": [], "parameters": [], "changes": []}
        table, *rest = statuses
        if table.values["state"] != "learning":
            before = self.content
            kept = slice(None, None, 1 if len(before["time"]) < MOST else 2)
            found["time"] = [*before["time"][kept], stamp]
            past = {one["name"]: one for one in before["parameters"]}
            for name, level, text, values in rest:
                if "since" in values:
                    found["changes"].append({**values, "level": level, "since": int(values["since"]) * 1e-9})
                    continue
                factor, unit = unit_of(values["unit"])
                curves = {
                    key: [*past.get(name, {key: []})[key][kept], float(f"{factor * float(values[key]):.6g}")]
                    for key in ("value", "low", "high")
                }
                found["parameters"].append({"name": name, "unit": unit, "text": text, **curves})
        self.content = found
