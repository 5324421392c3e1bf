"""What the twin found, in words, and what to do about it."""

from __future__ import annotations

import datetime
import math

from shake_ros.report.result_table import percent
from shake_ros.report.text import interval_text, rounded, unit_of
from shake_ros.twin.months import DAY, Readings
from shake_ros.twin.naming import Hypothesis
from shake_ros.twin.twin import INTERVAL, Change

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
        return f"end the test, look at the {named.place}, and close the loop with new recordings"
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
