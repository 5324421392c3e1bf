"""The page of evidence that `commission` leaves: the steps, what each taught, and the curves of each run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shake_ros.report.chart import Chart, ChartSeries, Panel
from shake_ros.report.page import Made, Page

Array = NDArray[np.float64]


class CommissionRun(NamedTuple):
    """A step as the page shows it.

    Attributes
    ----------
    title : step and level.
    loop : of the law.
    limits : names and values of the interlock's limits.
    errors : of position, velocity, acceleration, None where the interlock held [-].
    held : its reason for a hold, empty where there was none.
    findings : what was concluded from the run, in lines.
    time : shape (n,) [s].
    reference, motion : shape (n, 3) [m], [m/s], [m/s²].
    command : shape (n,) [-].
    """

    title: str
    loop: str
    limits: Sequence[tuple[str, str]]
    errors: tuple[float, float, float] | None
    held: str
    findings: Sequence[str]
    time: Array
    reference: Array
    motion: Array
    command: Array


def run_chart(name: str, run: CommissionRun) -> Chart:
    """Reference and sensors of a run over time, and the command."""
    rows = (
        Panel(
            "position [mm]",
            run.time,
            (
                ChartSeries("reference", 1e3 * run.reference[:, 0], "c5", kind="dashed"),
                ChartSeries("measured", 1e3 * run.motion[:, 0], "c0"),
            ),
        ),
        Panel(
            "acceleration [m/s²]",
            run.time,
            (
                ChartSeries("measured", run.motion[:, 2], "c0"),
                ChartSeries("reference", run.reference[:, 2], "c5", kind="dashed"),
            ),
        ),
        Panel("command [-]", run.time, (ChartSeries("valve command", run.command, "c1"),), height=120),
    )
    return Chart(name, "time [s]", rows, f"{run.title}: reference, sensors and command")


def commission_page(runs: Sequence[CommissionRun], verdict: str, result: Sequence[str], command: str = "") -> str:
    """The page as HTML.

    Parameters
    ----------
    verdict : complete, or why it ended.
    result : lines on table and gains that stand beside the page.
    """
    page = Page("Commissioning", verdict, Made(command))
    page.heading("Steps")
    head = ("step", "loop", "position [%]", "velocity [%]", "acceleration [%]", "interlock")
    rows = []
    for run in runs:
        errors = ("–",) * 3 if run.errors is None else tuple(f"{100.0 * e:.2f}" for e in run.errors)
        rows.append((run.title, run.loop, *errors, run.held or "no hold"))
    page.table(head, rows, warn=[i for i, run in enumerate(runs) if run.held])
    scope = (
        "of the true motion if it is known, otherwise of the measured one, over the rms of the reference about its mean"
    )
    page.paragraph(f"Errors are rms errors {scope}.", note=True)
    page.heading("Table and gains")
    for line in result:
        page.paragraph(line)
    for i, run in enumerate(runs):
        page.heading(run.title)
        page.table(("limit of the interlock", "holds beyond"), [list(limit) for limit in run.limits])
        for line in run.findings:
            page.paragraph(line)
        page.chart(run_chart(f"step_{i + 1}", run))
    return page.render()
