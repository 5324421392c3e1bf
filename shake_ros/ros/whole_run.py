"""What a node's timing was over a whole run in real time: jitter of the period, latencies; said when the node ends."""

from __future__ import annotations

import time

from shake_ros.core.safety.rates import Durations

SETTLING = 5_000_000_000  # of the start is left out [ns]


class WholeRun:
    """Counts durations in bins of a microsecond, so that its memory does not grow.

    Parameters
    ----------
    period : nominal distance of two samples [ns].
    """

    def __init__(self, period: int) -> None:
        self.jitter = Durations()
        self.latencies = Durations()
        self._period = period
        self._first = self._last = -1

    def sampled(self) -> None:
        """A sample is taken, or has come, now: how far its distance from the last one is from the period."""
        now = time.monotonic_ns()
        if self._settled(now):
            self.jitter.add(abs(now - self._last - self._period))
        self._last = now

    def latency(self, nanoseconds: int) -> None:
        """Note one latency [ns]."""
        if self._settled(time.monotonic_ns()):
            self.latencies.add(nanoseconds)

    def _settled(self, now: int) -> bool:
        if self._first < 0:
            self._first = now
        return now - self._first > SETTLING

    def lines(self) -> list[str]:
        """A line on each that was counted."""
        found = []
        for name, spread in {"period jitter": self.jitter, "latency": self.latencies}.items():
            if spread.count:
                figures = " ".join(f"{part} {value:.0f}" for part, value in spread.percentiles().items())
                found.append(f"whole run: {name} of {spread.count}: {figures} us")
        return found
