"""The interlock: which command acts, at which stage the hydraulics are, and what stands, is latched or has tripped.

    off → low → high → run          sequenced, each stage for its time and confirmed by the hydraulics
    run → hold                      program interlock: the command ramps to zero, the pressure stays on
    run → hold → high → low → off   orderly stop, and `program_stop`
    any → off                       hydraulic interlock: valve to null and pressure off, at once; then `reset`, `enable`

Explicit times go in [ns]; nothing here reads a clock, so the same calls give the same answers. After every hold and
every start the master gain ramps from zero to the span.
"""

from __future__ import annotations

import dataclasses
import math
from collections import Counter, deque
from dataclasses import dataclass

import numpy as np

from shake_ros.safety import causes
from shake_ros.safety.causes import (
    CAUSES,
    HYDRAULIC,
    OFF,
    PROGRAM_HOLD,
    PROGRAM_STOP,
    RUN,
    SENSED,
    SEVERITY,
    STAGES,
    InterlockParameters,
    Response,
    Stages,
)

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
class ActiveTrip:
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
        self.active: dict[str, ActiveTrip] = {}
        self.severity = 0  # of the hardest action that anything asks for
        self.trips: deque[Trip] = deque(maxlen=MOST_TRIPS)
        self.counts: Counter[str] = Counter()
        self.trip_count = 0

    def update(self, name: str, response: Response, seen: Trip, stands: bool) -> None:
        """A cause stands, or does not any more; the first time is a trip, with the response's limit and action."""
        active = self.active.get(name)
        if active is None:
            if not stands or not response.active:
                return
            severity = SEVERITY[response.action]
            latched = response.latch or severity >= STOPS
            trip = dataclasses.replace(seen, limit=response.threshold, action=response.action, latched=latched)
            self.active[name] = ActiveTrip(trip, severity, latched, True)
            self.trips.append(trip)
            self.counts[name] += 1
            self.trip_count += 1
        else:
            active.stands = stands
            if not stands and (not active.latched or active.acknowledged):
                del self.active[name]
        self._weigh()

    def reset(self) -> str:
        """Forget what is latched; the reason where something stands that may not be left behind, else empty."""
        for name, active in self.active.items():
            if active.stands and active.severity >= HOLDS and active.latched and name not in ACKNOWLEDGED:
                return f"{active.trip} still stands"
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

    def leading(self) -> ActiveTrip | None:
        """What is in force: of the hardest causes the first; None where nothing is."""
        return max(self.active.values(), key=lambda one: one.acts, default=None)


SECOND = 1_000_000_000
OK, WARN, ERROR = range(3)
# a sensor that lies is named before what it seems to say
SENSORS_FIRST = sorted(enumerate(SENSED), key=lambda item: not item[1].startswith("sensor"))
COMMAND_CAUSES = ("command_not_finite", "command_range", "command_jump")


