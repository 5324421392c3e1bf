"""What stands, what is latched, what has tripped."""

from __future__ import annotations

import dataclasses
from collections import Counter, deque
from dataclasses import dataclass

from shake_ros.core.safety.causes import CAUSES, HYDRAULIC, PROGRAM_HOLD, PROGRAM_STOP, SEVERITY, Response

MOST_TRIPS = 64  # kept for reports
HOLDS = SEVERITY[PROGRAM_HOLD]
STOPS = SEVERITY[PROGRAM_STOP]
TRIPS = SEVERITY[HYDRAULIC]
# `reset` may leave these behind while they stand, else nothing could bring the table back
ACKNOWLEDGED = ("position_soft", "position_hard")  # until they are gone, only commands towards the middle act


@dataclass(frozen=True)
class Trip:
    """What happened, when [ns], with which value against which limit [unit of the cause], and what followed.

    `latched`: it stands until `reset`.
    """

    cause: str
    time: int
    value: float
    limit: float
    action: str
    text: str = ""
    latched: bool = False

    def __str__(self) -> str:
        if self.text:
            return self.text
        unit = CAUSES[self.cause].unit
        side = "below" if CAUSES[self.cause].below else "beyond"
        return f"{self.cause} {self.value:.4g} {side} {self.limit:.4g} {unit}".removesuffix(" -")


@dataclass
class Standing:
    """A cause that stands, or is latched."""

    trip: Trip
    severity: int
    latched: bool
    stands: bool
    acknowledged: bool = False

    @property
    def acts(self) -> int:
        """Severity of what it asks for now."""
        return 0 if self.acknowledged else self.severity


class Ledger:
    """The causes that stand or are latched, by name, and the latest trips."""

    def __init__(self) -> None:
        self.active: dict[str, Standing] = {}
        self.severity = 0  # of the hardest action that anything asks for
        self.trips: deque[Trip] = deque(maxlen=MOST_TRIPS)
        self.counts: Counter[str] = Counter()
        self.trip_count = 0

    def update(self, name: str, response: Response, seen: Trip, stands: bool) -> None:
        """A cause stands, or does not any more; the first time is a trip, with the response's limit and action."""
        standing = self.active.get(name)
        if standing is None:
            if not stands or not response.active:
                return
            severity = SEVERITY[response.action]
            latched = response.latch or severity >= STOPS
            trip = dataclasses.replace(seen, limit=response.threshold, action=response.action, latched=latched)
            self.active[name] = Standing(trip, severity, latched, True)
            self.trips.append(trip)
            self.counts[name] += 1
            self.trip_count += 1
        else:
            standing.stands = stands
            if not stands and (not standing.latched or standing.acknowledged):
                del self.active[name]
        self._weigh()

    def reset(self) -> str:
        """Forget what is latched; the reason where something stands that may not be left behind, else empty."""
        for name, standing in self.active.items():
            if standing.stands and standing.severity >= HOLDS and standing.latched and name not in ACKNOWLEDGED:
                return f"{standing.trip} still stands"
        for name in list(self.active):
            if self.active[name].stands and name in ACKNOWLEDGED:
                self.active[name].acknowledged = True
            else:
                del self.active[name]
        self._weigh()
        return ""

    def _weigh(self) -> None:
        self.severity = max((one.acts for one in self.active.values()), default=0)

    def one_way(self) -> bool:
        """Whether the table was reset beyond a limit of its position, and still is."""
        return any(name in self.active and self.active[name].acknowledged for name in ACKNOWLEDGED)

    def leading(self) -> Standing | None:
        """What is in force: of the hardest causes the first; None where nothing is."""
        return max(self.active.values(), key=lambda one: one.acts, default=None)
