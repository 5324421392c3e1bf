"""The page of `schedule`: errors side by side, and what the window of the transform does not see."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from shake_ros.core.identification.network import Training
from shake_ros.core.identification.recordings import Record
from shake_ros.core.identification.schedule import WINDOW
from shake_ros.report.chart import Chart, ChartSeries, Panel
from shake_ros.report.page import Page
from shake_ros.report.sections import made_of
from shake_ros.report.text import percent

SMOOTH = 0.5  # of the running error shown [s]


def running_chart(record: Record, runs: Mapping[str, np.ndarray], change: float | None) -> Chart:
    """Root mean square of the acceleration's error over SMOOTH, of each model; the blind window shaded."""
    assert record.acceleration is not None
    dt, n = record.sample_time, max(round(SMOOTH / record.sample_time), 1)
    time = np.arange(record.start, len(record.commands)) * dt
    series = []
    for (name, out), colour in zip(runs.items(), ("measured", "before", "after"), strict=False):
        square = np.convolve((record.acceleration - out[:, 2]) ** 2, np.ones(n) / n, mode="same")
        series.append(ChartSeries(name, np.sqrt(np.maximum(square[record.start :], 0.0)), colour, width=1.5))
    spans = tuple((first, first + WINDOW) for first in ([0.0] if change is None else [0.0, change]))
    panel = Panel("error of the acceleration [m/s²]", time, tuple(series), height=230)
    caption = f"{record.name}: rms error over {SMOOTH:g} s; shaded: the window does not yet cover the change"
    return Chart(f"error_{record.name}", "time [s]", (panel,), caption, shaded=spans)


def learning_chart(training: Training) -> Chart:
    """Mean squares of the scaled error after every epoch, on the three parts."""
    names = ("to learn", "before"), ("to stop by", "measured"), ("to test", "after")
    series = (ChartSeries(n, training.curves[:, k], colour) for k, (n, colour) in enumerate(names))
    panel = Panel("mean square error [-]", np.arange(float(len(training.curves))), tuple(series), log=True)
    caption = f"Error over the training; predicting the mean gives 1. Kept are the weights of epoch {training.kept}."
    return Chart("training", "epoch", (panel,), caption)


def better_than_one_set(seeds: Sequence[Any]) -> int:
    """How many networks leave less of the acceleration of the windows held out."""
    return sum(s.errors["network"][1] < s.errors["one set"][1] for s in seeds)


def verdict(seeds: Sequence[Any]) -> str:
    """Whether the networks beat one constant set on the windows held out, with the figures."""
    one, network, least = (
        float(np.mean([s.errors[n][1] for s in seeds])) for n in ("one set", "network", "fit to the window")
    )
    wins = better_than_one_set(seeds)
    beats = "beat" if wins == len(seeds) else "do not always beat"
    return (
        f"The networks {beats} one constant set ({wins} of {len(seeds)} seeds): the mean error of the acceleration is "
        f"{percent(network)} with them, {percent(one)} with one set, and {percent(least)} with parameters fitted to "
        "the very window, below which no schedule of these parameters can come."
    )


def answer(errors: Mapping[str, Mapping[str, Mapping[str, float]]]) -> str:
    """Which model leaves the least of the acceleration in the free run, with the errors of all, by recording."""
    means = {
        model: float(np.mean([by_model[model]["acceleration"] for by_model in errors.values()]))
        for model in next(iter(errors.values()))
    }
    best = min(means, key=lambda model: means[model])
    others = ", ".join(f"{percent(value)} with {model}" for model, value in means.items() if model != best)
    return f"{best} leaves {percent(means[best])} of the acceleration unexplained, against {others}."


def schedule_page(
    seeds: Sequence[Any],
    training: Training,
    compared: Sequence[tuple[Record, dict[str, np.ndarray]]],
    content: dict[str, Any],
    change: float | None,
    command: str = "",
) -> Page:
    """The whole page."""
    lead = f"{answer(content['error'])} Both estimated from the same windows of two seconds."
    made = made_of(command, (), [record for record, _ in compared])
    page = Page("Scheduled parameters or a physical effect?", lead, made)
    page.paragraph(
        "The network gives θ_1 … θ_7 for the amplitude and the frequency of the command over the last two seconds; "
        "the other model has one effect more and a single set of parameters. "
        "The network has two hidden layers of 100 sigmoid neurons and is trained with Levenberg–Marquardt on the "
        "parameters fitted to each window, 80 % of them to learn, 10 % to stop by, 10 % to test."
    )
    page.heading("Error of the free run on the validation data")
    errors_of = dict(content["error"])
    for key, title in (("within_window", "first two seconds after the change"), ("later", "later")):
        if "after_change" in content:
            errors_of[title] = content["after_change"][key]
    table = [
        [title, name, *(percent(e.get(c)) for c in ("velocity", "acceleration"))]
        for title, models in errors_of.items()
        for name, e in models.items()
    ]
    page.table(["recording", "model", "velocity", "acceleration"], table)
    for k, (record, runs) in enumerate(compared):
        if record.acceleration is not None:
            page.chart(running_chart(record, runs, change if k == 0 else None))
    page.heading("What the networks make of windows that they have not seen")
    page.paragraph(verdict(seeds))
    names = list(seeds[0].errors)
    rows = [
        [
            *(str(n) for n in (one.seed, one.training.epochs, one.training.kept)),
            *(f"{n:.2g}" for n in (one.training.learn, one.training.stop, one.training.test, one.radial_basis)),
            *(percent(one.errors[name][1]) for name in names),
        ]
        for one in seeds
    ]
    errors = ["learn", "stop by", "test", "test, radial basis"]
    page.table(["seed", "epochs", "kept", *errors, *(f"acceleration, {name}" for name in names)], rows)
    page.chart(learning_chart(training))
    return page
