"""Has a followed parameter changed, and since when? A generalised likelihood ratio over windows, in information form.

Let x̂ with covariance P be what was known before the last m windows, Q what the parameters wander meanwhile, H and h the
information of these windows. Their score s = h − H x̂ has, where nothing changed, the covariance V = H + H (P + Q) H; a
change of one parameter by δ moves its mean by H e δ. So

    z = eᵀ H V⁻¹ s / √(eᵀ H V⁻¹ H e)

is a standard normal variable for each parameter and each m. Q also holds what does not matter: no model is exact, and
other motions show other values. A change that moves less of the acceleration than what matters stays below the
threshold, however precisely it is known. A second variable watches what no followed parameter explains: the logarithm
of the innovations' mean square against what the reference predicts of it, a Student variable with as many degrees of
freedom as the reference has windows less one, written as the normal variable of the same probability. The threshold is
that of the false alarms per hour, over all variables and all m that are looked at.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import norm
from scipy.stats import t as student

from shake_ros.twin.evidence import KnownState, WindowEvidence

LAGS = (1, 2, 4, 8, 16, 32, 64, 128)  # windows that may have passed since a change
HOUR = 3600.0


@dataclass(frozen=True)
class NormalSquare:
    """What the reference predicts of the logarithm of a window's mean square; windows of one motion depart together."""

    # mean, deviation: of another window [-]
    mean: float
    deviation: float
    freedom: int  # degrees of freedom of its Student distribution

    @classmethod
    def of(cls, squares: Sequence[float]) -> NormalSquare:
        """From the mean squares of the windows of a reference, two at least."""
        logs, n = np.log(squares), len(squares)
        return cls(float(np.mean(logs)), float(np.std(logs, ddof=1)) * math.sqrt(1.0 + 1.0 / n), n - 1)

    def score(self, log: float) -> float:
        """Standard normal variable that is as unlikely as a logarithm of the mean square."""
        return float(norm.isf(student.sf((log - self.mean) / self.deviation, self.freedom)))

    def most(self, score: float) -> float:
        """The mean square at a standard normal variable."""
        return math.exp(self.mean + self.deviation * float(student.isf(norm.sf(score), self.freedom)))


@dataclass(frozen=True)
class Alarm:
    """A change."""

    windows: int  # that have passed since, the first to show it among them
    parameter: int  # index of the followed one that moved most, −1 where the innovations grew without one
    score: float  # its standard normal variable


def threshold(false_alarms: float, window: float, variables: int) -> float:
    """Size of a standard normal variable that a table without change exceeds so often.

    Parameters
    ----------
    false_alarms : [1/h]. window : [s]. variables : that are looked at, at each of the lags.

    >>> round(threshold(0.01, 2.0, 13), 2)
    5.19
    """
    tests = HOUR / window * variables * sum(1.0 / lag for lag in LAGS)  # of m windows one in m is a new one
    return float(norm.isf(0.5 * false_alarms / tests))


def scores(known: KnownState, wander: np.ndarray, windows: Sequence[WindowEvidence], inflation: float) -> np.ndarray:
    """The standard normal variable of each parameter, shape (p,), for the windows since something was known.

    Parameters
    ----------
    wander : variance that the parameters gained since, and of what does not matter, shape (p,).
    inflation : of the variance of the innovations.
    """
    h = sum((w.vector for w in windows), np.zeros(len(wander))) / inflation
    information = sum((w.information for w in windows), np.zeros((len(wander),) * 2)) / inflation
    score = h - information @ known.mean
    variance = information + information @ (known.covariance + np.diag(wander)) @ information
    scale = np.sqrt(np.maximum(np.diag(variance), 1e-12))
    across = np.linalg.solve(
        variance / np.outer(scale, scale) + 1e-9 * np.eye(len(scale)), information / scale[:, None]
    )
    power = np.sum((information / scale[:, None]) * across, axis=0)
    seen = power > 1e-9
    found: np.ndarray = np.where(seen, across.T @ (score / scale) / np.sqrt(np.where(seen, power, 1.0)), 0.0)
    return found


def mean_log(windows: Sequence[WindowEvidence]) -> float:
    """Mean logarithm of the innovations' mean square."""
    return float(np.mean([math.log(max(w.square, 1e-12)) for w in windows]))


def alarm(
    history: Sequence[tuple[KnownState, WindowEvidence]],
    walk: np.ndarray,
    inflation: float,
    normal: NormalSquare,
    limit: float,
    count: int,
    apart: np.ndarray,
) -> Alarm | None:
    """The change that the windows show most clearly, if any.

    Parameters
    ----------
    history : windows with what was known before each, the newest last. walk : variance gained in a window, shape (p,).
    normal : mean square of the innovations. limit : from `threshold`.
    count : of the first parameters, that may change. apart : variance of what does not matter, shape (p,).
    """
    best: Alarm | None = None
    for lag in (m for m in LAGS if m <= len(history)):
        windows = [w for _, w in history[-lag:]]
        z = scores(history[-lag][0], lag * walk + apart, windows, inflation)[:count]
        parameter = int(np.argmax(np.abs(z)))
        found = Alarm(lag, parameter, float(z[parameter]))
        if (grown := normal.score(mean_log(windows))) > abs(found.score):
            found = Alarm(lag, -1, grown)
        if abs(found.score) > limit and (best is None or abs(found.score) > abs(best.score)):
            best = found
    return best


def windows_since(
    history: Sequence[tuple[KnownState, WindowEvidence]], found: Alarm, inflation: float, wide: np.ndarray
) -> int:
    """Windows since the change of an alarm: those whose own parameters gain most likelihood over what was known.

    Parameters
    ----------
    wide : standard deviation within which the changed parameters lie, shape (p,).
    """
    p = len(wide)
    gains = []
    for m in range(1, min(len(history), 2 * found.windows) + 1):
        known = history[-m][0]
        information = np.sum([w.information for _, w in history[-m:]], axis=0) / inflation
        vector = np.sum([w.vector for _, w in history[-m:]], axis=0) / inflation
        score = (vector - information @ known.mean)[:p]
        gains.append(0.5 * float(score @ np.linalg.solve(information[:p, :p] + np.diag(wide**-2.0), score)))
    return int(np.argmax(gains)) + 1
