"""The comparison of models with the measured runs → JSON and CSV."""

from __future__ import annotations

import csv
import io
from typing import Any

from shake_ros.core.measured_harmonics.account import measured_distortion
from shake_ros.core.measured_harmonics.comparison import HarmonicComparison, MeasuredModel

SCHEMA = "shake_ros.measured_runs/1"


def _model_json(model: MeasuredModel) -> dict[str, Any]:
    result = model.account
    content: dict[str, Any] = {
        "name": model.name,
        "rms": result.rms,
        "run_rms": result.run_rms.tolist(),
        "thd": result.distortion.tolist(),
        "thd_all_orders": result.whole_distortion.tolist(),
    }
    if model.fitted:
        free, x = model.fitted.fit.free, model.fitted.fit.x
        values = (x * free.scale).tolist()
        content["effect"] = model.fitted.effect
        content["criterion"] = model.fitted.criterion
        content["parameters"] = {
            f.name: {"value": value, "unit": f.unit, "at_bound": not f.low < value < f.high}
            for f, value in zip(free.free, values, strict=True)
        }
    if model.left_out:
        content["left_out"] = {"rms": model.left_out.rms, "run_rms": model.left_out.run_rms.tolist()}
    return content


def comparison_json(comparison: HarmonicComparison) -> dict[str, Any]:
    """All models with every run's amplitudes [m/s²], THD as a ratio."""
    problem = comparison.problem
    measured = measured_distortion(problem).tolist()
    runs = []
    for run, span, thd in zip(problem.runs, problem.spans, measured, strict=True):
        simulated = {m.name: m.account.amplitudes[span].tolist() for m in comparison.models}
        runs.append(
            {
                "amplitude": run.amplitude,
                "frequency": run.frequency,
                "orders": run.orders.tolist(),
                "measured": run.measured.tolist(),
                "measured_thd": thd,
                "simulated": simulated,
            }
        )
    return {
        "schema": SCHEMA,
        "runs": runs,
        "printed": [_model_json(m) for m in comparison.printed],
        "fitted": [_model_json(m) for m in comparison.fitted],
        "best": comparison.chosen.name,
        "exchanged": [_model_json(m) for m in comparison.exchanged],
        "seconds": [_model_json(m) for m in comparison.seconds],
    }


def comparison_csv(comparison: HarmonicComparison) -> str:
    """One row per run and order: command amplitude, frequency, order, measured, then a column per model [m/s²]."""
    problem, models = comparison.problem, comparison.models
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    head = ["command_amplitude", "frequency_hz", "order", "measured"]
    writer.writerow([*head, *(m.name for m in models)])
    for run, span in zip(problem.runs, problem.spans, strict=True):
        for order, place in zip(run.orders.tolist(), range(span.start, span.stop), strict=True):
            row = [problem.measured[place], *(m.account.amplitudes[place] for m in models)]
            writer.writerow([run.amplitude, run.frequency, order, *(f"{value:.5g}" for value in row)])
    return out.getvalue()
