"""Section of a page: how the identified table follows a reference under the model before and the model after."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from shake_ros.core.loop.benefit import Benefit
from shake_ros.report.page import Page
from shake_ros.report.style import AFTER, BEFORE, MEASURED, new_figure, tidy

WINDOW = 2.0  # [s] of the figure, about the largest acceleration of the reference


def tracking_figure(benefit: Benefit) -> Figure:
    """Acceleration wanted and reached about its peak, and the error of the position over the whole run."""
    wanted, dt = benefit.before.reference, benefit.before.sample_time
    time = np.arange(len(wanted)) * dt
    peak = int(np.argmax(np.abs(wanted[:, 2])))
    half = round(0.5 * WINDOW / dt)
    span = slice(max(peak - half, 0), peak + half)
    figure = new_figure(9.5, 5.2)
    upper, lower = figure.subplots(2, 1)
    upper.plot(time[span], wanted[span, 2], color=MEASURED, linewidth=1.6, label="reference")
    for run, colour, label in ((benefit.before, BEFORE, "model before"), (benefit.after, AFTER, "model after")):
        upper.plot(time[span], run.truth[span, 2], color=colour, linewidth=1.0, label=label)
        lower.plot(time, 1e3 * (run.truth[:, 0] - wanted[:, 0]), color=colour, linewidth=1.0, label=label)
    tidy(upper, "time [s]", "acceleration [m/s²]")
    tidy(lower, "time [s]", "position error [mm]")
    upper.legend(frameon=False, ncols=3)
    return figure


def tracking_section(page: Page, benefit: Benefit) -> None:
    """What the better model is worth in the loop."""
    page.heading("What it is worth in the loop")
    page.paragraph(
        f"The table as identified follows the reference '{benefit.reference}' in simulation, with sensor noise and "
        "delay: once with the model before in observer and controller, once with the model after. "
        "rms(motion − reference) / rms(reference − mean)."
    )
    errors = benefit.errors()
    rows = [
        [f"model {when}", *(f"{100.0 * errors[when][name]:.2f} %" for name in ("position", "velocity", "acceleration"))]
        for when in ("before", "after")
    ]
    page.table(("", "position", "velocity", "acceleration"), rows)
    page.figure(tracking_figure(benefit), "Acceleration about its peak; error of the position")
