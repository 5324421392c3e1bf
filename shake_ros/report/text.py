"""Results as lines for a terminal; numbers and units as a person reads them: MPa, mm, kN."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from shake_ros.explain.latent_force import LatentForce
from shake_ros.fit.axis_model import forecast_errors, position_errors, slow_changes
from shake_ros.fit.nuisances.prepared import Prepared
from shake_ros.fit.records import Record
from shake_ros.fit.uncertainty import Estimate
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.repair.close_loop import LoopClosure
from shake_ros.report.result_table import ResultTable, percent
from shake_ros.search.closed_form import LearntChange, LearntFunction
from shake_ros.search.declared_fit import FittedModel
from shake_ros.search.verdict import EffectVerdict

UNITS: Mapping[str, tuple[float, str]] = {  # SI unit → factor and unit to read
    "Pa": (1e-6, "MPa"),
    "1/Pa": (1e6, "1/MPa"),
    "m": (1e3, "mm"),
    "m/s": (1e3, "mm/s"),
    "s": (1e3, "ms"),
    "m^2": (1e4, "cm²"),
    "m^3": (1e6, "cm³"),
    "N/m": (1e-3, "kN/m"),
    "m^3/(s*Pa)": (6e10, "L/(min·MPa)"),
    "m^3/(s*sqrt(Pa))": (6e7, "L/(min·√MPa)"),
    "Pa*s/m^3": (1e-6 / 6e4, "MPa·min/L"),
    "-": (1.0, ""),
}
CHANNELS = ("velocity", "acceleration", "load_pressure")
ROLES = ("estimation", "validation", "test")
KNOWN = 1.0  # relative standard error from which on a parameter is not known


def unit_of(unit: str) -> tuple[float, str]:
    """Factor and unit to read an SI unit in.

    >>> unit_of("Pa"), unit_of("N*s/m")
    ((1e-06, 'MPa'), (1.0, 'N·s/m'))
    """
    factor, text = UNITS.get(unit, (1.0, unit))
    return factor, text.replace("*", "·").replace("^2", "²").replace("^3", "³")


def rounded(value: float, error: float | None = None) -> str:
    """A number with the digits that it deserves: two of its error's, else four of its own.

    >>> rounded(0.0204132, 0.00031), rounded(123456.7), rounded(-3e-9), rounded(float("nan"))
    ('0.02041', '123500', '−3·10⁻⁹', '–')
    """
    if not math.isfinite(value):
        return "–"
    digits = 4
    if error and value:
        digits = min(max(math.floor(math.log10(abs(value))) - math.floor(math.log10(error)) + 2, 1), 6)
    shown = float(f"{value:.{digits - 1}e}")
    size = math.floor(math.log10(abs(shown))) if shown else 0
    if -4 <= size <= 6:
        text = f"{shown:.{min(max(digits - 1 - size, 0), 9)}f}"
        text = text if error or "." not in text else text.rstrip("0").rstrip(".")
    else:
        power = str(size).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
        text = f"{shown / 10.0**size:.{digits - 1}f}".rstrip("0").rstrip(".") + f"·10{power}"
    return text.replace("-", "−")


def interval_text(value: float, half: float, unit: str) -> str:
    """A number and its interval in the unit to read it in.

    Parameters
    ----------
    value, half : number and half of the interval [unit]. unit : SI.

    >>> interval_text(0.0204132, 0.00031, "m")
    '20.41 (20.10 … 20.72) mm'
    """
    factor, text = unit_of(unit)
    shown, low, high = (rounded(factor * v, factor * half or None) for v in (value, value - half, value + half))
    return f"{shown} ({low} … {high}) {text}".rstrip()


def resting_text(p: Estimate, low: float, high: float) -> str:
    """The bound on which a value rests, and which of the two it is; a fit ends a rounding error off.

    >>> resting_text(Estimate("x", 2e-18, None, "-"), 0.0, 5.0)
    '0,\\nat its lower bound'
    """
    side, bound = ("lower", low) if p.value - low < high - p.value else ("upper", high)
    return f"{estimate_text(replace(p, value=bound))},\nat its {side} bound"


def estimate_text(p: Estimate) -> str:
    """Value and standard deviation (noise and the forms assumed near rest) without the unit.

    >>> estimate_text(Estimate("x", 9.1e8, 2e6, "Pa")), estimate_text(Estimate("x", 0.059, 2.6e2, "-"))
    ('910.0 ± 2.0', 'not known (0.059)')
    """
    factor, _ = unit_of(p.unit)
    value = factor * p.value
    if p.deviation is None:
        return rounded(value)
    error = factor * p.deviation
    if error > KNOWN * abs(value):
        return f"not known ({rounded(value)})"
    if error == 0.0:
        return rounded(value)
    spread = float(f"{error:.1e}")
    places = max(1 - math.floor(math.log10(spread)), 0)
    text = f"{spread:.{places}f}" if places < 10 else rounded(error)
    return f"{rounded(value, error)} ± {text}"


def sentence(text: str) -> str:
    """A phrase with a capital letter and a full stop."""
    return f"{text[0].upper()}{text[1:]}."


def parameter_table(parameters: Sequence[Estimate]) -> ResultTable:
    """Fitted parameters; a standard error is None where the value rests on a bound."""
    return ResultTable(
        ("parameter", "value", "std. error", "form error", "unit"),
        [(p.name, p.value, p.std_error, p.form_error, p.unit) for p in parameters],
        {"std. error": lambda error: "at bound" if error is None else f"{error:.2g}", "form error": "{:.1g}".format},
    )


def error_table(models: Mapping[str, FittedModel]) -> ResultTable:
    """Relative errors of free runs by recording, a column for each channel and model."""
    sets = [(role, [getattr(m, role) for m in models.values()]) for role in ROLES]
    known = {c for _, of in sets for errors in of for error in errors.values() for c in error} or {"velocity"}
    channels = [c for c in CHANNELS if c in known | {"acceleration"}]
    rows = [
        (name, role, *(errors[name].get(channel) for channel in channels for errors in of))
        for role, of in sets
        for name in of[0]
    ]
    columns = [f"{channel.replace('_', ' ')} {title}".strip() for channel in channels for title in models]
    return ResultTable(("recording", "data", *columns), rows, dict.fromkeys(columns, percent))


def nuisance_table(data: Prepared) -> ResultTable:
    """Offsets that were removed from each recording; empty for a declared table."""
    return ResultTable(
        ("recording", "null shift [-]", "acceleration bias [m/s^2]"),
        [(n.recording, n.null_shift, n.acceleration_bias) for n in data.nuisances],
    )


def slow_change_table(tables: Sequence[TableParameters], records: Sequence[Record]) -> ResultTable:
    """Nuisance parameters of each recording of a force-driven axis under the last table, and its position errors.

    The position errors are of the free run under every table, and from the force alone under the last one.
    """
    errors = [position_errors(table, records) for table in tables]
    alone, changes, rows = forecast_errors(tables[-1], records), slow_changes(tables[-1], records), []
    for name, error in alone.items():
        position = " → ".join(f"{1e3 * e[name]:.3f}" for e in errors), 1e3 * error
        found = [c for c in changes if c.recording == name]
        nuisances = [(c.level, c.offset, c.drift) for c in found] if found else [(None, None, None)]
        rows += [(name, *values, *position) for values in nuisances]
    heads = ("recording", "level of friction [-]", "offset [N]", "drift [N/s]", "position error [mm]")
    return ResultTable((*heads, "from its force alone [mm]"), rows)


def function_line(function: LearntFunction) -> str:
    """The function of an unlisted effect as a closed form."""
    form, second = function.form, function.second
    of = f"{function.quantity} and {second.quantity}" if second else function.quantity
    where = f", where {second.quantity} is {0.5 * (second.low + second.high):.4g} {second.unit}" if second else ""
    line = (
        f"function of {of.replace('_', ' ')} [{function.unit}], closed form{where.replace('_', ' ')}: "
        f"{form.name}, {form.text} with {_numbers(form.parameters)}; it differs from the estimated function by "
        f"{percent(form.misfit)}, and leaves {form.cost:.2f} times its validation error"
    )
    return f"{line}; {change_text(second)}" if second else line


def change_text(change: LearntChange) -> str:
    """How a function changes with its second quantity, as a closed form."""
    form, quantity = change.form, change.quantity.replace("_", " ")
    return (
        f"with {quantity} it changes as {form.name}, {form.text} with {_numbers(form.parameters)}, τ from −1 at "
        f"{change.low:.4g} {change.unit} to 1 at {change.high:.4g} {change.unit}; this differs from the estimated "
        f"change by {percent(form.misfit)}, and both forms leave {form.cost:.2f} times the validation error"
    )


def _numbers(parameters: Mapping[str, float]) -> str:
    return ", ".join(f"{name} = {value:.4g}" for name, value in parameters.items())


def largest_force(forces: Sequence[LatentForce]) -> LatentForce:
    """The largest force outside its band in validation data, in any recording where there are none."""
    held_out = [force for force in forces if force.held_out] or list(forces)
    return max(held_out, key=lambda force: (not force.kinds.zero, force.rms))


def force_table(forces: Sequence[LatentForce]) -> ResultTable:
    """The force that a model lacks in each recording: size, kind, and how far it explains the residual."""
    rows = [
        (
            force.recording,
            "validation" if force.held_out else "estimation",
            force.rms,
            force.peak,
            force.unit,
            force.of_inertia,
            force.kinds.text,
            force.left[0],
            *((None, None) if force.kinds.zero else (force.left[1], force.bandwidth)),
        )
        for force in forces
    ]
    heads = ("recording", "data", "rms", "peak", "unit", "of inertia", "the force", "run leaves, × noise", "with it")
    return ResultTable(
        (*heads, "up to [Hz]"), rows, {"rms": "{:.3g}".format, "peak": "{:.3g}".format, "of inertia": percent}
    )


def force_text(forces: Sequence[LatentForce]) -> str:
    """The force that a model lacks, as a phrase: how large it is and of what kind."""
    force = largest_force(forces)
    if force.kinds.zero:
        where = "of every validation recording" if any(f.held_out for f in forces) else "of every recording"
        return f"the force that the model lacks is zero within its {100.0 * force.band:.0f} % band {where}"
    share = f"{100.0 * force.of_inertia:.1f} % of the force of inertia"
    size = f"{force.rms:.3g} {force.unit} rms ({share}), at most {force.peak:.3g} {force.unit}, in {force.recording}"
    left = "" if force.explains else f", but a run under it still leaves {force.left[1]:.3g} times the noise"
    return f"the force that the model lacks: {size}; it {force.kinds.text}{left}"


def odds_text(odds: float) -> str:
    """Odds for a reader, such as "480 : 1"."""
    if odds < 1.0:
        return f"1 : {1.0 / odds:,.0f}".replace(",", " ") if odds > 1e-6 else "below 1 : 1 000 000"
    if odds >= 1e6:
        return "over 1 000 000 : 1"
    return f"{odds:.2g} : 1" if odds < 100.0 else f"{odds:,.0f} : 1".replace(",", " ")


def verdict_sentences(verdict: EffectVerdict) -> list[str]:
    """State of an effect with its odds, its worth and what rests on a bound."""
    worth = f"without it the error is {verdict.worth:.2f} times as large"
    found = f"{verdict.state}, odds {odds_text(verdict.odds)}: {verdict.reason}; {worth}"
    return [sentence(found), *(f"{name} rests on a bound: something else is missing." for name in verdict.bounds)]


def why_nothing(result: LoopClosure) -> str:
    """Why no effect was added."""
    if result.candidates:
        return "effects that lower the error are not established on the validation data"
    if result.search.stopped and result.remaining.above_noise:
        return "the search was ended before it had tried all effects"
    return "no effect lowers the error on the validation data"
