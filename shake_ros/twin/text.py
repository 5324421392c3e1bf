"""What the twin found, in words."""

from __future__ import annotations

import datetime

from shake_ros.report.result_table import percent
from shake_ros.report.text import rounded, unit_of
from shake_ros.twin.naming import Hypothesis
from shake_ros.twin.twin import INTERVAL, Change

A_DATE = 86400 * 10**9 * 365  # stamps from which on are a clock's, not those of a recording that begins at zero [ns]


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
    factor, unit = unit_of(h.unit)
    half = INTERVAL * h.deviation
    if h.name == h.parameter and h.before > 0.0:  # a number of the declared model
        low, high, ratio = ((h.after + way * half) / h.before for way in (-1.0, 1.0, 0.0))
        return f"{h.name} × {ratio:.2f} ({low:.2f} … {high:.2f})"
    values = [rounded(factor * v, factor * half or None) for v in (h.after, h.after - half, h.after + half)]
    was = f"{rounded(factor * h.before, factor * half or None)} → " if h.before else ""
    name = h.name if h.parameter.count(".") < 2 else f"{h.name}: {h.parameter.rpartition('.')[2]}"
    return f"{name} {was}{values[0]} ({values[1]} … {values[2]}) {unit}".rstrip()


def change_text(change: Change) -> str:
    """A change in one line."""
    named, since = change.named, instant(change.since, change.recording, change.at)
    before, after, left = (percent(e) for e in named.error)
    errors = f"acceleration error {before} → {after}"
    if not named.explained:
        return f"something changed since {since} that no effect explains, place {named.place}; {errors}"
    if not named.rivals:
        return f"{hypothesis_text(named.best)} since {since}; {errors}, {left} with it"
    every = ", or ".join(hypothesis_text(h) for h in (named.best, *named.rivals))
    kept = f"the table has {named.kept.name}" if named.kept.followed else "the table is left as it was"
    return f"one of these since {since}: {every}; {errors}, {left} with the first; {kept}"
