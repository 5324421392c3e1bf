"""A closed form for a function that was estimated on nodes: which known law of this field does it look like?

Each form of a small library is fitted to the nodes, weighted by their standard errors; the best by Schwarz's criterion
comes first. What a form costs in the free run is told beside the free function, by the residual of the validation data.

How such a function changes with a second quantity has closed forms as well:

    separable   f(s) (1 + c⁺ max(τ, 0) + c⁻ max(−τ, 0))
    sum         f(s) + c⁺ max(τ, 0) + c⁻ max(−τ, 0)

with f the closed form of the function in the middle of the range of the second quantity, τ = ±1 at its ends. Each is
fitted to the changes on their nodes, weighted by their standard errors; both have two numbers: the nearer one is told.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from shake_ros.fit.least_squares import LOST
from shake_ros.fit.uncertainty import covariance
from shake_ros.physics.effects.unlisted import CHANGES, FRICTION_OF_POSITION, NODES, SECONDS
from shake_ros.search.problem import ScoredFit, SearchProblem, mean_square
from shake_ros.search.unlisted_functions import ABOVE_NAMES, BELOW_NAMES, KINDS, NODE_NAMES, PREFIX

TEXTS = {
    "separable": "f(s) (1 + c⁺ max(τ, 0) + c⁻ max(−τ, 0))",
    "sum": "f(s) + c⁺ max(τ, 0) + c⁻ max(−τ, 0)",
}
UNITS = {"position": "m", "velocity": "m/s", "valve_opening": "-", "load_pressure": "Pa", "time": "s"}
LEAST_DEVIATION = 0.02  # of the rms of a function or its changes: no node is known better for the choice of a form


@dataclass(frozen=True)
class ChangeForm:
    """A form fitted to the changes. misfit : weighted rms of its difference from them, of their weighted rms [-].

    above, below : the changes that it gives at the upper and the lower end, each (n,). cost : held-out residual of the
    whole closed form, over that of the free function [-]; NaN where not simulated.
    """

    name: str
    text: str
    parameters: Mapping[str, float]
    above: np.ndarray
    below: np.ndarray
    misfit: float
    cost: float = math.nan


@dataclass(frozen=True)
class LearntChange:
    """How a learnt function changes with a second quantity from `low` to `high`: nodes, each (n,), and a closed form.

    at : arguments of the function, (n,). above, below : changes at the upper and the lower end, in the function's unit,
    with standard errors (NaN at a bound).
    """

    quantity: str
    low: float
    high: float
    at: np.ndarray
    above: np.ndarray
    below: np.ndarray
    above_deviations: np.ndarray
    below_deviations: np.ndarray
    form: ChangeForm

    @property
    def unit(self) -> str:
        """Of the second quantity."""
        return UNITS[self.quantity]


def fitted_changes(function: np.ndarray, changes: np.ndarray, deviations: np.ndarray) -> list[ChangeForm]:
    """Both forms fitted to changes, the nearer first.

    Parameters
    ----------
    function : f at the nodes of the changes, shape (n,). changes, deviations : at the upper and the lower end, (2, n).

    Examples
    --------
    >>> f = np.array([0.0, 1.0, 3.0, 1.0])
    >>> best = fitted_changes(f, np.array([0.5 * f, -0.2 * f]), np.full((2, 4), 0.01))[0]
    >>> best.name, round(best.parameters["c⁺"], 6), round(best.parameters["c⁻"], 6)
    ('separable', 0.5, -0.2)
    """
    size = float(np.sqrt(np.mean(changes**2))) or 1.0
    known = np.where(np.isfinite(deviations), deviations, size)
    weight = 1.0 / np.hypot(known, LEAST_DEVIATION * size) ** 2
    found = []
    for name, shape in (("separable", function), ("sum", np.ones_like(function))):
        parts = np.sum(weight * changes * shape, axis=1) / np.maximum(np.sum(weight * shape**2, axis=1), 1e-300)
        fitted = parts[:, None] * shape
        misfit = math.sqrt(float(np.sum(weight * (changes - fitted) ** 2) / np.sum(weight * changes**2 + 1e-300)))
        own = {"c⁺": float(parts[0]), "c⁻": float(parts[1])}
        found.append(ChangeForm(name, TEXTS[name], own, fitted[0], fitted[1], misfit))
    return sorted(found, key=lambda form: form.misfit)


Curve = Callable[..., np.ndarray]


@dataclass(frozen=True)
class Form:
    """One law of the library. y : of the argument divided by its largest value, and parameters of its own.

    parameters : names; a name with `@` is in the argument's unit, the first one in that of the function.
    """

    text: str
    parameters: tuple[str, ...]
    y: Curve
    starts: tuple[tuple[float, ...], ...]


def gap(s: np.ndarray, width: float) -> np.ndarray:
    """Argument beyond a dead band of half-width `width`."""
    return np.sign(s) * np.maximum(np.abs(s) - abs(width), 0.0)


PLACES = (-0.7, -0.35, 0.0, 0.35, 0.7)
FORMS: Mapping[str, Form] = {
    "constant": Form("a", ("a",), lambda s, a: a + 0.0 * s, ((0.5,),)),
    "line": Form("a + b s", ("a", "b"), lambda s, a, b: a + b * s, ((0.0, 1.0),)),
    "quadratic": Form("a + b s + c s²", ("a", "b", "c"), lambda s, a, b, c: a + b * s + c * s**2, ((0.0, 0.0, 1.0),)),
    "hardening spring": Form(
        "a + b s + c s³", ("a", "b", "c"), lambda s, a, b, c: a + b * s + c * s**3, ((0.0, 1.0, 1.0),)
    ),
    "stops": Form(
        "a sign(s) max(|s| − g, 0)", ("a", "g@"), lambda s, a, g: a * gap(s, g), ((2.0, 0.3), (5.0, 0.6), (-2.0, 0.3))
    ),
    "one stop": Form(
        "a max(s − g, 0)",
        ("a", "g@"),
        lambda s, a, g: a * np.maximum(s - g, 0.0),
        tuple((a, g) for a in (2.0, -2.0) for g in PLACES),
    ),
    "bump": Form(
        "b + a exp(−(s − m)²/(2 w²))",
        ("a", "m@", "w@", "b"),
        lambda s, a, m, w, b: b + a * np.exp(-0.5 * ((s - m) / max(abs(w), 1e-3)) ** 2),
        tuple((a, m, w, 0.0) for a in (1.0, -1.0) for m in PLACES for w in (0.1, 0.3)),
    ),
    "wave": Form(
        "a sin(2π s/l + p)",
        ("a", "l@", "p"),
        lambda s, a, length, p: a * np.sin(2.0 * math.pi * s / max(abs(length), 0.05) + p),
        tuple((1.0, length, p) for length in (0.4, 0.7, 1.0, 1.5, 2.0) for p in (0.0, 1.6)),
    ),
    "saturation": Form(
        "a tanh(s/w)", ("a", "w@"), lambda s, a, w: a * np.tanh(s / max(abs(w), 1e-3)), ((1.0, 0.1), (1.0, 0.5))
    ),
    "Stribeck": Form(
        "sign(s) (a + b exp(−|s|/w))",
        ("a", "b", "w@"),
        lambda s, a, b, w: np.sign(s) * (a + b * np.exp(-np.abs(s) / max(abs(w), 1e-3))),
        ((1.0, 1.0, 0.1), (1.0, -0.5, 0.3)),
    ),
    "drag": Form("a s |s|", ("a",), lambda s, a: a * s * np.abs(s), ((1.0,),)),
    "warming": Form(
        "a (1 − exp(−s/w))",
        ("a", "w@"),
        lambda s, a, w: a * (1.0 - np.exp(-s / max(abs(w), 1e-3))),
        ((1.0, 0.2), (-1.0, 0.2), (1.0, 1.0)),
    ),
}


LENGTHS = ("w@", "l@")  # whose sign no form depends on


@dataclass(frozen=True)
class FunctionForm:
    """A form fitted to nodes. misfit : weighted rms of its difference from them, of their weighted rms [-].

    cost : held-out residual with it, over that with the free function [-]; NaN where not simulated.
    """

    name: str
    text: str
    parameters: Mapping[str, float]
    values: np.ndarray
    misfit: float
    criterion: float
    cost: float = math.nan


@dataclass(frozen=True)
class LearntFunction:
    """A function without a name: nodes with standard errors (NaN at a bound) and its closed form.

    at : arguments, shape (n,). unit : of the values. second : how it changes with a second quantity, from whose middle
    on the nodes are; None where it is a function of one.
    """

    quantity: str
    place: str
    unit: str
    at: np.ndarray
    values: np.ndarray
    deviations: np.ndarray
    form: FunctionForm
    second: LearntChange | None = None


def fitted_forms(at: np.ndarray, values: np.ndarray, deviations: np.ndarray) -> list[FunctionForm]:
    """Every form fitted to nodes, the best first.

    >>> s = np.linspace(-2.0, 2.0, 16)
    >>> best = fitted_forms(s, 3.0 * s - 0.5 * s**3, np.full(16, 0.01))[0]
    >>> best.name, round(best.parameters["c"], 3)
    ('hardening spring', -0.5)
    """
    size, reach = float(np.sqrt(np.mean(values**2))) or 1.0, float(np.max(np.abs(at))) or 1.0
    known = np.where(np.isfinite(deviations), deviations, size)
    weight = size / np.hypot(known, LEAST_DEVIATION * size)
    s, y = at / reach, values / size
    found = []
    for name, form in FORMS.items():
        tried = [
            least_squares(lambda p, form=form: weight * (form.y(s, *p) - y), start, max_nfev=200)
            for start in form.starts
        ]
        best = min(tried, key=lambda t: t.cost)
        criterion = 2.0 * float(best.cost) + len(best.x) * math.log(len(at))
        misfit = math.sqrt(2.0 * float(best.cost) / float(np.sum((weight * y) ** 2)))
        own = dict(_in_units(form, best.x, size, reach))
        found.append(FunctionForm(name, form.text, own, size * form.y(s, *best.x), misfit, criterion))
    return sorted(found, key=lambda f: f.criterion)


def _in_units(form: Form, x: np.ndarray, size: float, reach: float) -> Iterator[tuple[str, float]]:
    powers = {"line": (0, 1), "quadratic": (0, 1, 2), "hardening spring": (0, 1, 3), "drag": (2,)}
    powers |= {"stops": (1,), "one stop": (1,)}
    name = next(n for n, f in FORMS.items() if f is form)
    for i, (parameter, value) in enumerate(zip(form.parameters, x.tolist(), strict=True)):
        if parameter.endswith("@"):
            yield parameter[:-1], reach * (abs(value) if parameter in LENGTHS else value)
        elif name == "wave" and parameter == "p":
            yield parameter, value
        else:
            power = powers.get(name, ())
            yield parameter, value * size / reach ** (power[i] if i < len(power) else 0)


def learnt_function(problem: SearchProblem, final: ScoredFit) -> LearntFunction | None:
    """The function without a name in a fit with its best closed form; None where the fit has none."""
    result = final.fit
    if NODE_NAMES[0] not in result.free.names:
        return None
    table = result.table
    kind = KINDS[int(table.value(PREFIX + "kind"))]
    found = covariance(result, problem.estimation.blocks(len(result.x))) * np.outer(
        result.free.scale, result.free.scale
    )
    at = np.linspace(table.value(PREFIX + "low"), table.value(PREFIX + "high"), NODES)
    columns = [result.free.names.index(name) for name in NODE_NAMES]
    values = (result.x * result.free.scale)[columns]
    of_nodes = found[np.ix_(columns, columns)]
    if kind.unit == "-":
        of_nodes = of_shape(of_nodes, values)
    elif kind.code == FRICTION_OF_POSITION:  # its level is also that of the dry friction
        of_nodes = of_shape(of_nodes, np.zeros(NODES))
    spread = np.sqrt(np.diag(of_nodes))
    form = fitted_forms(at, values, spread)[0]
    as_form = dict(zip(NODE_NAMES, form.values, strict=True))
    form = replace(form, cost=held_out(problem, final, as_form))
    second = learnt_change(problem, final, np.diag(found), at, form)
    return LearntFunction(kind.quantity, kind.place, kind.unit, at, values, spread, form, second)


def held_out(problem: SearchProblem, final: ScoredFit, values: Mapping[str, float]) -> float:
    """Held-out residual with other values of some parameters, over that of the fit [-]."""
    free = final.fit.free
    row = free.vectors(final.fit.x)
    row[:, [list(free.base.fields).index(name) for name in values]] = list(values.values())
    cost = mean_square(np.nan_to_num(problem.validation.residuals(row)[0], nan=LOST))
    return math.sqrt(cost / final.validation_cost)


def learnt_change(
    problem: SearchProblem, final: ScoredFit, variances: np.ndarray, nodes: np.ndarray, form: FunctionForm
) -> LearntChange | None:
    """How the function of a fit changes with a second quantity; None where it is one of a single quantity.

    Parameters
    ----------
    variances : of all free parameters, (p,). nodes, form : arguments of the function's nodes and its closed form.
    """
    result = final.fit
    if ABOVE_NAMES[0] not in result.free.names:
        return None
    columns = [[result.free.names.index(name) for name in names] for names in (ABOVE_NAMES, BELOW_NAMES)]
    changes, deviations = (result.x * result.free.scale)[columns], np.sqrt(np.maximum(variances[columns], 0.0))
    at = np.linspace(nodes[0], nodes[-1], CHANGES)
    found = fitted_changes(np.interp(at, nodes, form.values), changes, deviations)[0]
    as_form = dict(zip(NODE_NAMES, form.values, strict=True)) | dict(zip(ABOVE_NAMES, found.above, strict=True))
    found = replace(found, cost=held_out(problem, final, as_form | dict(zip(BELOW_NAMES, found.below, strict=True))))
    table = result.table
    low, high = (table.value(f"{PREFIX}second_{end}") for end in ("low", "high"))
    quantity = SECONDS[int(table.value(PREFIX + "second"))]
    above, below = ((changes[i], deviations[i]) for i in range(2))
    return LearntChange(quantity, low, high, at, above[0], below[0], above[1], below[1], found)


def of_shape(covariance: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Covariance of a relative function 1 + f whose mean is known, shape (n, n); NaN at a bound stays.

    Its level is also that of the parameter which it multiplies, and no recording tells the one from the other: what is
    known is the shape.

    >>> level = np.array([1.0, 2.0, 3.0])  # 1 + f
    >>> bool(np.all(np.abs(of_shape(0.04 * np.outer(level, level), level - 1.0)) < 1e-12))
    True
    """
    inside = np.isfinite(np.diag(covariance))
    level = 1.0 + values[inside]
    kept = np.eye(len(level)) - np.outer(level, np.ones(len(level))) / np.sum(level)
    shape = np.full(covariance.shape, np.nan)
    shape[np.ix_(inside, inside)] = kept @ covariance[np.ix_(inside, inside)] @ kept.T
    return shape
