"""How many events there were within the last second, by explicit times."""

from __future__ import annotations

from collections import deque

SECOND = 1_000_000_000


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
