"""Results as the content of report.json: those of `close_loop` and `identify`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import zip_longest
from typing import Any

from shake_ros.control.trials import TrackingBenefit
from shake_ros.explain.account import Account
from shake_ros.explain.diagnosis import Diagnosis
from shake_ros.explain.latent_force import LatentForce
from shake_ros.explain.prediction import HORIZONS, RATES, Innovations
from shake_ros.failures import Failures
from shake_ros.fit.axis_model import forecast_errors, slow_changes
from shake_ros.fit.nuisances.prepared import Prepared
from shake_ros.fit.records import Record
from shake_ros.fit.uncertainty import Estimate
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.repair.close_loop import LoopClosure
from shake_ros.result_folder import as_json
from shake_ros.search.closed_form import ChangeForm, FunctionForm, LearntChange, LearntFunction
from shake_ros.search.decision import ForwardStep, Refit
from shake_ros.search.declared_fit import FittedModel
from shake_ros.search.verdict import EffectVerdict

CLOSE_LOOP_SCHEMA = "shake_ros.close_loop/1"
IDENTIFY_SCHEMA = "shake_ros.identify/1"


def parameters_json(parameters: Sequence[Estimate]) -> dict[str, Any]:
    """`{name: {value, std_error, unit}}`."""
    return {p.name: {"value": p.value, "std_error": p.std_error, "unit": p.unit} for p in parameters}


def form_errors_json(parameters: Sequence[Estimate]) -> dict[str, float]:
    """What the forms assumed near rest may shift each parameter by, in its unit."""
    return {p.name: p.form_error for p in parameters}


def model_json(model: FittedModel) -> dict[str, Any]:
    """Parameters and errors of one model."""
    return {
        "parameters": parameters_json(model.parameters),
        "error": errors_json(model),
    }


def errors_json(model: FittedModel) -> dict[str, Any]:
    """Errors of the free runs of estimation, validation and test data."""
    return {"learn": model.estimation, "hold": model.validation, "test": model.test}


def unknown_json(identified: Sequence[Estimate], data: Prepared) -> dict[str, Any]:
    """What recordings determine of a table without a data sheet, and what was removed from them."""
    offsets = {
        n.recording: {
            "null_shift": n.null_shift,
            "acceleration_bias": n.acceleration_bias,
            "acceleration_drift": n.drift,
            "command_spikes": n.glitches,
        }
        for n in data.nuisances
    }
    return {
        "identified": parameters_json(identified),
        "command_full_scale": data.full_scale,
        "command_ahead": data.ahead,
        "accelerometer_delay": data.delay,
        "accelerometer_cutoff": data.cutoff,
        "nuisances": offsets,
    }


def axis_json(table: TableParameters, records: Sequence[Record]) -> dict[str, Any]:
    """Nuisance parameters of each recording of a force-driven axis, and position errors without them [m]."""
    changes = {
        c.recording: {"level": c.level, "offset": c.offset, "drift": c.drift} for c in slow_changes(table, records)
    }
    return {"slow_changes": changes, "forecast_error": forecast_errors(table, records)}


def accounts_json(parts: Sequence[Account]) -> list[dict[str, Any]]:
    """Shares of each residual's mean square by what predicts them; null where a means was not at hand."""
    return [
        {
            "recording": p.name,
            "held_out": p.held_out,
            "channel": p.channel,
            "noise": p.noise,
            "over_noise": p.ratio,
            "least_over_noise": p.least_ratio,
            "sensor_noise": p.noise_share,
            "coherent": p.coherent,
            "filtered": p.filtered,
            "repeated": p.repeated,
            "different": p.different,
            "unknown": p.unknown,
            "white": p.shape and p.shape.white,
            "white_p": p.shape and p.shape.auto_p,
            "independent": p.shape and p.shape.independent,
            "independent_p": p.shape and p.shape.cross_p,
        }
        for p in parts
    ]


def innovations_json(found: Innovations | None) -> dict[str, Any] | None:
    """Errors of prediction over the sensor noise by rate of drawing [1/s] and by horizon [s]; null without any.

    A run that a rate of drawing makes unstable has null in its place.
    """
    if found is None:
        return None

    return {
        "rates": list(RATES),
        "over_noise": as_json(found.errors),
        "by_noise_alone": as_json(found.by_noise),
        "relative_cost": as_json(found.relative),
        "best_rate": found.best,
        "drawing_helps": found.helps,
        "horizons": list(HORIZONS),
        "over_noise_ahead": as_json(found.horizons),
        "text": found.text,
    }


