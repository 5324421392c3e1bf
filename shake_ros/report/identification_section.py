"""Section of a page: tests of the residuals, what the recordings identify, and the recording that would help."""

from __future__ import annotations

from shake_ros.core.identification.diagnosis import Diagnosis, Judgement
from shake_ros.report import figures_residual
from shake_ros.report.page import Page


def verdict(passed: bool, probability: float) -> str:
    """Outcome of a test with the probability of as much by chance."""
    return f"{'yes' if passed else 'no'} (p = {probability:.2g})"


def judgement_row(judgement: Judgement) -> list[str]:
    """One recording's row of the table of residual tests."""
    test, split = judgement.test, judgement.split
    total = max(split.linear + split.nonlinear + split.noise, 1e-300)
    parts = [f"{100.0 * part / total:.0f} %" for part in (split.linear, split.nonlinear, split.noise)]
    unit = "m/s²" if judgement.channel == "acceleration" else "m/s"
    return [
        f"{judgement.name}, {'held out' if judgement.held_out else 'fitted'}",
        judgement.channel,
        verdict(test.white, test.auto_p) if test else "too short",
        verdict(test.independent, test.cross_p) if test else "too short",
        *parts,
        f"{judgement.noise:.2g} {unit} ({judgement.noise_from})",
    ]


HEAD = (
    "recording",
    "residual of",
    "white",
    "independent of the drive",
    "unmodelled linear",
    "nonlinear",
    "noise",
    "noise (from)",
)


def residual_section(page: Page, diagnosis: Diagnosis) -> None:
    """Whiteness, independence and the split of the error."""
    page.heading("Is the residual noise?")
    page.paragraph(
        "Tests over ±25 lags at 99 %: white, if its past does not predict it; independent, if the drive does not. "
        "The error's mean square is split into what a linear filter of the drive explains, the noise of the channel "
        "(from repeated periods where the command repeats, else from the band above the dynamics), and the rest, "
        "which is nonlinear."
    )
    page.table(HEAD, [judgement_row(j) for j in diagnosis.judgements])
    if any(j.test for j in diagnosis.judgements):
        page.figure(figures_residual.correlogram(diagnosis.judgements), "Correlation of the residual, band: 99 %")


def identifiability_section(page: Page, diagnosis: Diagnosis) -> None:
    """What the recordings identify and what would help."""
    known = diagnosis.identifiability
    page.heading("What do these recordings identify?")
    page.paragraph(f"{known.text[0].upper()}{known.text[1:]}. {diagnosis.advice[0].upper()}{diagnosis.advice[1:]}.")
    page.figure(figures_residual.correlation_figure(known), "Correlation of the estimates")
    if diagnosis.benefits:
        columns = [known.deviations, *(b.deviations for b in diagnosis.benefits)]
        rows = [[name, *(f"± {100.0 * d[k]:.2g} %" for d in columns)] for k, name in enumerate(known.names)]
        page.table(["parameter", "now", *(f"with {b.candidate.name}" for b in diagnosis.benefits)], rows)


def diagnosis_section(page: Page, diagnosis: Diagnosis) -> None:
    """Both."""
    residual_section(page, diagnosis)
    identifiability_section(page, diagnosis)
