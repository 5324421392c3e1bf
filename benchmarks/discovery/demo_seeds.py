"""Is the effect that the demo hides the one it names? What the study `demo_seeds` measures.

    ./shake campaign demo_seeds --out DIR

Runs `demo` for each effect that it can hide, each time with another seed and so on another table.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

from shake_ros.demonstration.demo import demo
from shake_ros.settings import find, read_yaml


def rows(seeds: int) -> list[dict[str, Any]]:
    """Each hidden effect so many times, every time on another table."""
    effects = sorted(read_yaml(find("demo", "default"))["hidden"])
    return [{"effect": effect, "seed": k} for k, effect in enumerate(effects * seeds, 1)]


def measure(effect: str, seed: int) -> dict[str, Any]:
    """One demo: what it named, errors before and after."""
    with tempfile.TemporaryDirectory() as folder:
        summary = demo(Path(folder) / "demo", seed=seed, hidden=effect, progress=False).summary
    found, tracking = summary["hidden"], summary["tracking"]
    return {
        "named": found["named"] or "nothing",
        "alternatives": found["alternatives"],
        "right": found["named"] == effect,
        "before": found["hold_before"],
        "after": found["hold_after"],
        "tracking_before": tracking["before"],
        "tracking_after": tracking["after"],
    }
