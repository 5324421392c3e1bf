"""The pages of `identify` and `close_loop`: parameters, errors, added effects, residuals, what remains."""

from __future__ import annotations

from collections.abc import Sequence

from shake_ros.core.discovery.close_loop import LoopClosure
from shake_ros.core.discovery.decision import ForwardStep
from shake_ros.core.discovery.declared_fit import FittedModel
from shake_ros.core.effects import EFFECTS
from shake_ros.core.identification.diagnosis import Diagnosis
from shake_ros.core.identification.nuisances import Nuisance
from shake_ros.core.identification.recordings import Record
from shake_ros.core.identification.uncertainty import Estimate
from shake_ros.core.loop.benefit import TrackingBenefit
from shake_ros.report import figures_fit
from shake_ros.report.page import Page
from shake_ros.report.sections import (
    FREE_RUN,
    benefit_section,
    diagnosis_section,
    error_table,
    identified_section,
    parameter_table,
)
from shake_ros.report.text import sentence


def identify_page(
    model: FittedModel,
    diagnosis: Diagnosis,
    learn: Sequence[str],
    hold: Sequence[str],
    told: Sequence[Estimate] = (),
    offsets: Sequence[Nuisance] = (),
) -> str:
    """The page of `identify` as HTML.

    Parameters
    ----------
    learn, hold : names of the recordings. told, offsets : of a table without a data sheet.
    """
    checked = f"; validated on {', '.join(hold)}" if hold else ""
    page = Page("The fitted model", f"Estimated from {', '.join(learn)}{checked}.")
    identified_section(page, told, offsets)
    page.heading("Parameters")
    parameter_table(page, {"value": model.parameters})
    page.heading("Error of the free run")
    page.paragraph(FREE_RUN)
    error_table(page, {"": model})
    diagnosis_section(page, diagnosis)
    return page.render()


def step_section(page: Page, step: ForwardStep, baseline_hold: float) -> None:
    """Which effect was added, why, and what else was tried."""
    chosen, cost = step.chosen.candidate, step.chosen.result.validation_cost
    page.heading(f"Added: {chosen.effect} ({chosen.place})")
    page.paragraph((EFFECTS[chosen.effect].__doc__ or "").strip().splitlines()[0])
    why = (
        f"Of {len(step.ranking)} effects refitted after screening, this one leaves the smallest error on the "
        f"validation data: a weighted mean square of {cost:.3g}, down from {baseline_hold:.3g}"
    )
    if len(step.ranking) > 1:
        why += (
            f"; the next best, {step.ranking[1].candidate.effect}, leaves {step.ranking[1].result.validation_cost:.3g}"
        )
    page.paragraph(why + ".")
    if step.alternatives:
        page.paragraph(f"These recordings cannot tell it from: {', '.join(step.alternatives)}.")
    page.figure(figures_fit.ranking_figure(step.ranking, baseline_hold), "Candidates, refitted with all parameters")
    if chosen.effect == "unlisted":
        page.paragraph(
            f"No listed effect explains the residual. It acts at {chosen.place} "
            f"and depends on {', '.join(chosen.depends_on)}."
        )
        page.figure(figures_fit.unlisted_figure(step.chosen.result.fit), "The unlisted function, as estimated")


def model_sections(page: Page, result: LoopClosure, hold: list[Record]) -> None:
    """Steps, errors, parameters, figures on the validation data, what remains."""
    before_hold = result.search.declared.validation_cost
    for step in result.search.steps:
        step_section(page, step, before_hold)
        before_hold = step.chosen.result.validation_cost
    models = {"declared model": result.baseline, "extended model": result.final}
    page.heading("Error of the free run")
    felt = f" and {result.noise['acceleration']:.2g} m/s²" if "acceleration" in result.noise else ""
    page.paragraph(f"{FREE_RUN} Sensor noise alone: {result.noise['velocity']:.2g} m/s{felt}.")
    error_table(page, models)
    depends = [d for s in result.search.steps for d in s.chosen.candidate.depends_on]
    for record in {r.name: r for r in reversed(hold)}.values():
        runs = figures_fit.free_runs(record, result.baseline.table, result.final.table, result.model)
        title = f"{record.name} (validation)"
        page.figure(figures_fit.time_histories(record, *runs), f"{title}: the two seconds of fastest motion")
        if record.acceleration is not None:
            page.figure(figures_fit.spectra(record, *runs), f"{title}: spectrum of the acceleration")
        mass = result.model.moved_mass(result.final.table)
        page.figure(
            figures_fit.residual_figure(record, *runs, depends, mass, result.model),
            f"{title}: residual against what the effect depends on",
        )
    page.heading("Parameters")
    parameter_table(page, {name: model.parameters for name, model in models.items()})
    page.heading("What remains")
    page.paragraph(sentence(result.remaining.text))


def close_loop_page(
    result: LoopClosure,
    learn: list[Record],
    hold: list[Record],
    diagnosis: Diagnosis | None = None,
    benefit: TrackingBenefit | None = None,
    told: Sequence[Estimate] = (),
    offsets: Sequence[Nuisance] = (),
) -> str:
    """The page of `close_loop` as HTML; told, offsets : of a table without a data sheet."""
    named = ", ".join(s.chosen.candidate.effect for s in result.search.steps) or "nothing"
    estimation, validation = (", ".join(dict.fromkeys(r.name for r in records)) for records in (learn, hold))
    lead = f"Missing: {named}. Estimated from {estimation}; validated on {validation}."
    page = Page("What the model is missing", lead)
    identified_section(page, told, offsets)
    model_sections(page, result, hold)
    if benefit:
        benefit_section(page, benefit)
    if diagnosis:
        diagnosis_section(page, diagnosis)
    return page.render()
