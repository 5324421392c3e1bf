"""The page of `identify`: parameters, errors, residual tests, what the recordings identify."""

from __future__ import annotations

from collections.abc import Sequence

from shake_ros.core.discovery.declared_fit import FittedModel
from shake_ros.core.identification.diagnosis import Diagnosis
from shake_ros.report.identification_section import diagnosis_section
from shake_ros.report.page import Page


def identify_page(model: FittedModel, diagnosis: Diagnosis, learn: Sequence[str], hold: Sequence[str]) -> str:
    """The whole page as HTML; learn, hold : names of the recordings."""
    held = f"; held out {', '.join(hold)}" if hold else ""
    page = Page("The fitted model", f"Fitted to {', '.join(learn)}{held}.")
    page.heading("Parameters")
    rows = [
        [p.name, f"{p.value:.4g}", "at bound" if p.std_error is None else f"± {p.std_error:.2g}", p.unit]
        for p in model.parameters
    ]
    page.table(["parameter", "value", "std. error", "unit"], rows)
    page.heading("Error of the free run")
    page.paragraph("Simulated from the recorded command alone; rms(measured − simulated) / rms(measured − mean).")
    errors = [
        [f"{name} ({title})", *(f"{100.0 * e[c]:.2f} %" if c in e else "–" for c in ("velocity", "acceleration"))]
        for title, found in (("fitted", model.learn), ("held out", model.hold))
        for name, e in found.items()
    ]
    page.table(["recording", "velocity", "acceleration"], errors)
    diagnosis_section(page, diagnosis)
    return page.render()
