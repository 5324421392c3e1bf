"""The page of `schedule`: errors side by side, and what the window of the transform does not see."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from shake_ros.core.identification.recordings import Record
from shake_ros.core.identification.schedule import WINDOW, Training
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


def schedule_page(
    training: Training,
    compared: Sequence[tuple[Record, dict[str, np.ndarray]]],
    content: dict[str, Any],
    change: float | None,
    command: str = "",
) -> Page:
    """The whole page."""
    lead = "Both estimated from the same windows of two seconds."
    made = made_of(command, (), [record for record, _ in compared])
    page = Page("Scheduled parameters or a physical effect?", lead, made)
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
            page.chart(running_chart(record, runs, change if k == 0 else None))
    return page
