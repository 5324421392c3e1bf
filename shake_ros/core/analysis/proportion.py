"""A share of cases and how sure it is."""

from __future__ import annotations

import math
from typing import NamedTuple

NORMAL_95 = 1.959963984540054  # two-sided quantile of the normal distribution


class Share(NamedTuple):
    """Cases that are so, of how many."""

    hits: int
    of: int

    @property
    def value(self) -> float:
        """The share [-]; nan of no case."""
        return self.hits / self.of if self.of else math.nan

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval of the true share by Wilson's score.

        E. B. Wilson, J. Am. Stat. Assoc. 22 (1927) 209: the shares p with |h − p| ≤ z √(p (1 − p)/n).

        >>> [round(end, 4) for end in Share(9, 10).interval]
        [0.5958, 0.9821]
        >>> Share(0, 0).interval
        (0.0, 1.0)
        """
        if self.of == 0:
            return 0.0, 1.0
        z, n, p = NORMAL_95, self.of, self.value
        centre = p + z * z / (2 * n)
        width = z * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
        scale = 1 + z * z / n
        return max((centre - width) / scale, 0.0), min((centre + width) / scale, 1.0)

    def __str__(self) -> str:
        """
        >>> print(Share(9, 10))
        90.0 % of 10 (59.6 … 98.2 %)
        """
        if self.of == 0:
            return "no case"
        low, high = self.interval
        return f"{100 * self.value:.1f} % of {self.of} ({100 * low:.1f} … {100 * high:.1f} %)"
