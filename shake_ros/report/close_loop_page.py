"""What the page of `close_loop` has of its own: what was found and why, and the missing force."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from shake_ros.control.trials import TrackingBenefit
from shake_ros.explain.latent_force import LatentForce
from shake_ros.fit.declared_model import DeclaredModel
from shake_ros.fit.records import Record, longest
from shake_ros.physics.effects import EFFECTS
from shake_ros.repair.close_loop import LoopClosure
from shake_ros.report import charts_fit
from shake_ros.report.chart import Chart, ChartSeries, Panel
from shake_ros.report.charts_fit import LABELS, SCALES, SHOWN
from shake_ros.report.page import Bar, Page
from shake_ros.report.report_json import FoundEffect, found_effects
from shake_ros.report.result_table import percent
from shake_ros.report.sections import (
    errors_section,
    histories_section,
    hydraulic_table,
    parameters_side_by_side,
    slow_changes_section,
)
from shake_ros.report.text import (
    estimate_text,
    force_table,
    force_text,
    function_line,
    largest_force,
    sentence,
    unit_of,
    verdict_sentences,
    why_nothing,
)
from shake_ros.search.closed_form import LearntFunction
from shake_ros.search.decision import ForwardStep
from shake_ros.search.declared_fit import FittedModel
from shake_ros.search.problem import ScoredFit
from shake_ros.signals.stretches import energies

WHAT = (
    "The force that would have to act on the table for the final model to reproduce the measured motion, smoothed "
    "over the whole recording. A fault of valve, oil or supply appears as the force that would replace it. The table "
    "gives the residual of a run without and with the force, and the frequency up to which the force exceeds the noise."
)
SIDES = {  # abscissa → the quantity whose sign parts the two curves, and their names
    "velocity": ("acceleration", ("gaining speed to +x", "gaining speed to −x")),
    "position": ("velocity", ("moving to +x", "moving to −x")),
}


def force_section(page: Page, forces: Sequence[LatentForce], model: DeclaredModel) -> None:
    """One sentence where the force is zero; else sizes, kinds and the charts of the largest one."""
    if not forces:
        return
    page.heading("The force that the model lacks")
    page.paragraph(sentence(force_text(forces)))
    if all(force.kinds.zero for force in forces):
        return
    gauge = " Forces are relative to the assumed area." if model.nuisances else ""
    page.paragraph(f"{WHAT}{gauge}", note=True)
    page.result(force_table(forces))
    force = largest_force(forces)
    page.chart(force_chart(force))
    for name in SIDES:
        chart = against_chart(force, name)
        if chart:
            page.chart(chart)


def force_chart(force: LatentForce) -> Chart:
    """The force over time with its band, and the velocity below; at first about its largest power."""
    lower, upper = force.ends
    series = (
        ChartSeries("force", force.force, "after", width=1.6),
        ChartSeries("upper end", upper, "grey", width=0.6),
        ChartSeries("lower end", lower, "grey", width=0.6),
        ChartSeries("zero", np.zeros(len(force.force)), "measured", kind="dashed", width=1.0),
    )
    panels = (
        Panel(
            f"{'force' if force.unit == 'N' else 'force per mass'} [{force.unit}]",
            force.time,
            series,
            height=210,
            band=(1, 2),
        ),
        Panel(
            "velocity [m/s]", force.time, (ChartSeries("velocity", force.known["velocity"], "measured"),), height=110
        ),
    )
    role = "validation" if force.held_out else "estimation"
    caption = f"{force.recording} ({role}): the force that the model lacks, with its {100.0 * force.band:.0f} % band"
    return Chart(f"force_{force.recording}", "time [s]", panels, caption, view=_strongest(force))


def _strongest(force: LatentForce) -> tuple[float, float]:
    """The segment of largest power."""
    step = float(force.time[1] - force.time[0])
    n = min(round(2.0 * SHOWN / step), len(force.time) - 1)
    first = int(np.argmax(energies(force.force, n)))
    return float(force.time[first]), float(force.time[min(first + n, len(force.time)) - 1])


def against_chart(force: LatentForce, name: str) -> Chart | None:
    """Mean force against a quantity, for each direction of motion: two curves that separate indicate memory."""
    by, (low, high) = SIDES[name]
    sense = np.gradient(force.known["velocity"]) if by == "acceleration" else force.known[by]
    at = SCALES.get(name, 1.0) * force.known[name]
    edges = charts_fit.group_edges(at)
    if len(edges) < 3:
        return None
    middle = 0.5 * (edges[:-1] + edges[1:])
    series = [
        ChartSeries(label, charts_fit.group_means(force.force[side], at[side], edges), colour, kind="marks", width=1.6)
        for label, side, colour in ((low, sense > 0.0, "c0"), (high, sense <= 0.0, "c1"))
    ]
    series.append(ChartSeries("zero", np.zeros(len(middle)), "measured", kind="dashed", width=1.0))
    panel = Panel(f"mean force [{force.unit}]", middle, tuple(series), height=210)
    caption = f"{force.recording}: mean force against {name}, {len(middle)} groups of equal count"
    return Chart(f"force_{name}_{force.recording}", LABELS[name], (panel,), caption)


SIZE = (
    "Effects are compared by the residual-to-noise ratio of the refitted model: the rms of its residual, every "
    "channel in multiples of its sensor noise (at least 0.2 % of the channel's rms); estimation and validation data "
    "count equally, by their geometric mean. Bars start at zero."
)
MODELS = ("declared model", "extended model")


def parameters_section(page: Page, models: Mapping[str, FittedModel]) -> None:
    """Parameters of models side by side."""
    page.heading("Parameters")
    parameters_side_by_side(page, models)
    if all("dynamics.beta5" in m.table.fields and m.table.layout.name == "reduced" for m in models.values()):
        page.subheading("The same as hydraulic frequency, damping and velocity gain")
        hydraulic_table(page, models)


def mean_error(errors: Mapping[str, Mapping[str, float]]) -> float:
    """Mean acceleration error over recordings; of the velocity where there is no accelerometer; NaN of none."""
    found = [e["acceleration" if "acceleration" in e else "velocity"] for e in errors.values()]
    return float(np.mean(found)) if found else math.nan


def error_meaning(model: FittedModel, role: str = "") -> str:
    """What `mean_error` is the mean of. role : of the data; validation, where there are any, without it."""
    role = role or ("validation" if model.validation else "estimation")
    channel = "acceleration" if all("acceleration" in e for e in getattr(model, role).values()) else "velocity"
    return f"error of the free run, {channel}, {role} data"


def _title(step: ForwardStep, function: LearntFunction | None = None) -> str:
    """An effect by its name; an unlisted one by what it depends on and the form that it has."""
    chosen = step.chosen.candidate
    if chosen.effect != "unlisted":
        return chosen.effect
    depends = ", ".join(name.replace("_", " ") for name in chosen.depends_on)
    return f"a function of {depends}" + (f" with the form {function.form.name}" if function else "")


def named(result: LoopClosure) -> str:
    """What is missing, in a phrase."""
    none = "nothing established" if result.candidates or result.remaining.above_noise else "nothing"
    return ", ".join(_title(step, result.function) for step in result.search.steps) or none


def found_section(page: Page, result: LoopClosure, benefit: TrackingBenefit | None) -> None:
    """What is missing, how sure that is, and what it is worth, as cards and a sentence each."""
    page.heading("What was found, and how certain it is")
    steps, rest = result.search.steps, result.remaining
    place = ", ".join(dict.fromkeys(s.chosen.candidate.place for s in steps))
    before, after = (percent(mean_error(m.validation)) for m in (result.baseline, result.final))
    left = f"{rest.ratio:.2f} × noise" if math.isfinite(rest.ratio) else "not known"
    cards = [
        (named(result), f"missing from the declared model{f', place: {place}' if place else ''}"),
        (f"{before} → {after}" if steps else before, error_meaning(result.final)),
        (left, f"what remains: {'above' if rest.above_noise else 'not above'} the noise"),
    ]
    if benefit:
        errors = benefit.errors()
        last, gained = ("tuned", " under gains made for it") if "tuned" in errors else ("after", "")
        cards.append(
            (
                f"{percent(errors['before']['position'])} → {percent(errors[last]['position'])}",
                f"position error when tracking, with the declared and with the extended model{gained}",
            )
        )
    if result.final.test:
        was, now = (percent(mean_error(m.test)) for m in (result.baseline, result.final))
        cards.insert(2, (f"{was} → {now}" if steps else was, error_meaning(result.final, "test")))
    page.cards(cards)
    if not steps and not result.candidates:
        page.paragraph(f"Nothing is added: {why_nothing(result)}.")
    for effect in found_effects(result):
        sentences = verdict_sentences(effect.verdict) if effect.verdict else []
        page.paragraph(" ".join([effect_text(effect, result.function), *sentences]))
    for candidate in result.candidates:
        sentences = verdict_sentences(candidate)
        page.paragraph(" ".join([f"Not added: {candidate.effect} ({candidate.place}).", *sentences]))
    if result.with_candidates:
        page.paragraph(_if_added(result))
    if result.search.stopped:
        page.paragraph("The search was ended early; this is the best answer so far.")


def _if_added(result: LoopClosure) -> str:
    """What the error would be with the candidates."""
    errors = result.with_candidates
    channels = [c for c in ("velocity", "acceleration") if all(c in of for of in errors.values())]
    left = ", ".join(f"{name} {' and '.join(percent(of[c]) for c in channels)}" for name, of in errors.items())
    what = "all of these" if len(result.candidates) > 1 else "it"
    return f"With {what} in the model the error of {' and '.join(channels)} on validation data would be {left}."


def effect_text(effect: FoundEffect, function: LearntFunction | None = None) -> str:
    """An added effect with its values, and what could replace it, in the final model if there is a verdict."""
    values = [
        f"{p.name.rpartition('.')[2]} {estimate_text(p)} {unit_of(p.unit)[1]}".rstrip()
        for p in effect.parameters
        if effect.name != "unlisted"
    ]
    refitted = len(effect.step.ranking) - 1
    if effect.alternatives:
        sure = f"These recordings cannot distinguish it from {', '.join(effect.alternatives)}."
    elif refitted:
        sure = f"The recordings distinguish it from the {refitted} other effects that were refitted."
    else:
        sure = "No other effect was refitted to free runs in its place."
    shown = f": {', '.join(values)}" if values else ""
    return f"{_title(effect.step, function)} ({effect.place}){shown}. {sure}"


def step_section(page: Page, step: ForwardStep, without: ScoredFit, function: LearntFunction | None = None) -> None:
    """Why this effect and not another."""
    chosen = step.chosen.candidate
    page.heading(f"Why {_title(step, function)} and not another", detail=True)
    page.paragraph((EFFECTS[chosen.effect].__doc__ or "").strip().splitlines()[0])
    sizes = [math.sqrt(r.score) for r in step.ranking]
    why = f"It reduces the residual from {_times(math.sqrt(without.score))} to {_times(sizes[0])} times the noise"
    if len(step.ranking) > 1:
        least = min(range(1, len(sizes)), key=lambda k: sizes[k])
        why += f"; {step.ranking[least].candidate.effect}, the next, leaves {_times(sizes[least])}"
        if sizes[least] < sizes[0]:
            why += ", but " + (
                "with values that are unusual for real tables" if not step.ranking[least].usual else "not beyond chance"
            )
    page.paragraph(f"{why}. {SIZE}")
    widest = max(math.sqrt(without.score), *sizes)
    rows: list[list[str | Bar]] = [["without", *_sizes(without, widest, "", "")]]
    for r, size in zip(step.ranking, sizes, strict=True):
        remark = "added" if r is step.chosen else "fits worse" if size > sizes[0] else "fits as well"
        if r.candidate.effect in step.alternatives:
            remark = "not distinguished"
        remark += "" if r.usual else ", unusual values"
        rows.append([r.candidate.effect, *_sizes(r.result, widest, remark, r.candidate.place)])
    page.table(("effect", "both, × noise", "verdict", "place", "estimation", "validation"), rows, best=1, start=0)
    if chosen.effect == "unlisted":
        page.paragraph(
            f"No listed effect explains the residual. It acts at {chosen.place} "
            f"and depends on {', '.join(chosen.depends_on)}."
        )
        page.chart(charts_fit.unlisted_chart(step.chosen.result.fit, function.form if function else None))
        if function:
            page.paragraph(sentence(function_line(function)))


def _sizes(fit: ScoredFit, widest: float, remark: str, place: str) -> list[str | Bar]:
    size = math.sqrt(fit.score)
    both = [_times(math.sqrt(cost)) for cost in (fit.estimation_cost, fit.validation_cost)]
    return [Bar(size / widest, _times(size)), remark, place, *both]


def _times(size: float) -> str:
    """A multiple of the noise with three digits.

    >>> _times(29.98), _times(0.6902), _times(1234.5)
    ('30.0', '0.690', '1234')
    """
    return f"{size:#.3g}" if size < 100.0 else f"{size:.0f}"


def model_sections(
    page: Page, result: LoopClosure, learn: Sequence[Record], hold: Sequence[Record], test: Sequence[Record] = ()
) -> None:
    """Measured against simulated, errors, why each effect was added."""
    tables = result.baseline.table, result.final.table
    bands = histories_section(page, learn, hold, tables, result.model, test=test)
    units = {"velocity": "m/s", "acceleration": "m/s²"}
    noise = f" Sensor noise alone: {' and '.join(f'{result.noise[c]:.2g} {units[c]}' for c in result.noise)}."
    errors_section(page, dict(zip(MODELS, (result.baseline, result.final), strict=True)), bands, MODELS, noise)
    slow_changes_section(page, tables, [*learn, *hold, *test])
    for step, without in zip(result.search.steps, result.search.models, strict=False):
        step_section(page, step, without, result.function)
    depends = [d for s in result.search.steps for d in s.chosen.candidate.depends_on]
    page.subheading("The residual against what the effect depends on")
    mass = result.model.moved_mass(result.final.table)
    for record in longest(hold)[:1]:
        runs = charts_fit.free_runs(record, *tables, result.model)
        for chart in charts_fit.residual_charts(record, runs, depends, mass, result.model):
            page.chart(chart)
