"""The page of `follow`: what changed, each parameter over time with its band, prediction beside measurement."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from shake_ros.report.chart import Chart, ChartSeries, Panel
from shake_ros.report.page import Made, Page, Source
from shake_ros.report.result_table import percent
from shake_ros.report.text import rounded, unit_of
from shake_ros.twin.naming import ESTABLISHED, NOT_EXPLAINED, ONE_OF_THESE
from shake_ros.twin.text import action_text, date, instant, month_lines, rivals_text, what_text
from shake_ros.twin.twin import INTERVAL, PAUSED

if TYPE_CHECKING:
    from shake_ros.twin.follow import Following

VIEW = 2.0  # of the prediction at first [s]
TITLES = {"effects.payload_error.mass": "mass beside the declared one", "sensor.delay": "delay of the accelerometer"}


def follow_page(found: Following, command: str = "") -> Page:
    """The page."""
    sources = tuple(
        Source(r.name, "followed", len(r) * r.sample_time, len(r), 1.0 / r.sample_time) for r in found.recordings
    )
    page = Page("Twin", _lead(found), Made(command, sources))
    page.cards(_cards(found))
    page.heading("Changes")
    _changes(page, found)
    page.heading("Parameters over time")
    page.paragraph("The shaded band is the 90 % interval. A parameter that the motion does not excite keeps its value.")
    page.chart(_curves(found))
    _table(page, found)
    if found.months:
        page.heading("From day to day")
        page.chart(_months(found))
        lines = [line for row in zip(found.months, found.limits, strict=True) for line in month_lines(*row)]
        page.paragraph("; ".join(lines) + "." if lines else "No parameter has a trend or a step.")
    if found.latest:
        page.heading("Prediction")
        page.chart(_prediction(found))
    _pauses(page, found)
    return page


def _lead(found: Following) -> str:
    if not found.changes:
        return "Nothing has changed since the reference."
    verdicts = [c.named.verdict for c in found.changes]
    causes = (
        ("an established cause", ESTABLISHED),
        ("several possible causes", ONE_OF_THESE),
        ("no known cause", NOT_EXPLAINED),
    )
    parts = [f"{verdicts.count(v)} with {words}" for words, v in causes if v in verdicts]
    many = "changes have" if len(verdicts) > 1 else "change has"
    return f"{len(verdicts)} {many} been noticed since the reference: {', '.join(parts)}."


def _cards(found: Following) -> list[tuple[str, str]]:
    hours = sum(w.stamp - w.start for w in found.windows) * 1e-9 / 60.0
    state = "unexplained change" if any(not c.named.explained for c in found.changes) else "changed"
    return [
        (state if found.changes else "unchanged", "state of the table"),
        (f"{hours:.1f} min", "followed"),
        (percent(found.error), "error of the acceleration in free runs of the reference"),
    ]


def _changes(page: Page, found: Following) -> None:
    if not found.changes:
        page.paragraph("None was noticed.")
        return
    head = ("since", "what", "place", "or one of these", "error before", "since then", "with it", "what to do")
    rows = [
        (
            *(instant(c.since, c.recording, c.at), what_text(c), c.named.place, rivals_text(c) or "–"),
            *map(percent, c.named.error),
            action_text(c),
        )
        for c in found.changes
    ]
    page.table(head, rows, warn=[i for i, c in enumerate(found.changes) if not c.named.explained])
    page.paragraph(
        "Error: of the acceleration in free runs, before the change, since then with the old model, and with "
        "the change in the model. A change lies in the window that begins at the first instant. Of several that these "
        "windows cannot distinguish, table.yaml has the one that is a followed parameter; where none is, and where "
        "nothing explains a change, it is left as the table was known before.",
        note=True,
    )


def _title(name: str) -> str:
    return TITLES.get(name, name.removeprefix("effects."))


def _time(found: Following) -> np.ndarray:
    """Followed time behind each window [s], without the time between recordings."""
    return np.cumsum([(w.stamp - w.start) * 1e-9 for w in found.windows])


def _curves(found: Following) -> Chart:
    """Each parameter over time."""
    first = len(found.windows) - len(found.known)
    time, windows = _time(found)[first:], found.known
    panels = []
    for i, (name, unit) in enumerate(zip(found.names, found.units, strict=True)):
        factor, text = unit_of(unit)
        value = factor * np.array([w.values[i] for w in windows])
        low, high = (factor * np.array(ends) for ends in zip(*((e[i] for e in w.ends) for w in windows), strict=True))
        series = (
            ChartSeries("upper end", high, "grey", width=0.5),
            ChartSeries("lower end", low, "grey", width=0.5),
            ChartSeries(_title(name), value, "c0", width=1.6),
        )
        panels.append(Panel(f"[{text or '-'}]", time, series, height=130, band=(0, 1)))
    begun = {(c.recording, c.since) for c in found.changes}
    at = list(zip(_time(found), found.windows, strict=True))
    shaded = [(t - (w.stamp - w.start) * 1e-9, t) for t, w in at if (w.recording, w.start) in begun]
    caption = "Followed parameters; the shaded stretches are the windows in which a change began"
    return Chart("parameters", "time followed [s]", tuple(panels), caption, shaded=tuple(shaded))


def _months(found: Following) -> Chart:
    """Each parameter from day to day with what explains it."""
    panels = []
    for r in found.months:
        factor, text = unit_of(r.unit)
        half, (model, _) = INTERVAL * r.deviations, r.predicted(r.days)
        series = (
            ChartSeries("upper end", factor * (r.values + half), "grey", width=0.5),
            ChartSeries("lower end", factor * (r.values - half), "grey", width=0.5),
            ChartSeries(_title(r.name), factor * r.values, "c0", kind="points"),
            ChartSeries("trend and steps", factor * model, "after"),
        )
        panels.append(Panel(f"[{text or '-'}]", r.days, series, height=130, band=(0, 1)))
    caption = f"What was known at the end of each day since {date(found.months[0], 0.0)}, with its 90 % interval"
    return Chart("months", "time [d]", tuple(panels), caption)


def _table(page: Page, found: Following) -> None:
    rows = []
    first, last = found.known[0], found.known[-1]
    for name, unit, a, b, d in zip(found.names, found.units, first.values, last.values, last.deviations, strict=True):
        factor, text = unit_of(unit)
        half = factor * INTERVAL * d
        rows.append(
            (
                _title(name),
                rounded(factor * a, half),
                rounded(factor * b, half),
                f"{rounded(factor * b - half, half)} … {rounded(factor * b + half, half)}",
                text or "-",
            )
        )
    page.table(("parameter", "reference", "now", "90 % interval", "unit"), rows)


def _prediction(found: Following) -> Chart:
    """Measured and predicted motion of the latest windows."""
    motion = np.concatenate([w.motion for w in found.latest])
    time = np.arange(len(motion)) * found.recordings[-1].sample_time
    rows = (
        Panel(
            "acceleration [m/s²]",
            time,
            (
                ChartSeries("measured", motion[:, 4], "measured", width=1.8),
                ChartSeries("predicted", motion[:, 2], "after"),
            ),
        ),
        Panel(
            "error [m/s²]", time, (ChartSeries("measured − predicted", motion[:, 4], "c0", motion[:, 2]),), height=120
        ),
        Panel("position [mm]", time, (ChartSeries("measured", 1e3 * motion[:, 3], "measured"),), height=120),
        Panel(
            "error [µm]",
            time,
            (ChartSeries("measured − predicted", 1e6 * motion[:, 3], "c0", 1e6 * motion[:, 0]),),
            height=120,
        ),
    )
    caption = "The latest motion: each sample predicted from all that was measured before it"
    return Chart("prediction", "time [s]", rows, caption, view=(0.0, min(VIEW, float(time[-1]))))


def _pauses(page: Page, found: Following) -> None:
    paused = [w for w in found.windows if w.state == PAUSED]
    if paused:
        page.heading("Pauses")
        page.table(("at", "why"), [(instant(w.start, w.recording, w.at), w.note) for w in paused])
