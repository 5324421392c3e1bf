"""What each recording of a force-driven axis has of its own, as lines and as a section; nothing for other models."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from shake_ros.core.identification.axis_model import forecast_errors, position_errors, slow_changes
from shake_ros.core.identification.recordings import Record
from shake_ros.core.identification.slow_changes import SlowChange
from shake_ros.core.plant.parameters import TableParameters
from shake_ros.report.page import Page

OWN = (
    "Estimated from the recording's own position, as friction and amplifiers warm up between recordings and within "
    "them; the level counts all friction against the first recording learned from. The errors of the free run on this "
    "page are with them. From its force alone a run errs by what the last column says."
)


def slow_change_lines(changes: Sequence[SlowChange]) -> list[str]:
    """A line for each recording that has something of its own."""
    return [
        f"of its own, {c.recording}: friction {c.level:.4f} of the level learned, offset {c.offset:+.3f} N, "
        f"drift {c.drift:+.4f} N/s"
        for c in changes
    ]


def position_lines(errors: Mapping[str, Sequence[float]], forecast: Mapping[str, float]) -> list[str]:
    """Position errors of the free runs, and those from the force alone, a line for each recording [m]."""
    return [
        f"position of the free run, {name}: {' → '.join(f'{1e3 * value:.3f}' for value in values)} mm rms"
        + ("" if forecast[name] == values[-1] else f", from its force alone {1e3 * forecast[name]:.3f} mm")
        for name, values in errors.items()
    ]


def slow_changes_section(page: Page, table: TableParameters, records: Sequence[Record]) -> None:
    """What each recording has of its own under a table; nothing where none has."""
    found = slow_changes(table, records)
    if not found:
        return
    errors = [of(table, records) for of in (position_errors, forecast_errors)]
    page.subheading("What each recording has of its own")
    page.paragraph(OWN)
    rows = [
        [c.recording, f"{c.level:.4f}", f"{c.offset:+.3f} N", f"{c.drift:+.4f} N/s"]
        + [f"{1e3 * e[c.recording]:.3f} mm" for e in errors]
        for c in found
    ]
    heads = ("recording", "level of friction", "offset", "drift", "position error", "from its force alone")
    page.table(heads, rows)
