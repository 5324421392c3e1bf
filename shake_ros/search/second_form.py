"""A closed form for how a function without a name changes with a second quantity.

    separable   f(s) (1 + c⁺ max(τ, 0) + c⁻ max(−τ, 0))
    sum         f(s) + c⁺ max(τ, 0) + c⁻ max(−τ, 0)

with f the closed form of the function in the middle of the range of the second quantity, τ = ±1 at its ends. Each is
fitted to the changes on their nodes, weighted by their standard errors; both have two numbers: the nearer one is told.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

TEXTS = {
    "separable": "f(s) (1 + c⁺ max(τ, 0) + c⁻ max(−τ, 0))",
    "sum": "f(s) + c⁺ max(τ, 0) + c⁻ max(−τ, 0)",
}
UNITS = {"position": "m", "velocity": "m/s", "valve_opening": "-", "load_pressure": "Pa", "time": "s"}
LEAST_DEVIATION = 0.02  # of the changes' rms: no node is known better for the choice of a form


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
