"""The page of `close_loop`: models before and after, ranking of the candidates, residual, what remains."""

from __future__ import annotations

from collections.abc import Sequence

from shake_ros.core.discovery.close_loop import LoopClosure
from shake_ros.core.discovery.decision import ForwardStep
from shake_ros.core.discovery.declared_fit import FittedModel
from shake_ros.core.effects import EFFECTS
from shake_ros.core.identification.diagnosis import Diagnosis
from shake_ros.core.identification.recordings import Record
from shake_ros.core.identification.uncertainty import Estimate
from shake_ros.core.loop.benefit import Benefit
from shake_ros.report import figures_fit
from shake_ros.report.identification_section import diagnosis_section
from shake_ros.report.page import Page
from shake_ros.report.tracking_section import tracking_section


def percent(value: float | None) -> str:
    """A relative error in per cent."""
    return "–" if value is None else f"{100 * value:.2f} %"


def parameter_table(page: Page, before: Sequence[Estimate], after: Sequence[Estimate]) -> None:
    """Parameters of two models side by side with standard errors."""

    def cell(p: Estimate | None) -> str:
        if p is None:
            return "–"
        return f"{p.value:.4g} " + ("(at bound)" if p.std_error is None else f"± {p.std_error:.2g}")

    first = {p.name: p for p in before}
    rows = [[p.name, cell(first.get(p.name)), cell(p), p.unit] for p in after]
    page.table(["parameter", "declared model", "extended model", "unit"], rows)


def error_table(page: Page, before: FittedModel, after: FittedModel) -> None:
    """Errors of both models per recording."""
    rows = []
    for role in ("learn", "hold"):
        for name, e in getattr(before, role).items():
            f = getattr(after, role)[name]
            rows.append(
                [f"{name} ({'fitted' if role == 'learn' else 'held out'})"]
                + [percent(x.get(c)) for c in ("velocity", "acceleration") for x in (e, f)]
            )
    page.table(["recording", "velocity before", "velocity after", "acceleration before", "acceleration after"], rows)


def step_section(page: Page, step: ForwardStep, baseline_hold: float) -> None:
    """Which effect was added, why, and what else was tried."""
    effect = EFFECTS[step.chosen.candidate.effect]
    page.heading(f"Added: {step.chosen.candidate.effect} ({step.chosen.candidate.place})")
    page.paragraph((effect.__doc__ or "").strip().splitlines()[0])
    why = (
        f"Of {len(step.ranking)} effects refitted after screening, this one leaves the smallest error on the "
        f"recordings that the fit has not seen: {step.chosen.result.validation_cost:.3g} weighted mean square, "
        f"against {baseline_hold:.3g} before"
    )
    if len(step.ranking) > 1:
        why += f" and {step.ranking[1].result.validation_cost:.3g} with {step.ranking[1].candidate.effect}, the next"
    page.paragraph(why + ".")
    if step.alternatives:
        page.paragraph(f"These recordings cannot tell it apart from: {', '.join(step.alternatives)}.")
    page.figure(figures_fit.ranking_figure(step.ranking, baseline_hold), "Candidates refitted with all parameters")
    if step.chosen.candidate.effect == "unlisted":
        depends = ", ".join(step.chosen.candidate.depends_on)
        page.paragraph(
            f"No listed effect explains the residual. It acts at {step.chosen.candidate.place} "
            f"and depends on {depends}."
        )
        page.figure(figures_fit.unlisted_figure(step.chosen.result.fit), "The function without a name, as estimated")


def model_sections(page: Page, result: LoopClosure, hold: list[Record]) -> None:
    """Steps, errors, parameters, figures on the recordings held out, what remains."""
    before_hold = result.search.declared.validation_cost
    for step in result.search.steps:
        step_section(page, step, before_hold)
        before_hold = step.chosen.result.validation_cost
    page.heading("Error of the free run")
    page.paragraph(
        "Simulated from the recorded valve command alone; rms(measured − simulated) / rms(measured − mean). "
        f"Sensor noise alone: {result.noise['velocity']:.2g} m/s"
        + (f" and {result.noise['acceleration']:.2g} m/s²." if "acceleration" in result.noise else ".")
    )
    error_table(page, result.baseline, result.final)
    depends = [d for s in result.search.steps for d in s.chosen.candidate.depends_on]
    for record in {r.name: r for r in reversed(hold)}.values():
        runs = figures_fit.free_runs(record, result.baseline.table, result.final.table, result.model)
        page.figure(figures_fit.time_histories(record, *runs), f"{record.name} (held out): liveliest two seconds")
        if record.acceleration is not None:
            page.figure(figures_fit.spectra(record, *runs), f"{record.name}: spectrum of the acceleration")
        mass = result.model.moved_mass(result.final.table)
        page.figure(
            figures_fit.residual_figure(record, *runs, depends, mass, result.model),
            f"{record.name}: residual against what the effect depends on",
        )
    page.heading("Parameters")
    parameter_table(page, result.baseline.parameters, result.final.parameters)
    page.heading("What remains")
    page.paragraph(result.remaining.text[0].upper() + result.remaining.text[1:] + ".")


def close_loop_page(
    result: LoopClosure,
    learn: list[Record],
    hold: list[Record],
    diagnosis: Diagnosis | None = None,
    benefit: Benefit | None = None,
) -> str:
    """The whole page as HTML."""
    named = ", ".join(s.chosen.candidate.effect for s in result.search.steps) or "nothing"
    learned = ", ".join(dict.fromkeys(r.name for r in learn))
    held = ", ".join(dict.fromkeys(r.name for r in hold))
    page = Page("What does the model lack?", f"Learned on {learned}; held out {held}. Missing: {named}.")
    model_sections(page, result, hold)
    if benefit:
        tracking_section(page, benefit)
    if diagnosis:
        diagnosis_section(page, diagnosis)
    return page.render()
