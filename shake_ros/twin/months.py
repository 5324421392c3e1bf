"""Months of one table: each followed parameter from day to day, its steps, its trend, and when maintenance is due.

What the twin knows at the end of a day is a reading, with an independent error: over night a value may wander as far as
that of a file. To the readings y of a parameter, of deviations s, is fitted

    y(t) = a + b t + Σ c_k [t ≥ t_k]

where the trend b and each step c_k (an abrupt change between two days, a repair among them) must pay for themselves: of
all such models the one with the least −2 log L + p log n is sought by adding and removing a term at a time, with odds
of 30 against a trend and against a step, whose day may be any. Readings that scatter by more than s scale the variance.

If the trend goes on, the parameter leaves its limits on the day on which its prediction does; the ends of the interval
are those days on which the ends of the prediction's 90 % interval do.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from shake_ros.search.decision import PRIOR
from shake_ros.twin.twin import INTERVAL, PAUSED, TwinWindow

DAY = 86400 * 10**9  # [ns]
LEAST = 4  # days of readings without which there is nothing to fit
AHEAD = 10.0  # times the length of the readings, over which a trend is continued
TREND = -1  # of the terms of a model; others are the places of steps


@dataclass(frozen=True)
class Readings:
    """A parameter from day to day."""

    name: str
    unit: str
    stamps: np.ndarray  # of the readings, shape (n,) [ns]
    # values, deviations: shape (n,) [unit]
    values: np.ndarray
    deviations: np.ndarray
    terms: tuple[int, ...] = ()  # of the model: TREND, and the first reading behind each step

    @property
    def days(self) -> np.ndarray:
        """From the first reading, shape (n,) [d]."""
        return (self.stamps - self.stamps[0]) / DAY

    def _rows(self, days: np.ndarray, terms: tuple[int, ...]) -> np.ndarray:
        steps = [days >= self.days[k] for k in terms if k != TREND]
        return np.column_stack([np.ones(len(days)), *([days] if TREND in terms else []), *steps]).astype(float)

    def _solved(self, terms: tuple[int, ...]) -> tuple[float, np.ndarray, np.ndarray]:
        """Information criterion, coefficients and their covariance."""
        rows = self._rows(self.days, terms) / self.deviations[:, None]
        wanted = self.values / self.deviations
        found, *_ = np.linalg.lstsq(rows, wanted, rcond=None)
        n, square = len(wanted), float(np.sum((wanted - rows @ found) ** 2))
        scatter = max(square / max(n - rows.shape[1], 1), 1.0)
        odds = 2.0 * sum(PRIOR + (0.0 if k == TREND else math.log(n - 1)) for k in terms)
        criterion = square / scatter + n * math.log(scatter) + (1 + len(terms)) * math.log(n) + odds
        return criterion, found, scatter * np.linalg.pinv(rows.T @ rows)

    def explained(self) -> Readings:
        """With the terms that pay for themselves."""
        places = [TREND, *range(1, len(self.values))]
        terms: tuple[int, ...] = ()
        best = self._solved(terms)[0]
        while len(self.values) >= LEAST:
            nearby = [(*terms, k) for k in places if k not in terms] + [
                tuple(t for t in terms if t != k) for k in terms
            ]
            nearby = [t for t in nearby if len(t) + LEAST - 1 <= len(self.values)]
            least, chosen = min((self._solved(t)[0], t) for t in nearby)
            if least >= best:
                break
            terms, best = chosen, least
        return Readings(self.name, self.unit, self.stamps, self.values, self.deviations, tuple(sorted(terms)))

    @cached_property
    def _model(self) -> tuple[np.ndarray, np.ndarray]:
        return self._solved(self.terms)[1:]

    @property
    def steps(self) -> list[tuple[int, float, float]]:
        """Each step: first reading behind it, size and standard deviation [unit]."""
        found, covariance = self._model
        first = len(found) - sum(k != TREND for k in self.terms)
        at = [k for k in self.terms if k != TREND]
        return [(k, float(found[i]), math.sqrt(covariance[i, i])) for i, k in enumerate(at, first)]

    @property
    def trend(self) -> tuple[float, float] | None:
        """Change in a day and its standard deviation [unit/d]; None where there is none."""
        found, covariance = self._model
        return (float(found[1]), math.sqrt(covariance[1, 1])) if TREND in self.terms else None

    def predicted(self, days: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Value and half of its 90 % interval on days, each of shape (m,) [unit]."""
        (found, covariance), rows = self._model, self._rows(days, self.terms)
        return rows @ found, INTERVAL * np.sqrt(np.einsum("ij,jk,ik->i", rows, covariance, rows))

    def due(self, least: float, most: float) -> tuple[float, float, float] | None:
        """When the parameter leaves its limits if the trend goes on: day, and the ends of its 90 % interval [d].

        None where it has no trend, or does not leave them within AHEAD times the length of the readings; the last day
        is infinite where the slow end does not.

        Parameters
        ----------
        least, most : [unit].
        """
        if self.trend is None:
            return None
        last = self.days[-1]
        ahead = last + np.linspace(0.0, AHEAD * last, 4001)
        way, limit = (1.0, most) if self.trend[0] > 0.0 else (-1.0, least)
        value, half = self.predicted(ahead)
        over = [way * (value + side * way * half - limit) >= 0.0 for side in (0.0, 1.0, -1.0)]
        middle, first, slow = (float(ahead[np.argmax(o)]) if o.any() else math.inf for o in over)
        return (middle, first, slow) if math.isfinite(middle) else None


def readings(
    windows: Sequence[TwinWindow], names: Sequence[str], units: Sequence[str], start: int
) -> tuple[Readings, ...]:
    """What was known at the end of each day, with the terms that explain it; nothing where it is one day.

    Parameters
    ----------
    windows : from the end of the reference on. start : stamp from which on stamps are a clock's [ns].
    """
    of_day = {w.stamp // DAY: w for w in windows if w.state != PAUSED and w.start >= start}
    last = [of_day[d] for d in sorted(of_day)]
    if len(last) < 2:
        return ()
    stamps = np.array([w.stamp for w in last])
    values, deviations = (np.array([getattr(w, f) for w in last]).T for f in ("values", "moved"))
    rows = zip(names, units, values, deviations, strict=True)
    return tuple(Readings(n, u, stamps, v, d).explained() for n, u, v, d in rows)
