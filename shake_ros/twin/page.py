"""What the twin found, in words with what to do about it, and as the page of `follow`."""

from __future__ import annotations

import datetime
import math
from typing import TYPE_CHECKING

import numpy as np

from shake_ros.report.chart import Chart, ChartSeries, Panel
from shake_ros.report.page import Page, Source
from shake_ros.report.result_table import percent
from shake_ros.report.text import interval_text, rounded, unit_of
from shake_ros.twin.months import DAY, Readings
from shake_ros.twin.naming import ESTABLISHED, NOT_EXPLAINED, ONE_OF_THESE, Hypothesis
from shake_ros.twin.twin import INTERVAL, PAUSED, Change

MONTH = 30.0  # [d]
A_DATE = 86400 * 10**9 * 365  # stamps from which on are a clock's, not those of a recording that begins at zero [ns]
ACTIONS = {  # place of a change → what to do about it
    "valve": "have the spool and its null checked",
    "supply": "check pump, filters and accumulator",
    "flow": "check the seals, and the valve for leakage",
    "compressibility": "bleed the cylinder and check the oil's temperature",
    "friction": "check bearings, seals and lubrication",
    "force": "look for what pushes or holds the table",
    "structure": "inspect the specimen, its fastening, the joints and the base",
    "sensor": "check mounting, cables and calibration of the sensors",
    "timing": "check the signal path and the load of the target computer",
}
URGENT = ("force", "structure", "sensor", "timing")  # places of faults; elsewhere it is wear, which the model follows


def instant(stamp: int, recording: str = "", at: float = 0.0) -> str:
    """A stamp [ns] as a time of day, or as seconds of its recording where it is none of a clock.

    Parameters
    ----------
    recording, at : name, and seconds behind its first sample.

    >>> instant(2_500_000_000), instant(2_500_000_000, "run3", 1.5), instant(1_700_000_000_000_000_000, "run3", 1.5)
    ('2.5 s', 'run3 at 1.5 s', '2023-11-14 22:13:20')
    """
    if stamp < A_DATE:
        return f"{recording} at {at:.1f} s" if recording else f"{stamp * 1e-9:.1f} s"
    return datetime.datetime.fromtimestamp(stamp // 10**9, datetime.timezone.utc).strftime("%Y-%m-%d %H:%M:%S")


def hypothesis_text(h: Hypothesis) -> str:
    """What changed, from which value to which, with its 90 % interval."""
    half = INTERVAL * h.deviation
    if h.name == h.parameter and h.before > 0.0:  # a number of the declared model
        low, high, ratio = ((h.after + way * half) / h.before for way in (-1.0, 1.0, 0.0))
        return f"{h.name} × {ratio:.2f} ({low:.2f} … {high:.2f})"
    factor = unit_of(h.unit)[0]
    was = f"{rounded(factor * h.before, factor * half or None)} → " if h.before else ""
    name = h.name if h.parameter.count(".") < 2 else f"{h.name}: {h.parameter.rpartition('.')[2]}"
    return f"{name} {was}{interval_text(h.after, half, h.unit)}"


def what_text(change: Change) -> str:
    """What changed, by how much."""
    return hypothesis_text(change.named.best) if change.named.explained else "no effect explains it"


def rivals_text(change: Change) -> str:
    """What else it may be; empty where nothing."""
    return "; ".join(hypothesis_text(h) for h in change.named.rivals)


def asks_for_action(change: Change) -> bool:
    """Whether it needs a person before the next test: nothing explains it, or it is a fault whichever answer holds."""
    named = change.named
    return not named.explained or all(h.place in URGENT for h in (named.best, *named.rivals))


def action_text(change: Change) -> str:
    """What to do."""
    named = change.named
    if not named.explained:
        return f"end the test, look at the {named.place}, and repair the model with new recordings"
    return "; ".join(dict.fromkeys(ACTIONS[h.place] for h in (named.best, *named.rivals)))


def error_text(change: Change) -> str:
    """Errors of the acceleration before the change, since then, and with the change in the model."""
    before, after, left = (percent(e) for e in change.named.error)
    model = f", {left} with {'the first' if change.named.rivals else 'it'}" if change.named.explained else ""
    return f"acceleration error {before} → {after}{model}"


def change_text(change: Change) -> str:
    """A change in one line."""
    named, since, errors = change.named, instant(change.since, change.recording, change.at), error_text(change)
    if not named.explained:
        return f"something changed since {since} that no effect explains, place {named.place}; {errors}"
    if not named.rivals:
        return f"{hypothesis_text(named.best)} since {since}; {errors}"
    every = ", or ".join(hypothesis_text(h) for h in (named.best, *named.rivals))
    kept = f"the table has {named.kept.name}" if named.kept.followed else "the table is left as it was"
    return f"one of these since {since}: {every}; {errors}; {kept}"


def date(readings: Readings, day: float) -> str:
    """The date of a day after the first reading."""
    return instant(int(readings.stamps[0] + day * DAY))[:10] if math.isfinite(day) else "never"


def month_lines(r: Readings, limits: tuple[float, float]) -> list[str]:
    """The steps of a parameter, its trend, and when maintenance is due; nothing where it stays."""
    found = []
    for k, size, deviation in r.steps:
        since = f"between {date(r, r.days[k - 1])} and {date(r, r.days[k])}"
        found.append(f"{r.name} changed by {interval_text(size, INTERVAL * deviation, r.unit)} {since}")
    if r.trend:
        change, half = MONTH * r.trend[0], MONTH * INTERVAL * r.trend[1]
        line, due = f"{r.name} changes by {interval_text(change, half, r.unit)} in 30 days", r.due(*limits)
        if due:
            limit = limits[1] if change > 0.0 else limits[0]
            factor, unit = unit_of(r.unit)
            middle, first, last = (date(r, d) for d in due)
            line += f"; it reaches {rounded(factor * limit)} {unit} on {middle} ({first} … {last})"
        found.append(line)
    return found


if TYPE_CHECKING:
    from shake_ros.twin.follow import Following

VIEW = 2.0  # of the prediction at first [s]
TITLES = {"effects.payload_error.mass": "mass beside the declared one", "sensor.delay": "delay of the accelerometer"}


def follow_page(found: Following) -> Page:
    """The page."""
    sources = tuple(
        Source(r.name, "followed", len(r) * r.sample_time, len(r), 1.0 / r.sample_time) for r in found.recordings
    )
    page = Page("Twin", _lead(found), sources)
    page.cards(_cards(found))
    page.heading("Changes")
    _changes(page, found)
    page.heading("Parameters over time")
    page.paragraph(
        "The shaded band is the 90 % interval. A parameter that the motion does not excite keeps its value.", note=True
    )
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
    for c in found.changes:
        place = f" Place: {c.named.place}." if c.named.explained else ""
        page.paragraph(f"{change_text(c)}.{place} What to do: {action_text(c)}.")
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
