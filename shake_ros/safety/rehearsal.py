"""What an interlock would say to a run that is predicted, or was recorded without it: by the checks of the table."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import NamedTuple

from shake_ros.quantities import ShakeError
from shake_ros.safety.causes import CAUSES, RUN, SENSED, SEVERITY, InterlockParameters
from shake_ros.safety.interlock import HOLDS, SECOND, Interlock, Trip

STEP = SECOND // 100  # while the pressure comes up [ns]
LONGEST_START = 60 * SECOND  # within which the interlock must let commands act in full [ns]


class WatchedRun(NamedTuple):
    """What an interlock sees, sample by sample.

    sample_time [s]; position [m], acceleration [m/s²], supply_pressure [Pa] : as the sensors say. command [-].
    reference : position that is wanted [m].
    """

    sample_time: float
    position: Sequence[float]
    acceleration: Sequence[float]
    supply_pressure: Sequence[float]
    command: Sequence[float]
    reference: Sequence[float]


def first_trip(
    parameters: InterlockParameters, run: WatchedRun, heeded: Collection[str] = CAUSES
) -> tuple[Trip, int] | None:
    """What would hold a run from rest at full span, and at which sample; None where nothing does.

    heeded : causes that count.

    Raises
    ------
    ShakeError : the interlock lets no command act within LONGEST_START.
    """
    lock, now = Interlock(parameters.replace(span=1.0), enabled=True), 0
    while lock.stage != RUN or lock.gain != 1.0:  # pressure and span come up at rest
        if now > LONGEST_START:
            raise ShakeError("the interlock does not let commands act")
        lock.command(now, 0.0)
        lock.act(now)
        now += STEP
    period, seen = round(run.sample_time * SECOND), 0
    columns = zip(run.position, run.acceleration, run.supply_pressure, run.reference, run.command, strict=True)
    for k, (position, acceleration, supply, reference, u) in enumerate(columns):
        lock.observe(now, position, acceleration, supply, reference)
        lock.command(now, u)
        lock.act(now)
        if lock.ledger.trip_count != seen:
            seen = lock.ledger.trip_count
            for trip in lock.trips:
                if trip.cause in heeded and SEVERITY[trip.action] >= HOLDS:
                    return trip, k
        now += period
    return None


def tightened(parameters: InterlockParameters, part: float) -> InterlockParameters:
    """The interlock with a part of the way to each limit of a sensor or of the distance from the reference."""
    causes = parameters.causes
    for name in (*SENSED, "tracking_error"):
        response = parameters.response(name)
        size = 1.0 / part if CAUSES[name].below else part
        causes = causes.replace(**{name: response.replace(threshold=size * response.threshold)})
    return parameters.replace(causes=causes)
