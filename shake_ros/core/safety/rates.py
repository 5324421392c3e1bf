"""How many events there were within the last second, by explicit times; and how durations are spread."""

from __future__ import annotations

from array import array
from collections import deque

SECOND = 1_000_000_000
MICROSECOND = 1000
LONGEST = 100_000  # [µs] longer ones share the last bin


class LastSecond:
    """A sliding sum of counts.

    >>> missed = LastSecond()
    >>> missed.add(0, 3)
    >>> missed.add(900_000_000, 2)
    >>> missed.total(950_000_000), missed.total(1_500_000_000), missed.total(3_000_000_000)
    (5, 2, 0)
    """

    def __init__(self) -> None:
        self._events: deque[tuple[int, int]] = deque()
        self._sum = 0

    def add(self, now: int, count: int) -> None:
        """Note `count` events at `now` [ns]."""
        self._events.append((now, count))
        self._sum += count

    def total(self, now: int) -> int:
        """Events within the second before `now` [ns]."""
        while self._events and now - self._events[0][0] > SECOND:
            self._sum -= self._events.popleft()[1]
        return self._sum


class Durations:
    """Percentiles of durations, counted in bins of a microsecond: its memory does not grow.

    >>> spread = Durations()
    >>> for k in range(1, 1001):
    ...     spread.add(k * 1000)
    >>> spread.count, spread.percentiles()
    (1000, {'p50': 500.0, 'p99': 990.0, 'p999': 999.0, 'max': 1000.0})
    """

    def __init__(self) -> None:
        self.count = 0
        self.longest = 0
        self._bins = array("q", bytes(8 * (LONGEST + 1)))

    def add(self, duration: int) -> None:
        """Count a duration [ns]."""
        self.count += 1
        self.longest = max(self.longest, duration)
        self._bins[min(max(duration // MICROSECOND, 0), LONGEST)] += 1

    def percentiles(self) -> dict[str, float]:
        """Median, 99 %, 99.9 % and the longest [µs]; empty before the first."""
        if self.count == 0:
            return {}
        found, total = {}, 0
        parts = {"p50": 0.5, "p99": 0.99, "p999": 0.999}
        for place, number in enumerate(self._bins):
            total += number
            for name, part in parts.items():
                if name not in found and total >= part * self.count:
                    found[name] = float(place)
        return {**found, "max": self.longest / MICROSECOND}
