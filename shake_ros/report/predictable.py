"""What of a residual is predictable at all, and how far drawn runs err: tables on a page."""

from __future__ import annotations

from collections.abc import Sequence

from shake_ros.core.identification.innovations import HORIZONS, RATES, Innovations
from shake_ros.core.identification.predictability import Predictability, verdict
from shake_ros.report.page import Page
from shake_ros.report.text import sentence


def predictable_table(page: Page, parts: Sequence[Predictability]) -> None:
    """What of each residual is predictable at all, in shares of its mean square."""
    page.subheading("What of it is predictable at all")
    page.paragraph(sentence(verdict(parts)))
    page.paragraph(
        "Shares of the residual's mean square. The filter may look ahead, holds the command, its magnitude, its sign "
        "and its square with sign, and has not seen the recording that it is judged by. What does not repeat between "
        "equal commands, beyond the sensor noise, no model that the command drives can have: process noise, or a state "
        "that the recording began with.",
        note=True,
    )
    rows = []
    for p in parts:
        shares = ["–" if s is None else f"{100.0 * s:.0f} %" for s in (p.linear, p.filtered, p.repeated, p.different)]
        role = "validation" if p.held_out else "estimation"
        sizes = f"{p.ratio:.2f} × noise", f"{100.0 * p.noise:.0f} %"
        rows.append([f"{p.name} ({role})", p.channel, *sizes, *shares, f"{p.least_ratio:.2f} × noise"])
    heads = (
        "recording",
        "residual of",
        "size",
        "sensor noise",
        "coherent",
        "a filter takes",
        "repeats",
        "does not repeat",
    )
    page.table((*heads, "at best"), rows)


def innovations_table(page: Page, found: Innovations) -> None:
    """Errors of runs that are drawn towards the measurement, by rate, and of predictions, by horizon."""
    page.subheading("Error of prediction against horizon")
    page.paragraph(sentence(found.text))
    page.paragraph(
        "Rms over validation data in multiples of the sensor noise. A drawn run is corrected at a rate towards what is "
        "measured, as an observer is; beside it stands what sensor noise alone makes of such a run. A prediction is "
        "free from the instant it is made; the measured velocity has looked some 10 ms ahead of that.",
        note=True,
    )
    rows = []
    for channel, errors in found.errors.items():
        cells = zip(errors, found.by_noise[channel], strict=True)
        rows.append([channel, *(f"{e:.2f} ({alone:.2f})" for e, alone in cells)])
    page.table(["drawn at (noise alone)", "free run", *(f"{rate:g} 1/s" for rate in RATES[1:])], rows)
    rows = [[channel, *(f"{e:.2f}" for e in errors)] for channel, errors in found.horizons.items()]
    page.table(["predicted ahead by", *(f"{1e3 * h:g} ms" for h in HORIZONS)], rows)
