"""compare.json: every run of a comparison with its figures, in SI units, and a summary of each controller."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any

from shake_ros.core.loop.metrics import MEANINGS, UNITS, Metrics, Outcome, Summary

SCHEMA = "shake_ros.compare/1"


def metrics_json(metrics: Metrics) -> dict[str, float | bool | None]:
    """Figures by name; null for what a run does not have."""
    values = dataclasses.asdict(metrics)
    return {k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in values.items()}


def _outcome_json(outcome: Outcome) -> dict[str, Any]:
    table = {"perturbed_table": outcome.table} if outcome.table >= 0 else {}
    return {
        "entry": outcome.entry,
        "reference": outcome.reference,
        "load": outcome.load,
        **table,
        **metrics_json(outcome.metrics),
    }


def _summary_json(summary: Summary) -> dict[str, Any]:
    found = {name: metrics_json(getattr(summary, name)) for name in ("mean", "worst", "perturbed_worst")}
    for figures in found.values():
        for name in ("end_stop", "unstable"):
            del figures[name]
    return {"entry": summary.entry, **found, "unstable": summary.unstable, "end_stops": summary.end_stops}


def comparison_json(
    outcomes: Sequence[Outcome], summaries: Sequence[Summary], settings: Mapping[str, Any]
) -> dict[str, Any]:
    """Content of compare.json (schema shake_ros.compare/1)."""
    return {
        "schema": SCHEMA,
        "units": {**UNITS, "load": "kg"},
        "meanings": MEANINGS,
        "settings": dict(settings),
        "summaries": [_summary_json(s) for s in summaries],
        "runs": [_outcome_json(o) for o in outcomes if o.table < 0],
        "perturbed_runs": [_outcome_json(o) for o in outcomes if o.table >= 0],
    }
