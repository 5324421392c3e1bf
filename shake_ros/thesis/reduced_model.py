"""Thesis 6.3.7 and 6.4.1: the reduced model (6.36) against the full one over frequency, and in the observer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from shake_ros.api.progress import Progress
from shake_ros.control.observer import OBSERVERS
from shake_ros.control.observer.runner import Observer
from shake_ros.declared import free_parameters
from shake_ros.fit.free_parameters import FreeParameters
from shake_ros.fit.least_squares import fit
from shake_ros.fit.recording_problem import RecordingProblem
from shake_ros.fit.records import Record, relative_error
from shake_ros.fit.reduced_model import REDUCED
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.physics.plant.reduced import REDUCED_LAYOUT, ReducedParameters
from shake_ros.report.chart import Chart, ChartSeries, Panel
from shake_ros.settings import find, load_table, load_variant, read_yaml
from shake_ros.signals.velocity_filter import filtered_velocity
from shake_ros.thesis.reproduce import (
    Claim,
    ExperimentReport,
    Rows,
    asked_in,
    difference,
    motions,
    recorded,
    sine,
    words,
)

KEYS = (
    "plant", "printed", "fitted_to", "sample_time", "seconds", "frequencies", "amplitude", "shown",
    "accurate_within", "adequate_within",
)  # fmt: skip
BETAS = ("beta1", "beta2", "beta3", "beta4", "beta5")
PRINTED, FITTED = "table 6.11", "fitted here"
SHOWN = 1.0  # end of a run that a figure shows [s]


class Errors(NamedTuple):
    """Relative errors of a free run [-]."""

    velocity: float
    acceleration: float


def fitted(records: list[Record]) -> TableParameters:
    """β that free runs over the recordings fit best, from the linear model that comes nearest."""
    free = FreeParameters(REDUCED.first_table(records), free_parameters(REDUCED))
    return free.table(fit(RecordingProblem(records, REDUCED), free, free.start()).x)


def error(table: TableParameters, record: Record) -> Errors:
    """How far a reduced table's free run lies from the full table's."""
    found = RecordingProblem([record], REDUCED).errors(table.vector())[record.name]
    return Errors(found["velocity"], found["acceleration"])


def observed(name: str, table: TableParameters, record: Record) -> tuple[Errors, np.ndarray]:
    """Errors and estimates of the printed sliding-mode observer with another β."""
    kind, parameters = load_variant("observer", name, OBSERVERS)
    beta = {b: table.value(f"dynamics.{b}") for b in BETAS}
    estimate = Observer(kind, parameters.replace(**beta), record.sample_time).run(record.position, record.commands)
    span, assumed = slice(record.start, None), record.acceleration
    assert assumed is not None
    speed = filtered_velocity(estimate[:, 1], record.sample_time)
    errors = relative_error(record.velocity[span], speed[span]), relative_error(assumed[span], estimate[span, 2])
    return Errors(*errors), estimate


def run(progress: Progress, settings: str = "reduced_model") -> ExperimentReport:
    """Fit of β, errors over frequency, figures 6.37, 6.38, and the observer on both β."""
    asked = asked_in(settings, KEYS)
    plant, dt, seconds = load_table(asked["plant"]), asked["sample_time"], asked["seconds"]

    def record(name: str, wave: Mapping[str, Any]) -> Record:
        return recorded(name, plant, sine(wave, seconds, dt), dt)

    printed_beta = load_variant("observer", asked["printed"], OBSERVERS)[1]
    section = ReducedParameters(**{b: getattr(printed_beta, b) for b in BETAS})
    known = read_yaml(find("reproduce", "inputs"))
    progress("reduced model: β", 0.0)
    models = {
        PRINTED: TableParameters(REDUCED_LAYOUT, {"dynamics": section}),
        FITTED: fitted([record(name, known[name]) for name in asked["fitted_to"]]),
    }
    progress("reduced model: over frequency", 0.5)
    waves = [{"amplitude": asked["amplitude"], "frequency": f} for f in asked["frequencies"]]
    sweep = [record(words(wave), wave) for wave in waves]
    curves = {name: [error(table, r) for r in sweep] for name, table in models.items()}
    shown = {number: record(words(wave), wave) for number, wave in asked["shown"].items()}
    claims, drawn = [], [_frequency_figure(asked, curves)]
    for number, r in shown.items():
        claims += _claims(asked, number, r, models)
        drawn.append(_motion_chart(number, r, models))
    rows, figures = _observer(asked["printed"], shown, models)
    return ExperimentReport(
        title="The reduced model",
        lead=f"Thesis 6.3.7 and 6.4.1: (6.36) against the full table {asked['plant']}.",
        claims=claims,
        tables=[_beta_rows(models), _frequency_rows(asked, curves), rows],
        charts=[*drawn, *figures],
        remarks=(
            f"β is fitted to velocity and acceleration under {', '.join(asked['fitted_to'])}, as in the thesis, but to "
            "runs of the full model where the thesis had its table; the specimen is 200 kg.",
            _range(asked, curves),
            "The input of figures 6.39 to 6.41 is a picture only; the observer is shown under the sines of figures "
            "6.37 and 6.38.",
        ),
    )


def _range(asked: Mapping[str, Any], curves: Mapping[str, Sequence[Errors]]) -> str:
    """Up to which frequency each β is adequate in velocity, and how near it comes in acceleration."""
    parts = []
    for name, errors in curves.items():
        bad = [f for f, e in zip(asked["frequencies"], errors, strict=True) if e.velocity > asked["adequate_within"]]
        below = [f for f in asked["frequencies"] if not bad or f < bad[0]]
        reach = f"up to {below[-1]:g} Hz" if below else "nowhere"
        least = min(e.acceleration for e in errors)
        parts.append(f"with the β {name} {reach}, acceleration not nearer than {100.0 * least:.0f} % at any frequency")
    return f"Velocity stays within {100.0 * asked['adequate_within']:g} %: {'; '.join(parts)}."


def _beta_rows(models: Mapping[str, TableParameters]) -> Rows:
    values = [[models[m].value(f"dynamics.{b}") for m in (PRINTED, FITTED)] for b in BETAS]
    rows = [[f"β_{b[-1]}", f"{p:.4g}", f"{f:.4g}", difference(p, f)] for b, (p, f) in zip(BETAS, values, strict=True)]
    return Rows("Table 6.11", ("parameter", "printed", "here", "difference"), rows)


def _frequency_rows(asked: Mapping[str, Any], curves: Mapping[str, Sequence[Errors]]) -> Rows:
    head = ["frequency [Hz]"] + [f"{channel}, {name}" for name in curves for channel in Errors._fields]
    rows = [
        [f"{f:g}"] + [f"{100.0 * value:.1f} %" for name in curves for value in curves[name][i]]
        for i, f in enumerate(asked["frequencies"])
    ]
    return Rows(f"Error of the free run, amplitude {asked['amplitude']:g}", head, rows)


def _frequency_figure(asked: Mapping[str, Any], curves: Mapping[str, Sequence[Errors]]) -> Chart:
    panels = []
    for channel in Errors._fields:
        series = [
            ChartSeries(name, 100.0 * np.array([getattr(e, channel) for e in found]), f"c{k}", kind="marks")
            for k, (name, found) in enumerate(curves.items())
        ]
        x = np.array(asked["frequencies"], dtype=np.float64)
        panels.append(Panel(f"error of the {channel} [%]", x, tuple(series), log=True))
    caption = f"Error of (6.36) against the full model, sines of amplitude {asked['amplitude']:g}"
    return Chart("over_frequency", "frequency [Hz]", tuple(panels), caption)


def _motion_chart(number: str, record: Record, models: Mapping[str, TableParameters]) -> Chart:
    span = slice(-round(SHOWN / record.sample_time), None)
    found = {name: REDUCED.run(table, record) for name, table in models.items()}
    runs = {f"(6.36), {name}": (out[:, 1], out[:, 2]) for name, out in found.items()}
    caption = f"Figure {number}: full model and (6.36) under {record.name}"
    return motions(f"figure_{number}", "full model", record, runs, span, caption)


def _claims(
    asked: Mapping[str, Any], number: str, record: Record, models: Mapping[str, TableParameters]
) -> list[Claim]:
    found = []
    for name, table in models.items():
        e = error(table, record)
        shown = f"velocity {100.0 * e.velocity:.1f} %, acceleration {100.0 * e.acceleration:.1f} %"
        if number == "6.38":
            holds = max(e) <= asked["accurate_within"]
            text = f"(6.36) is accurate under {record.name}"
        else:
            holds = e.velocity <= asked["adequate_within"] and e.acceleration > asked["accurate_within"]
            text = f"(6.36) is adequate in velocity, not in acceleration, under {record.name}"
        found.append(Claim(f"6.3.7, {number}", f"{text} ({name})", "figure only", shown, holds))
    return found


def _observer(
    name: str, shown: Mapping[str, Record], models: Mapping[str, TableParameters]
) -> tuple[Rows, list[Chart]]:
    rows, drawn = [], []
    for record in shown.values():
        span = slice(-round(SHOWN / record.sample_time), None)
        runs = {}
        for label, table in models.items():
            errors, estimate = observed(name, table, record)
            rows.append([record.name, label, *(f"{100.0 * e:.1f} %" for e in errors)])
            runs[f"observer, {label}"] = (estimate[:, 1], estimate[:, 2])
        caption = f"As figure 6.40: sliding-mode observer under {record.name}"
        drawn.append(motions("observer", "full model", record, runs, span, caption))
    head = ("input", "β of the observer", "velocity", "acceleration")
    return Rows("Error of the sliding-mode observer, λ of table 6.12, open loop without noise", head, rows), drawn
