"""The page of `schedule`: errors side by side, and what the window of the transform does not see."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from shake_ros.core.identification.recordings import Record
from shake_ros.core.identification.schedule import WINDOW, Training
from shake_ros.report.page import Page
from shake_ros.report.style import AFTER, BEFORE, MEASURED, new_figure, tidy
from shake_ros.report.text import percent

SMOOTH = 0.5  # of the running error shown [s]


def running_error(record: Record, runs: dict[str, np.ndarray], change: float | None) -> Figure:
    """Root mean square of the acceleration's error over SMOOTH, of each model; the blind window shaded."""
    assert record.acceleration is not None
    dt, n = record.sample_time, max(round(SMOOTH / record.sample_time), 1)
    figure = new_figure(9.5, 3.4)
    axes = figure.subplots()
    time = np.arange(len(record.commands)) * dt
    for (name, out), colour in zip(runs.items(), (MEASURED, BEFORE, AFTER), strict=False):
        square = np.convolve((record.acceleration - out[:, 2]) ** 2, np.ones(n) / n, mode="same")
        axes.plot(time[record.start :], np.sqrt(square[record.start :]), color=colour, linewidth=1.4, label=name)
    spans = [0.0] if change is None else [0.0, change]
    for first in spans:
        axes.axvspan(first, first + WINDOW, color=BEFORE, alpha=0.08, linewidth=0.0)
    tidy(axes, "time [s]", "error of the acceleration [m/s²]")
    axes.legend(frameon=False, ncols=3)
    return figure


def schedule_page(
    training: Training,
    compared: Sequence[tuple[Record, dict[str, np.ndarray]]],
    content: dict[str, Any],
    change: float | None,
) -> str:
    """The whole page as HTML."""
    page = Page("Scheduled parameters or a physical effect?", "Both estimated from the same windows of two seconds.")
    page.paragraph(
        "The network gives θ_1 … θ_7 for the amplitude and the frequency of the command over the last two seconds; "
        "the other model has one effect more and a single set of parameters. "
        f"Training took {training.epochs} epochs; the mean square of the scaled error is {training.learn:.2g} on the "
        f"training data and {training.test:.2g} on the test data."
    )
    page.heading("Error of the free run on the validation data")
    rows = dict(content["error"])
    for key, title in (("within_window", "first two seconds after the change"), ("later", "later")):
        if "after_change" in content:
            rows[title] = content["after_change"][key]
    table = [
        [title, name, *(percent(e.get(c)) for c in ("velocity", "acceleration"))]
        for title, models in rows.items()
        for name, e in models.items()
    ]
    page.table(["recording", "model", "velocity", "acceleration"], table)
    for k, (record, runs) in enumerate(compared):
        if record.acceleration is not None:
            caption = f"{record.name}: running rms error; shaded: the window does not yet cover the change"
            page.figure(running_error(record, runs, change if k == 0 else None), caption)
    return page.render()
