"""What recordings identify: singular values of the scaled Jacobian, pairs that go together, directions left open.

Each column of the weighted Jacobian is scaled to the parameter's size (its value, or the change that matters where that
is larger); a singular value s then says that the combination of its right singular vector is known to 1/s, as a part
of the parameters' sizes, from white residuals of variance one. The widening of that by residuals that are correlated
or above the noise is taken over from the standard errors. Source: L. Ljung, System Identification (1999), 4.6, 9.2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shake_ros.fit.least_squares import Fit
from shake_ros.fit.uncertainty import at_bound, correlation, covariance

OPEN = 0.5  # deviation of a combination, as a part of the parameters' sizes, from which on it is not identified
TOGETHER = 0.95  # correlation from which on two parameters are told as a pair
SHARE = 0.3  # weight in a combination, of its largest one, from which on a parameter is named
NAMED = 4  # parameters of a combination that a report names at most


@dataclass(frozen=True)
class OpenCombination:
    """A combination of parameters. weights : by name, of parameters in parts of their sizes. deviation : of it [-]."""

    weights: dict[str, float]
    deviation: float

    @property
    def text(self) -> str:
        """The parameters that only act together.

        >>> OpenCombination({f"node {i}": 0.2 for i in range(17)}, 1.0).text
        'node 0 with node 1 with node 2 with node 3 with 13 more'
        """
        names = list(self.weights)
        more = [f"{len(names) - NAMED} more"] if len(names) > NAMED else []
        return " with ".join([*names[:NAMED], *more])


@dataclass(frozen=True)
class Identifiability:
    """How far recordings identify the parameters of a fit.

    Attributes
    ----------
    names : the parameters. sizes : what their deviations count in, in units of the fit's scales, shape (p,).
    correlation : of the estimates, shape (p, p), NaN at bounds. information : shape (p, p), per size and widened as
        the standard errors are. deviations : of each parameter by itself with the others free [sizes], shape (p,).
    left_open : combinations that are not identified, the worst first. pairs : (name, name, correlation).
    bound : parameters that rest on a bound. widening : of the variances, by which information counts less [-].
    """

    names: tuple[str, ...]
    sizes: np.ndarray
    correlation: np.ndarray
    information: np.ndarray
    deviations: np.ndarray
    left_open: tuple[OpenCombination, ...]
    pairs: tuple[tuple[str, str, float], ...]
    bound: tuple[str, ...]
    widening: float

    @property
    def weakest(self) -> int:
        """The parameter that is known least."""
        return int(np.argmax(self.deviations))

    @property
    def text(self) -> str:
        """One or two sentences for a report."""
        worst = self.names[self.weakest]
        if not self.left_open:
            said = (
                f"these recordings identify all {len(self.names)} parameters; "
                f"{worst} is the least certain, ± {100.0 * self.deviations[self.weakest]:.2g} %"
            )
        else:
            said = f"these recordings do not identify {'; '.join(c.text for c in self.left_open)}"
        if self.pairs:
            pairs = ", ".join(f"{a} with {b} ({value:+.2f})" for a, b, value in self.pairs)
            said += f"; strongly correlated: {pairs}"
        if self.bound:
            said += f"; at a bound: {', '.join(self.bound)}"
        return said


def widening(result: Fit, blocks: np.ndarray) -> float:
    """Ratio of the estimates' variances to those that white residuals of variance one would give."""
    inside = ~at_bound(result)
    if not np.any(inside):
        return 1.0
    j = result.jacobian[:, inside]
    plain = np.diag(np.linalg.pinv(j.T @ j, rcond=1e-12))
    wide = np.diag(covariance(result, blocks))[inside]
    good = (plain > 0.0) & np.isfinite(wide)
    return max(float(np.median(wide[good] / plain[good])), 1e-6) if np.any(good) else 1.0


def deviations_of(information: np.ndarray) -> np.ndarray:
    """Deviation of each parameter with the others free, shape (p,); large where the information is singular."""
    weights, vectors = np.linalg.eigh(information)
    floor = max(float(weights.max()), 1e-300) * 1e-14
    return np.asarray(np.sqrt((vectors**2) @ (1.0 / np.maximum(weights, floor))))


def identifiability(result: Fit, blocks: np.ndarray) -> Identifiability:
    """What the recordings behind a fit identify.

    Parameters
    ----------
    blocks : number of the block of time that each residual belongs to, shape (n,).
    """
    names, sizes = result.free.names, np.maximum(np.abs(result.x), 1.0)
    wide = widening(result, blocks)
    scaled = result.jacobian * sizes / np.sqrt(wide)
    _, singular, rows = np.linalg.svd(scaled, full_matrices=False)
    left_open = []
    for s, row in zip(singular[::-1], rows[::-1], strict=True):
        deviation = 1.0 / max(float(s), 1e-12)
        if deviation > OPEN:
            order = np.argsort(-np.abs(row))
            row = row * np.sign(row[order[0]])
            weights = {names[i]: float(row[i]) for i in order if abs(row[i]) > SHARE * row[order[0]]}
            left_open.append(OpenCombination(weights, deviation))
    related = correlation(result, blocks)
    pairs = [
        (names[i], names[k], float(related[i, k]))
        for i in range(len(names))
        for k in range(i)
        if abs(related[i, k]) > TOGETHER
    ]
    information = scaled.T @ scaled
    bound = tuple(n for n, resting in zip(names, at_bound(result), strict=True) if resting)
    return Identifiability(
        names, sizes, related, information, deviations_of(information), tuple(left_open), tuple(pairs), bound, wide
    )