def diagnosis_json(diagnosis: Diagnosis) -> dict[str, Any]:
    """Residual tests, correlation of the estimates (null at bounds), combinations left open, the recording to make."""
    known = diagnosis.identifiability
    return {
        "residuals": accounts_json(diagnosis.accounts),
        "innovations": innovations_json(diagnosis.innovations),
        "correlation": {"names": list(known.names), "matrix": as_json(known.correlation)},
        "not_identified": [{"weights": c.weights, "deviation": c.deviation} for c in known.left_open],
        "relative_deviation": dict(zip(known.names, known.deviations.tolist(), strict=True)),
        "helpful_recordings": [
            {"name": b.candidate.name, "relative_deviation": dict(zip(known.names, b.deviations.tolist(), strict=True))}
            for b in diagnosis.benefits
        ],
        "dwells": diagnosis.dwells,
        "text": "; ".join(text for text in (diagnosis.backlash, known.text, diagnosis.advice) if text),
    }


def failures_json(failures: Failures) -> list[dict[str, Any]]:
    """The steps that failed, each with its error and where that came from."""
    return [{"step": f.step, "error": f.cause, "trace": list(f.trace)} for f in failures]


def _refit_json(refit: Refit) -> dict[str, Any]:
    return {
        "effect": refit.candidate.effect,
        "learn_cost": refit.result.estimation_cost,
        "hold_cost": refit.result.validation_cost,
        "screened_gain": refit.predicted_gain,
    }


def _verdict_json(verdict: EffectVerdict) -> dict[str, Any]:
    return {
        "state": verdict.state,
        "reason": verdict.reason,
        "odds": verdict.odds,
        "worth": verdict.worth,
        "at_bound": list(verdict.bounds),
    }


def _candidate_json(verdict: EffectVerdict) -> dict[str, Any]:
    named = {"effect": verdict.effect, "place": verdict.place, "alternatives": list(verdict.alternatives)}
    return named | _verdict_json(verdict)


def function_json(function: LearntFunction) -> dict[str, Any]:
    return {
        "quantity": function.quantity,
        "place": function.place,
        "unit": function.unit,
        "at": function.at.tolist(),
        "values": function.values.tolist(),
        "std_errors": as_json(function.deviations),
        "closed_form": _form_json(function.form),
        "second": _change_json(function.second) if function.second else None,
    }


def _change_json(change: LearntChange) -> dict[str, Any]:
    return {
        "quantity": change.quantity,
        "unit": change.unit,
        "low": change.low,
        "high": change.high,
        "at": change.at.tolist(),
        "above": change.above.tolist(),
        "below": change.below.tolist(),
        "above_std_errors": as_json(change.above_deviations),
        "below_std_errors": as_json(change.below_deviations),
        "closed_form": _form_json(change.form),
    }


def _form_json(form: FunctionForm | ChangeForm) -> dict[str, Any]:
    return {
        "name": form.name,
        "text": form.text,
        "parameters": dict(form.parameters),
        "misfit": form.misfit,
        "held_out_error_over_free": form.cost,
    }


def _force_json(force: LatentForce) -> dict[str, Any]:
    kinds = force.kinds
    return {
        "held_out": force.held_out,
        "zero": kinds.zero,
        "rms": force.rms,
        "peak": force.peak,
        "unit": force.unit,
        "share_of_inertia": force.of_inertia,
        "kinds": list(kinds.kinds),
        "depends_on": kinds.depends_on,
        "line_frequency": kinds.line if "line" in kinds.kinds else None,
        "bandwidth": force.bandwidth,
        "explains": force.explains,
        "outside_band": kinds.outside,
        "residual_over_noise": {"without": force.left[0], "with": force.left[1]},
        "text": kinds.text,
    }


def chosen_because(step: ForwardStep) -> str:
    """Why an effect was added and not the next one."""
    best, second = step.chosen, step.ranking[1] if len(step.ranking) > 1 else None
    least = best.result.validation_cost
    next_least = second.result.validation_cost if second else least
    why = f"lowest error on the validation data: weighted mean square {least:.3g}"
    if second and not second.usual and next_least < least:
        why = f"as good as {second.candidate.effect}, whose value is unusual for real tables: {least:.3g} against "
        why += f"{next_least:.3g} on the validation data"
    elif second:
        why += f", next {second.candidate.effect} with {next_least:.3g}"
    return why


