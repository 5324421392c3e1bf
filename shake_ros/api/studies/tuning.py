"""The study `tune`: the gains of each controller, tuned on several draws of perturbed tables."""

from __future__ import annotations

from typing import Any

from shake_ros.api.tune import tune


def gains(controller: str, settings: str, seed: int, evaluations: int) -> dict[str, Any]:
    """Cost before and after, and the gains.

    Parameters
    ----------
    controller : config/controller. settings : config/tune. seed : of the perturbed tables.
    evaluations : sets of gains that are tried, at most.
    """
    found = tune(controller, settings, progress=False, seed=seed, evaluations=evaluations)
    return {
        "before": found.before,
        "after": found.after,
        "ratio": found.after / found.before,
        "better": found.after < found.before,
        "gains": [
            {"gain": name, "value": value, "times the first": value / found.start[name]}
            for name, value in found.gains.items()
        ],
    }
