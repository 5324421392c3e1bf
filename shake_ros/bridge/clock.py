"""The target's clock on the host's: offset and drift from the quickest datagrams.

d = arrival − target time is the offset plus the way of the datagram, which is never shorter than its least. So the
smallest d of each BUCKET is kept, and a straight line through those of the last WINDOW buckets is offset and drift.
The offset holds the least way, some 10 µs on a cable: only a second clock could tell the two apart.
"""

from __future__ import annotations

from collections import deque

import numpy as np

SECOND = 1_000_000_000
BUCKET = SECOND // 10  # [ns]
WINDOW = 100  # buckets
ENOUGH = 10  # buckets before a drift is fitted
JUMP = 50_000_000  # a distance from the line that no way of a datagram explains [ns]
PATIENCE = 20  # so many of them in a row are another clock


class TargetClock:
    """Maps the target's time to the host's."""

    def __init__(self) -> None:
        self.jumps = 0
        self.last_jump = 0.0
        self._restart()

    def _restart(self) -> None:
        self._least: deque[tuple[int, int]] = deque(maxlen=WINDOW)
        self._bucket: tuple[int, int] | None = None
        self._bucket_end = 0
        self._origin = 0
        self._offset = 0
        self._drift = 0.0
        self._far = 0
        self.samples = 0

    @property
    def ready(self) -> bool:
        """Whether a few datagrams have come, so that one slow one does not set the offset."""
        return self.samples >= PATIENCE

    @property
    def offset(self) -> float:
        """Host time minus target time at the newest bucket [s]."""
        return self._offset / SECOND

    @property
    def drift(self) -> float:
        """How much faster the host's clock goes than the target's [-]."""
        return self._drift

    def add(self, target_time: int, arrival: int) -> None:
        """A datagram: when it was sent [ns, target's clock], and when it came [ns, host's clock]."""
        distance = arrival - target_time
        if self.samples and abs(distance - self._at(target_time)) > JUMP:
            self._far += 1
            if self._far < PATIENCE:
                return
            self.last_jump = abs(distance - self._at(target_time)) / SECOND
            self.jumps += 1
            self._restart()
        self._far = 0
        self.samples += 1
        if self._bucket is None or target_time >= self._bucket_end:
            self._close(target_time)
            self._bucket = (target_time, distance)
            self._bucket_end = target_time + BUCKET
        elif distance < self._bucket[1]:
            self._bucket = (target_time, distance)
        if len(self._least) < ENOUGH:
            smallest = min([one[1] for one in self._least] + [self._bucket[1]])
            self._origin, self._offset, self._drift = target_time, smallest, 0.0

    def _close(self, now: int) -> None:
        if self._bucket is None:
            return
        self._least.append(self._bucket)
        if len(self._least) < ENOUGH:
            return
        first = self._least[0]
        t = np.array([one[0] - first[0] for one in self._least], dtype=np.float64)
        d = np.array([one[1] - first[1] for one in self._least], dtype=np.float64)
        middle, height = float(t.mean()), float(d.mean())
        t -= middle
        self._drift = float(t @ d) / float(t @ t)
        self._origin = now
        self._offset = first[1] + round(height + self._drift * (now - first[0] - middle))

    def _at(self, target_time: int) -> int:
        return self._offset + round(self._drift * (target_time - self._origin))

    def to_host(self, target_time: int) -> int:
        """Host time of a target time [ns]."""
        return target_time + self._at(target_time)
