"""Several effects at once from a first guess: which of them a fit with all of them on holds on to.

A model that lacks two or three effects bends far away from the truth before any single one helps: where there is a dead
band, friction takes its place, and each effect is then tried on top of the wrong friction. So where the fit of the
declared model stays far above the noise, the effects that can begin from nothing are all freed together from the first
guess; those whose loss would cost the most (Wald's statistic on the linearised fit) stay, the others are dropped, and
the fit is repeated with what stays. Friction with a memory (before sliding, of a film) joins them only where that stays
far: it bends a fit that needs none of it. Whether each is needed is decided by the search, as for any other effect.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np

from shake_ros.fit.free_parameters import FreeParameter, FreeParameters
from shake_ros.fit.least_squares import Fit
from shake_ros.fit.recording_problem import RecordingProblem
from shake_ros.fit.start.narrow_valleys import approached
from shake_ros.physics.plant.parameters import TableParameters

EVALUATIONS, TOLERANCE = 12, 3e-3  # enough to tell what the fit wants
LEAST = 0.5  # relative rise of the cost without an effect from which it stays
MOST = 4  # effects that stay


class JoiningEffect(Protocol):
    """An effect as it may take part. together : values, by dotted name, from which it does; empty where it cannot.

    where_far : the same of one that takes part only where the fit with the others stays far.
    free : its parameters that a fit may move. trials : values at which it is tried alone. narrow : values from the best
    of which it is sought alone, where its valley is too narrow to be met from its absence.
    """

    @property
    def free(self) -> tuple[FreeParameter, ...]:
        """Its parameters."""

    @property
    def trials(self) -> tuple[Mapping[str, float], ...]:
        """Values of all of them."""

    @property
    def narrow(self) -> tuple[Mapping[str, float], ...]:
        """Values of some of them."""

    @property
    def together(self) -> Mapping[str, float]:
        """Where it begins beside others."""

    @property
    def where_far(self) -> Mapping[str, float]:
        """Where it begins beside others that are not enough."""


def loss(found: Fit, names: Sequence[str], neutral: Sequence[float] = (0.0,)) -> float:
    """Relative rise of the cost to first order where parameters go to where they do nothing and all others adjust [-].

    neutral : these values, in units of the scales, or one for all.
    """
    chosen = [found.free.names.index(name) for name in names]
    covariance = np.linalg.pinv(found.jacobian.T @ found.jacobian)[np.ix_(chosen, chosen)]
    x = found.x[chosen] - np.asarray(neutral)
    return float(x @ np.linalg.pinv(covariance) @ x) / max(2.0 * found.cost, 1e-300)


def joint_start(
    problem: RecordingProblem,
    free: Sequence[FreeParameter],
    known: Mapping[str, JoiningEffect],
    guess: TableParameters,
    far: bool = False,
) -> tuple[TableParameters, tuple[str, ...]]:
    """The guess fitted with every effect that can take part, without those that the fit can do without; what stays.

    Parameters
    ----------
    problem : pieces of the recordings. free : what the fit moves beside the effects. known : effects by name.
    guess : table from which the fit begins; effects that it has do not take part. far : with those that take part only
    then.
    """
    begins = {name: effect.together or (effect.where_far if far else {}) for name, effect in known.items()}
    part = {name: known[name] for name, begin in begins.items() if begin and name not in guess.effects}
    values: dict[str, float] = {}
    for name, effect in part.items():
        values |= {**effect.trials[0], **begins[name]}
    own = {name: [p for p in effect.free if p.name in begins[name]] for name, effect in part.items()}
    parameters = FreeParameters(guess.with_values(values), [*free, *(p for each in own.values() for p in each)])
    found = approached(problem, parameters, parameters.start(), evaluations=EVALUATIONS, tolerance=TOLERANCE)
    losses = {name: loss(found, [p.name for p in each]) for name, each in own.items()}
    stay = tuple(sorted((n for n in losses if losses[n] > LEAST), key=lambda n: -losses[n]))[:MOST]
    return parameters.table(found.x).without([name for name in part if name not in stay]), stay
