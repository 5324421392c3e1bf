"""The interlock in a node: its parameters, its services, its words on /diagnostics. Plant and bridge have the same."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from typing import Any

from shake_ros.core.quantities import ShakeError
from shake_ros.core.safety.causes import CAUSES, INDICATE, InterlockParameters
from shake_ros.core.safety.interlock import RUN, STAGES, Interlock
from shake_ros.core.safety.ledger import Trip
from shake_ros.core.safety.rates import LastSecond
from shake_ros.ros import interface
from shake_ros.ros.diagnostics import ERROR, WARN
from shake_ros.ros.frame import Frame, Reader
from shake_ros.settings import load_interlock

LOOKING = 0.1  # from one look for a second commander to the next [s]
FILLED = 0.2  # of commands' flow, before the share that is lost says anything [s]
NEAR = 3  # periods between a sample and the reference that it is compared with
REFERENCED = ("tracking_error", "stale_reference")  # causes that read the reference
NOT_FINITE = "command_not_finite"
TWO_COMMANDERS = "two_commanders"


class NodeInterlock:
    """One interlock and what the outside sees of it.

    Parameters
    ----------
    name : configuration in config/interlock, or a YAML file.
    enabled : whether the start sequence begins by itself.
    before_reset : called before the interlock is reset.

    `guard` is held while a service touches the interlock; a node whose samples come in another thread takes it too.
    """

    def __init__(self, frame: Frame, name: str, enabled: bool, before_reset: Callable[[], None] = lambda: None) -> None:
        self.frame = frame
        self.guard = threading.RLock()
        self._before_reset = before_reset
        configured = load_interlock(name)
        self._live = frame.parameters.declare(configured, "interlock.", accept=self._accept)
        self.references = self._open_reference()
        self._reference, self._reference_stamp = math.nan, -1
        self._built = True
        self.lock = Interlock(self._live.take(), enabled)
        self._announced = 0
        self._until_look = 0
        self._missed = LastSecond()
        self._asked, self._answered = LastSecond(), LastSecond()
        self._clock_offset = time.time_ns() - time.monotonic_ns()
        self._open_services()
        frame.diagnostics.condition = self.condition
        frame.diagnostics.values |= {
            "safe_holds": lambda: self.lock.holds,
            "stage": lambda: STAGES[self.lock.stage],
            "span": lambda: f"{self.lock.gain:.3f}",
            "trips": lambda: " ".join(f"{cause}:{count}" for cause, count in sorted(self.lock.ledger.counts.items())),
        }

    def _accept(self, parameters: InterlockParameters) -> None:
        for name in REFERENCED:
            response = parameters.response(name)
            if response.active and getattr(self, "_built", False) and self.references is None:
                raise ShakeError(
                    f"causes.{name}.action = '{response.action}': this node reads no reference; start it with an "
                    "interlock that does"
                )

    def _open_reference(self) -> Reader | None:
        """A reader of the reference, where a cause needs it."""
        wanted = [name for name in REFERENCED if self._live.value.response(name).active]
        if wanted and self.frame.lockstep:
            raise ShakeError(
                f"interlock.causes.{wanted[0]}: in lock-step it must be 'none' (its reader is not awaited)"
            )
        return self.frame.reader(interface.REFERENCE, self._on_reference) if wanted else None

    def _on_reference(self, stamp: int, position: float, *_: float) -> None:
        self._reference, self._reference_stamp = position, stamp

    def command(self, stamp: int, u: float) -> None:
        """A finite command for the sample at `stamp` [ns]."""
        self._answered.add(stamp, 1)
        self.lock.command(stamp, u)

    def observe(
        self, stamp: int, position: float, acceleration: float, supply_pressure: float, loss: float = 0.0
    ) -> None:
        """One sample [ns], [m], [m/s²], [Pa], beside the reference of about that instant.

        `loss` is the share of a second's samples that were lost on their way here.
        """
        age = stamp - self._reference_stamp
        reference = self._reference if abs(age) <= NEAR * self.frame.period else math.nan
        self.lock.observe(stamp, position, acceleration, supply_pressure, reference)
        if self._reference_stamp >= 0 and self.lock.stage == RUN:
            self.lock.compare(stamp, "stale_reference", age * 1e-9)
        if not self.frame.lockstep:
            self.lock.compare(stamp, "link_loss", max(loss, self._unanswered(stamp)))

    def _unanswered(self, stamp: int) -> float:
        """Share of the last second's samples for which no command came; while none comes, that is a stale command."""
        if self.lock.commanded:
            self._asked.add(stamp, 1)
        asked = self._asked.total(stamp)
        if asked * self.frame.sample_time < FILLED:
            return 0.0
        return 1.0 - min(1.0, self._answered.total(stamp) / asked)

    def _open_services(self) -> None:
        for service, answer in (
            (interface.ENABLE, self._enable),
            (interface.STOP, self._stop),
            (interface.RESET, self._reset),
        ):
            self.frame.node.create_service(service.type, service.name, answer)

    def refresh(self) -> None:
        """Between two samples: take changed parameters, look for a second commander, say what has tripped."""
        self._until_look -= 1
        if self._until_look < 0 and not self.frame.lockstep:
            self._until_look = round(LOOKING / self.frame.sample_time)
            self.look_for_two()
        if self._live.changed:
            self.lock.apply(self._live.take())
        if self.lock.ledger.trip_count != self._announced:
            count = self.lock.ledger.trip_count - self._announced
            self._announced = self.lock.ledger.trip_count
            for trip in self.lock.trips[-count:]:
                self._announce(trip)

    def _announce(self, trip: Trip) -> None:
        level = WARN if trip.action == INDICATE else ERROR
        values: dict[str, object] = {
            "cause": trip.cause,
            "time_ns": trip.time,
            "value": trip.value,
            "limit": trip.limit,
            "unit": CAUSES[trip.cause].unit,
            "action": trip.action,
        }
        self.frame.diagnostics.event("interlock", level, str(trip), values)
        log = self.frame.node.get_logger()
        if level == WARN:
            log.warning(f"{trip.cause}: {trip}", throttle_duration_sec=1.0)
        else:
            log.error(f"{trip.action}: {trip}", throttle_duration_sec=1.0)

    def tick(self, now: int, missed: int) -> None:
        """Each period of real time: how many deadlines were missed, and whether the clock has jumped."""
        if missed:
            self._missed.add(now, missed)
        self.lock.compare(now, "deadline_overruns", float(self._missed.total(now)))
        offset = time.time_ns() - time.monotonic_ns()
        jump = abs(offset - self._clock_offset) * 1e-9
        self._clock_offset = offset
        self.lock.compare(now, "clock_jump", jump)

    def refused(self, now: int, reason: str) -> None:
        """A command that is no command: NaN, infinite, unreadable."""
        self.lock.report(now, NOT_FINITE, 1.0, reason)

    def foreign(self, now: int, reason: str) -> None:
        """A command that the one controller cannot have sent."""
        self.lock.report(now, TWO_COMMANDERS, 1.0, reason, stands=False)

    def look_for_two(self) -> None:
        """Whether more than one node publishes commands."""
        topic = interface.VALVE_COMMAND.name
        publishers = self.frame.node.count_publishers(topic)
        if publishers > 1:
            self.lock.report(self.lock.now, TWO_COMMANDERS, float(publishers), f"{publishers} publishers on {topic}")
        else:
            self.lock.clear(TWO_COMMANDERS)

    def condition(self) -> tuple[int, str]:
        """Level and text of the present state."""
        with self.guard:
            self.look_for_two()
            return self.lock.condition()

    def _enable(self, request: Any, response: Any) -> Any:
        with self.guard:
            blocked = self.lock.hold_severity and request.data and not self.lock.enabled
            if not blocked:
                self.lock.enable(request.data)
            response.success, response.message = not blocked, self.lock.condition()[1]
        return response

    def _stop(self, _request: Any, response: Any) -> Any:
        with self.guard:
            self.lock.stop(self.lock.now)
            response.success, response.message = True, self.lock.condition()[1]
        return response

    def _reset(self, _request: Any, response: Any) -> Any:
        with self.guard:
            self.look_for_two()
            self._before_reset()
            self._reference_stamp = -1
            self.lock.clear("stale_reference")
            response.success, response.message = self.lock.reset()
            if response.success:
                self.frame.diagnostics.clear()
        return response