class Interlock:
    """Sensors, commands and requests in; the acting command and the stage out.

    Parameters
    ----------
    parameters : stages, span and causes.
    enabled : whether the start sequence begins by itself.
    """

    def __init__(self, parameters: InterlockParameters, enabled: bool) -> None:
        self.enabled = enabled
        self.ledger = Ledger()
        self.holds = 0
        self.gain = 0.0
        self._ceiling = RUN
        self._active = self.ledger.active
        self._command = 0.0
        self._stamp = -1
        self._acting = 0.0
        self._last = -1
        self._observed = -1
        self._position = math.nan
        self._holding = False
        self._away = 0.0  # at full span and not yet at the reference [s]; infinite once there
        causes.prepare()
        self._memory = causes.fresh_memory()
        self._values = np.zeros(len(SENSED))
        self._limits = np.zeros(len(SENSED))
        self._stages = Stages()
        self.apply(parameters)
        if enabled:
            self._stages.advance(0, RUN, RUN, moving=False)

    def apply(self, parameters: InterlockParameters) -> None:
        """Take other parameters, between two samples."""
        self.parameters = parameters
        for place, name in enumerate(SENSED):
            response = parameters.response(name)
            absent = -math.inf if CAUSES[name].below else math.inf
            self._limits[place] = response.threshold if response.active else absent
        self._stale = self._nanoseconds("stale_command")
        self._lost = self._nanoseconds("command_lost")
        self._first_age = min(self._stale, self._lost)
        self._range = self._limit("command_range")
        self._jump = self._limit("command_jump")
        self._distance = self._limit("tracking_error")
        self._ramp = parameters.ramp_time * SECOND
        self._stages.times = 0.0, parameters.low_pressure_time * SECOND, parameters.high_pressure_time * SECOND
        self._rise = parameters.span_time * SECOND

    def _limit(self, name: str) -> float:
        response = self.parameters.response(name)
        return response.threshold if response.active else math.inf

    def _nanoseconds(self, name: str) -> float:
        limit = self._limit(name)
        return round(limit * SECOND) if math.isfinite(limit) else math.inf

    # what comes in

    def command(self, stamp: int, u: float) -> None:
        """A new finite command u in [−1, 1] for the instant `stamp` [ns]; larger ones are clipped."""
        seen = max(stamp, self._last)  # a delayed command is judged when it comes
        if self._active:
            for name in COMMAND_CAUSES:
                self.clear(name)
        if abs(u) > self._range:
            self.report(seen, "command_range", abs(u))
        u = min(max(u, -1.0), 1.0)
        if self._stamp >= 0 and abs(u - self._command) > self._jump and self.stage == RUN:
            self.report(seen, "command_jump", abs(u - self._command))
        self._stamp = stamp
        self._command = u

    def observe(
        self, now: int, position: float, acceleration: float, supply_pressure: float, reference: float = math.nan
    ) -> None:
        """Look at one sample: [m], [m/s²], [Pa]; the reference at that instant [m] where there is one.

        It is compared with the position once that has come to it, or has had `return_time` for it at full span: in a
        hold and in a soft start the table is elsewhere.
        """
        elapsed = (now - self._observed) / SECOND if self._observed >= 0 else 0.0
        self._observed, self._position = now, position
        p = self.parameters
        supply = supply_pressure if self.stage == RUN else math.inf
        expected = p.full_speed * self._acting if self.stage == RUN else math.nan
        moving = abs(self._acting) > p.moving_command
        count = causes.watch(
            self._limits,
            self._memory,
            self._values,
            position,
            acceleration,
            supply,
            expected,
            moving,
            elapsed,
            p.velocity_time,
            p.valve_time,
            p.plausibility_bandwidth,
        )
        distance = self._distance_from(reference, elapsed)
        if count or self._active or distance > self._distance:
            self._judge(now, distance)

    def _distance_from(self, reference: float, elapsed: float) -> float:
        """How far the table is from its reference [m]; NaN while it need not be there."""
        if self.gain != self.parameters.span:
            self._away = 0.0
            return math.nan
        distance = abs(self._position - reference)
        if self._away <= self.parameters.return_time:
            if distance > self._distance:
                self._away += elapsed
                return math.nan
            self._away = math.inf
        return distance

    def _judge(self, now: int, distance: float) -> None:
        """Which sensed causes stand, one by one."""
        for place, name in SENSORS_FIRST:
            value, limit = float(self._values[place]), float(self._limits[place])
            stands = not value >= limit if CAUSES[name].below else value > limit
            self._update(name, now, value, stands)
        self._update("tracking_error", now, distance, distance > self._distance)

    def report(self, now: int, cause: str, value: float, text: str = "", stands: bool = True) -> None:
        """A cause that others have seen; one that does not stand is an event, which only a latch keeps."""
        self._update(cause, now, value, True, text)
        if not stands and cause in self._active:
            self._update(cause, now, value, False)

    def compare(self, now: int, cause: str, value: float, text: str = "") -> None:
        """A value that others have measured, against its threshold."""
        if value > self._limit(cause):
            self._update(cause, now, value, True, text)
        elif self._active:
            self.clear(cause)

    def clear(self, cause: str) -> None:
        """The cause does not stand any more; a latch keeps it until `reset`."""
        self._update(cause, 0, 0.0, False)

    def enable(self, wanted: bool, ceiling: int = RUN) -> None:
        """Begin the start sequence, up to stage `ceiling`, or an orderly stop."""
        self.enabled = wanted
        self._ceiling = ceiling

    def cut(self) -> None:
        """Valve to null and pressure off at once; where that is not to last, the start sequence follows."""
        self._stages.stage = OFF
        self._acting = self.gain = 0.0

    def stop(self, now: int) -> None:
        """The service `stop`."""
        self.report(now, "stop", 1.0, "stopped; waiting for reset", stands=False)
        if "stop" in self._active:
            self._active["stop"].latched = True

    def reset(self) -> tuple[bool, str]:
        """Forget what is latched; refused with its reason while something stands.

        A stale command is forgotten with it: the table waits for a new one.
        """
        now = self._last
        if self._stamp >= 0 and now - self._stamp > self._first_age:
            self._stamp = -1
        self.clear("stale_command")
        self.clear("command_lost")
        reason = self.ledger.reset()
        return (False, reason) if reason else (True, self.condition()[1])

    def _update(self, name: str, now: int, value: float, stands: bool, text: str = "") -> None:
        if not stands and name not in self._active:
            return
        self.ledger.update(name, self.parameters.response(name), Trip(name, now, value, math.nan, "", text), stands)
        self._follow()

    def _follow(self) -> None:
        """What the hardest action asks for at once."""
        if self.ledger.severity >= TRIPS:
            self.cut()
        if self.ledger.severity >= STOPS and not self.parameters.enable_after_reset:
            self.enabled = False

    # what goes out

    def act(self, now: int, confirmed: int = RUN) -> float:
        """The command that acts from `now` [ns] on; `confirmed` is the stage that the hydraulics have reached."""
        elapsed = now - self._last if self._last >= 0 else 0
        self._last = now
        if self.stage == RUN and self._stamp >= 0:
            age = now - self._stamp
            if age > self._first_age or self._active:
                self._update("stale_command", now, age / SECOND, age > self._stale, "")
                self._update("command_lost", now, age / SECOND, age > self._lost, "")
        wanted = self._wanted()
        if self.stage != wanted:
            self._stages.advance(now, wanted, confirmed, moving=self._acting != 0.0)
        if self.stage != RUN:
            self._acting = self.gain = 0.0
            return 0.0
        if self.ledger.severity >= HOLDS or wanted != RUN:
            return self._hold(elapsed)
        self._holding = False
        if self._stamp < 0:
            self._acting = 0.0
            return 0.0
        span = self.parameters.span
        if self.gain != span:
            step = elapsed / self._rise if self._rise > 0.0 else 1.0
            self.gain = min(span, self.gain + step) if self.gain < span else max(span, self.gain - step)
        self._acting = self.gain * self._command
        if self._active and self._acting * self._position > 0.0 and self.ledger.one_way():
            self._acting = 0.0
        return self._acting

    def _hold(self, elapsed: int) -> float:
        if not self._holding:
            self._holding = True
            self.holds += 1
        self.gain = 0.0
        step = elapsed / self._ramp if self._ramp > 0.0 else 1.0
        self._acting = max(0.0, self._acting - step) if self._acting > 0.0 else min(0.0, self._acting + step)
        return self._acting

    @property
    def passes(self) -> bool:
        """Whether commands act: at stage RUN and in no hold."""
        return self.stage == RUN and not self._holding

    def _wanted(self) -> int:
        """The stage to go to."""
        return OFF if self.ledger.severity >= STOPS or not self.enabled else self._ceiling

    @property
    def stage(self) -> int:
        """Stage of the hydraulics that is asked for."""
        return self._stages.stage

    @property
    def hold_severity(self) -> int:
        """0 while commands may act; else the rank of the action in force."""
        return self.ledger.severity if self.ledger.severity >= HOLDS else 0

    @property
    def now(self) -> int:
        """The newest time given to it [ns]; −1 before the first."""
        return self._last

    @property
    def waits_for_reset(self) -> bool:
        """Whether something latched keeps commands from acting, whoever enables."""
        return any(one.latched and one.acts >= HOLDS for one in self._active.values())

    @property
    def commanded(self) -> bool:
        """Whether commands come: one has, and it is not stale."""
        return self._stamp >= 0 and self._last - self._stamp <= self._first_age

    @property
    def tripped(self) -> bool:
        """Whether a hydraulic interlock waits for reset."""
        return self.ledger.severity >= TRIPS

    @property
    def leading(self) -> Trip | None:
        """The trip in force, of the hardest the first; None where nothing is."""
        hardest = self.ledger.leading()
        return hardest.trip if hardest else None

    @property
    def trips(self) -> list[Trip]:
        """The latest trips, the newest last."""
        return list(self.ledger.trips)

    def condition(self) -> tuple[int, str]:
        """Level and text of the present state."""
        hardest = self.ledger.leading()
        if hardest is not None and hardest.acts >= HOLDS:
            return self._blocked(hardest)
        if not self.enabled:
            return WARN, "not enabled" if self.stage == OFF else f"not enabled; stops at {STAGES[self.stage]}"
        if self.stage < self._ceiling or self.stage != RUN:
            return WARN, f"starting: {STAGES[self.stage]}"
        if self._stamp < 0:
            return WARN, "waiting for the first command"
        noted = [str(one.trip) for one in self._active.values()]
        return (WARN, f"running; {'; '.join(noted)}") if noted else (OK, "running")

    def _blocked(self, active: ActiveTrip) -> tuple[int, str]:
        trip = active.trip
        if trip.cause == "stop":
            return WARN, trip.text
        if trip.cause in ("stale_command", "command_lost"):
            age = (self._last - self._stamp) * 1e-9 if self._stamp >= 0 else trip.value
            what = f"no command for {age:.3f} s"
        else:
            what = str(trip)
        if active.severity >= TRIPS:
            return ERROR, f"hydraulic interlock: {what}; waiting for reset"
        if active.severity >= STOPS:
            return ERROR, f"program stop: {what}; waiting for reset"
        return ERROR, f"safe hold: {what}" + ("; waiting for reset" if active.latched and not trip.text else "")
