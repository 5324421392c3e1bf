"""The page of evidence that `commission` leaves: the steps, what each taught, and the curves of each run."""

from __future__ import annotations

from collections.abc import Sequence

from shake_ros.commissioning.steps import UNITS, Step
from shake_ros.report.chart import Chart, ChartSeries, Panel
from shake_ros.report.page import Made, Page
from shake_ros.report.result_table import ResultTable


def run_chart(name: str, title: str, step: Step) -> Chart:
    """Reference and sensors of a run over time, and the command."""
    run = step.run
    assert run.reference is not None and run.valve_command is not None and run.acceleration is not None
    rows = (
        Panel(
            "position [mm]",
            run.time,
            (
                ChartSeries("reference", 1e3 * run.reference[:, 0], "c5", kind="dashed"),
                ChartSeries("measured", 1e3 * run.position, "c0"),
            ),
        ),
        Panel(
            "acceleration [m/s²]",
            run.time,
            (
                ChartSeries("measured", run.acceleration, "c0"),
                ChartSeries("reference", run.reference[:, 2], "c5", kind="dashed"),
            ),
        ),
        Panel("command [-]", run.time, (ChartSeries("valve command", run.valve_command, "c1"),), height=120),
    )
    return Chart(name, "time [s]", rows, f"{title}: reference, sensors and command")


def commission_page(
    steps: Sequence[Step], frame: ResultTable, verdict: str, result: Sequence[str], command: str = ""
) -> str:
    """The page as HTML.

    Parameters
    ----------
    frame : a row for each step.
    verdict : complete, or why it ended.
    result : lines on table and gains that stand beside the page.
    """
    page = Page("Commissioning", verdict, Made(command))
    page.heading("Steps")
    page.result(frame, warn=[i for i, step in enumerate(steps) if step.held])
    scope = (
        "of the true motion if it is known, otherwise of the measured one, over the rms of the reference about its mean"
    )
    page.paragraph(f"Errors are rms errors {scope}.", note=True)
    page.heading("Table and gains")
    for line in result:
        page.paragraph(line)
    for i, step in enumerate(steps):
        title = f"Step {i + 1}, level {step.level:g}"
        page.heading(title)
        limits = [(name, f"{value:.4g} {UNITS[name]}") for name, value in step.limits.items()]
        page.table(("limit of the interlock", "holds beyond"), limits)
        for line in step.findings:
            page.paragraph(line)
        page.chart(run_chart(f"step_{i + 1}", title, step))
    return page.render()
