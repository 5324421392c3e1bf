"""The comparison of models with the measured runs, as lines for a terminal."""

from __future__ import annotations

import numpy as np

from shake_ros.core.measured_harmonics.account import measured_distortion
from shake_ros.core.measured_harmonics.comparison import HarmonicComparison, MeasuredModel

NAME = 45  # width of a model's name


def run_lines(comparison: HarmonicComparison, index: int) -> list[str]:
    """One run: a row per order's amplitude of each model shown, its error and its THD."""
    problem = comparison.problem
    run, span = problem.runs[index], problem.spans[index]
    measured = measured_distortion(problem)[index]
    title = f"u = {run.amplitude:g} sin(2π {run.frequency:g} t)"
    lines = [f"{title:<{NAME}}" + "".join(f"{k:>7}" for k in run.orders) + f"{'rms':>9}{'THD [%]':>10}"]
    lines.append(f"{'  measured':<{NAME}}{_numbers(run.measured)}{'':>9}{100 * measured:>10.1f}")
    for model in (*comparison.printed, *comparison.fitted):
        result = model.account
        numbers = _numbers(result.amplitudes[span])
        thd = f"{100 * result.distortion[index]:.1f} ({100 * result.whole_distortion[index]:.1f})"
        lines.append(f"{'  ' + model.name:<{NAME}}{numbers}{result.run_rms[index]:>9.3f}{thd:>14}")
    return lines


def _numbers(values: np.ndarray) -> str:
    return "".join(f"{value:>7.2f}" for value in values)


def model_line(model: MeasuredModel) -> str:
    """A model in a row: parameters fitted, errors, THD errors."""
    fitted, left = model.fitted, model.left_out
    count = str(len(fitted.fit.x)) if fitted else "–"
    criterion = f"{fitted.criterion:.1f}" if fitted else "–"
    points = 100 * model.account.distortion_error
    return (
        f"{model.name:<{NAME}}{count:>7}{model.account.rms:>8.3f}{criterion:>11}"
        f"{f'{left.rms:.3f}' if left else '–':>10}   " + "".join(f"{p:>+7.1f}" for p in points)
    )


def left_out_lines(models: tuple[MeasuredModel, ...]) -> list[str]:
    """Error of each run while it is left out."""
    shown = [m for m in models if m.left_out]
    if not shown:
        return []
    lines = ["", "rms of each run [m/s²], predicted by the model fitted to the others"]
    for model in shown:
        assert model.left_out is not None
        lines.append(f"{model.name:<{NAME}}" + "".join(f"{value:>7.3f}" for value in model.left_out.run_rms))
    return lines


def comparison_lines(comparison: HarmonicComparison) -> list[str]:
    """Runs harmonic by harmonic, then all models against each other."""
    lines = ["amplitude of the acceleration [m/s²] by order; THD of these orders, in brackets of all orders simulated"]
    for index in range(len(comparison.problem.runs)):
        lines += ["", *run_lines(comparison, index)]
    lines += [
        "",
        f"{'':<{NAME}}{'fitted':>7}{'rms':>8}{'criterion':>11}{'left out':>10}"
        "   THD minus measured [points], run by run",
        *(model_line(model) for model in comparison.models),
        "",
        "criterion: the Bayesian one, lower is better; left out: every run predicted by the model fitted to the others",
        *left_out_lines(comparison.models),
        *exchanged_lines(comparison),
        "",
        f"best without a second effect: {comparison.chosen.name}",
        *second_lines(comparison),
    ]
    return lines


def exchanged_lines(comparison: HarmonicComparison) -> list[str]:
    """The last printed model with one group of parameters from the fit at a time."""
    if not comparison.exchanged:
        return []
    return [
        "",
        f"{comparison.printed[-1].name}: where it differs from {comparison.chosen.name}",
        *("  " + model_line(model)[: NAME - 2] + model_line(model)[NAME:] for model in comparison.exchanged),
    ]


def second_lines(comparison: HarmonicComparison) -> list[str]:
    """Whether a second effect pays, by the criterion and by the runs left out."""
    base = comparison.chosen
    if not comparison.seconds or base.fitted is None or base.left_out is None:
        return []
    by_criterion, by_prediction = [], []
    for model in comparison.seconds:
        assert model.fitted is not None and model.left_out is not None
        if model.fitted.criterion < base.fitted.criterion:
            by_criterion.append(model.fitted.name)
        if model.left_out.rms < base.left_out.rms:
            by_prediction.append(model.fitted.name)
    both = [name for name in by_criterion if name in by_prediction]
    return [
        f"better with a second effect, by the criterion:     {', '.join(by_criterion) or 'none'}",
        f"better with a second effect, by the runs left out: {', '.join(by_prediction) or 'none'}",
        f"by both: {', '.join(both) or 'none'}",
    ]