@dataclass(frozen=True)
class FoundEffect:
    """An effect that the declared model was missing."""

    # name, place: of the effect
    name: str
    place: str
    parameters: tuple[Estimate, ...]  # its own, with standard errors
    evidence: str  # why this one
    alternatives: tuple[str, ...]  # effects that these recordings cannot distinguish from it
    # step, model: that added it, and the model from there on
    step: ForwardStep
    model: FittedModel
    verdict: EffectVerdict | None  # in the final model; None where there is none

    @property
    def state(self) -> str:
        """Its verdict in a word; empty where there is none."""
        return self.verdict.state if self.verdict else ""

    @property
    def worth(self) -> float:
        """Error of the final model without it, over that with it [-]."""
        return self.verdict.worth if self.verdict else math.nan


def found_effect(step: ForwardStep, model: FittedModel, verdict: EffectVerdict | None = None) -> FoundEffect:
    """What a step of the search added."""
    effect = step.chosen.candidate
    own = {f.name for f in effect.free}
    parameters = tuple(p for p in model.parameters if p.name in own)
    others = tuple(verdict.alternatives if verdict else step.alternatives)
    return FoundEffect(effect.effect, effect.place, parameters, chosen_because(step), others, step, model, verdict)


def found_effects(result: LoopClosure) -> list[FoundEffect]:
    """What was missing, in the order in which it was found."""
    steps = zip_longest(result.search.steps, result.models, result.verdicts)
    return [found_effect(*step) for step in steps]


def _step_json(effect: FoundEffect) -> dict[str, Any]:
    return {
        "effect": effect.name,
        "alternatives": list(effect.alternatives),
        **(_verdict_json(effect.verdict) if effect.verdict else {}),
        "place": effect.place,
        "depends_on": list(effect.step.chosen.candidate.depends_on),
        "parameters": parameters_json(effect.parameters),
        "evidence": {"why": effect.evidence, "ranking": [_refit_json(r) for r in effect.step.ranking]},
        "error": errors_json(effect.model),
    }


def close_loop_json(
    result: LoopClosure, learn: Sequence[str], hold: Sequence[str], model: str, test: Sequence[str] = ()
) -> dict[str, Any]:
    """Content of report.json as spec'd for other programs (schema shake_ros.close_loop/1).

    learn, hold, test : names of estimation, validation and test data. model : its kind.
    """
    rest = result.remaining
    place, depends_on, text = rest.place, rest.depends_on, rest.text
    for step in result.search.steps:
        if step.chosen.candidate.effect == "unlisted":
            place, depends_on = step.chosen.candidate.place, step.chosen.candidate.depends_on
            text = f"an unlisted effect acts at {place} and depends on {', '.join(depends_on)}; with it, {text}"
    return {
        "schema": CLOSE_LOOP_SCHEMA,
        "model": model,
        "recordings": {"learn": list(learn), "hold": list(hold), "test": list(test)},
        "noise": result.noise,
        "baseline": model_json(result.baseline),
        "steps": [_step_json(effect) for effect in found_effects(result)],
        "final": model_json(result.final),
        "remaining": {
            "above_noise": rest.above_noise,
            "place": place,
            "depends_on": list(depends_on),
            "text": text,
            "candidates": [_candidate_json(c) for c in result.candidates],
            "validation_with_candidates": result.with_candidates,
            "latent_force": {force.recording: _force_json(force) for force in result.forces},
            "process_noise": math.sqrt(result.unpredictable) if result.unpredictable > 1.0 else None,
        },
        "function": function_json(result.function) if result.function else None,
        "ended_early": result.search.stopped,
        "form_errors": form_errors_json(result.final.parameters),
    }


def tracking_json(benefit: TrackingBenefit) -> dict[str, Any]:
    """`tracking.json`: errors and ringing of each run, null where it was lost; the margins of tuned gains."""
    margins = {} if benefit.margins is None else {"margins": asdict(benefit.margins)}
    stability = {"ringing": benefit.ringing, "warnings": benefit.warnings()}
    return {"reference": benefit.reference, **benefit.errors(), **stability, **margins}
