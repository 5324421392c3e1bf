"""The page of a design: the motion, what it is expected to settle, and the rivals' predictions side by side."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from shake_ros.experiment_design.design import HARDLY, PredictedExcitation
from shake_ros.report.chart import Chart, ChartSeries, Panel
from shake_ros.report.page import Page
from shake_ros.report.text import sentence

if TYPE_CHECKING:
    from shake_ros.experiment_design.next_recording import NextRecording

COLOURS = ("c1", "c2", "c3", "c4")


def next_page(asked: NextRecording) -> Page:
    """The page."""
    lines = list(asked.lines())
    page = Page("The next recording", sentence(lines[0]))
    page.heading("Motion")
    for line in lines[1:]:
        page.paragraph(sentence(line.strip()))
    shown = asked.prediction
    if shown is not None:
        rows = [
            (s.rival, f"{s.gain:.1f}", "yes" if s.gain > HARDLY else "no")
            for s in sorted(shown.separations, key=lambda s: -s.gain)
        ]
        page.table(("model that is open", "expected gain in log likelihood [nats]", "distinguished"), rows)
        if asked.motion is not None:
            page.link("drive.yaml, the reference to play", "drive.yaml")
        page.chart(prediction_chart(shown))
    return page


def prediction_chart(shown: PredictedExcitation) -> Chart:
    """Reference, and what each rival would leave unexplained once it is refitted to the recording."""
    record = shown.record
    time = np.arange(len(record.commands)) * record.sample_time
    rests = [
        ChartSeries(s.rival, s.left, COLOURS[i % len(COLOURS)]) for i, s in enumerate(shown.separations) if len(s.left)
    ]
    felt = record.acceleration if record.acceleration is not None else np.gradient(record.velocity, record.sample_time)
    panels = (
        Panel("position [mm]", time, (ChartSeries("reference", 1e3 * shown.samples[:, 0], "c5"),), height=130),
        Panel("acceleration [m/s²]", time, (ChartSeries("predicted by the model found", felt, "c0"),), height=150),
        Panel("left by a rival [m/s²]", time[record.start :], tuple(rests)),
    )
    caption = (
        "The motion, its acceleration, and what each rival, refitted to it, would leave unexplained if the model found "
        "is true"
    )
    return Chart("next_recording", "time [s]", panels, caption)
