"""What plant and bridge alike have: the interlock, one way to it, and the sensors' topics.

The interlock is parameters, services, lines on the console and a place on /diagnostics.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Any

from shake_ros.physics.plant.parameters import SensorParameters
from shake_ros.quantities import Parameters, ShakeError, choice
from shake_ros.realtime import LastSecond
from shake_ros.ros import interface
from shake_ros.ros.diagnostics import ERROR, OK, WARN
from shake_ros.ros.frame import Frame, Reader
from shake_ros.safety.causes import CAUSES, INDICATE, RUN, STAGES, InterlockParameters
from shake_ros.safety.interlock import Interlock, Trip
from shake_ros.settings import load_interlock

LOOKING = 0.1  # from one look for a second commander to the next [s]
FILLED = 0.2  # of commands' flow, before the share that is lost says anything [s]
NEAR = 3  # periods between a sample and the reference that it is compared with
OPERATED = "operator_gone"
REFERENCED = ("tracking_error", "stale_reference")  # causes that read the reference
NOT_FINITE = "command_not_finite"
TWO_COMMANDERS = "two_commanders"


@dataclass(frozen=True)
class InterlockChoice(Parameters):
    """Which interlock a node has."""

    configuration: str = choice("configuration in config/interlock, or a YAML file")


class NodeInterlock:
    """One interlock: what comes in, what acts, and what the outside sees of it.

    Parameters
    ----------
    enabled : whether the start sequence begins by itself.
    before_reset : called before the interlock is reset.

    Attributes
    ----------
    core : the interlock without ROS.
    guard : while it is held no service touches the interlock; a node whose samples come in another thread works so.
    act, watch, report, clear : its `act`, `compare`, `report` and `clear`.
    """

    def __init__(self, frame: Frame, enabled: bool, before_reset: Callable[[], None] = lambda: None) -> None:
        self._frame = frame
        self.guard = threading.RLock()
        self._before_reset = before_reset
        chosen = frame.settings(InterlockChoice, "interlock").value
        self._live = frame.parameters.declare(load_interlock(chosen.configuration), "interlock.")
        self._reference, self._reference_stamp = math.nan, -1
        self._references = self._open_reference()
        self._operator_at = 0.0  # of the newest sign of the operator's page, on the monotonic clock [s]
        self._operated = self._open_operator()
        self._live.accept = self._accept
        core = self.core = Interlock(self._live.take(), enabled)
        self.act, self.watch, self.report, self.clear = core.act, core.compare, core.report, core.clear
        self._announced = self._until_look = 0
        self._published = self._acting()
        self._missed, self._asked, self._answered = LastSecond(), LastSecond(), LastSecond()
        self._clock_offset = time.time_ns() - time.monotonic_ns()
        for service, answer in zip(interface.SERVICES.values(), (self._enable, self._stop, self._reset), strict=True):
            frame.node.create_service(service.type, service.name, answer)
        frame.diagnostics.condition = self.condition
        frame.diagnostics.values |= {
            "safe_holds": lambda: core.holds,
            "stage": lambda: STAGES[core.stage],
            "passes": lambda: core.passes,
            "span": lambda: f"{core.gain:.3f}",
            "trips": lambda: " ".join(f"{cause}:{count}" for cause, count in sorted(core.ledger.counts.items())),
        }

    def _open_reference(self) -> Reader | None:
        """A reader of the reference, where a cause needs it."""
        wanted = [name for name in REFERENCED if self._live.value.response(name).active]
        if wanted and self._frame.lockstep:
            raise ShakeError(
                f"interlock.causes.{wanted[0]}: in lock-step it must be 'none' (lock-step does not wait for its reader)"
            )
        return Reader(self._frame, interface.REFERENCE, self._on_reference) if wanted else None

    def _open_operator(self) -> bool:
        """Whether an operator at the page is required; then the page's reports are timed by the machine's own clock."""
        if not self._live.value.response(OPERATED).active:
            return False
        topic = interface.OPERATOR
        self._frame.subscription(topic, lambda _: setattr(self, "_operator_at", time.monotonic()))
        return True

    def _accept(self, parameters: InterlockParameters) -> None:
        response = parameters.response(OPERATED)
        if response.active != self._operated:
            raise ShakeError(f"causes.{OPERATED}.action = '{response.action}': fixed when the node starts")
        for name in REFERENCED:
            response = parameters.response(name)
            if response.active and self._references is None:
                raise ShakeError(
                    f"causes.{name}.action = '{response.action}': this node reads no reference; start it with an "
                    "interlock that does"
                )

    def _on_reference(self, stamp: int, position: float, *_: float) -> None:
        self._reference, self._reference_stamp = position, stamp

    def command(self, stamp: int, u: float) -> None:
        """A finite command for the sample at `stamp` [ns]."""
        if not self._frame.lockstep:
            self._answered.add(stamp, 1)
        self.core.command(stamp, u)

    def refused(self, now: int, reason: str) -> None:
        """A command that is no command: NaN, infinite, unreadable, without a stamp."""
        with self.guard:
            self.report(now, NOT_FINITE, 1.0, reason)

    def foreign(self, now: int, reason: str) -> None:
        """A command that the one controller cannot have sent."""
        with self.guard:
            self.report(now, TWO_COMMANDERS, 1.0, reason, stands=False)

    def doubled(self, now: int, stamp: int) -> None:
        """A command for an instant [ns] that had one, or that is older than the newest."""
        topic, publishers = self._publishers()
        self.foreign(now, f"second command for {stamp * 1e-9:.6f} s or before; {publishers} on {topic}")

    def observe(
        self, stamp: int, position: float, acceleration: float, supply_pressure: float, loss: float = 0.0
    ) -> None:
        """One sample [ns], [m], [m/s²], [Pa], beside the reference of about that instant.

        `loss` is the share of a second's samples that were lost on their way here.
        """
        age = stamp - self._reference_stamp
        reference = self._reference if abs(age) <= NEAR * self._frame.period else math.nan
        self.core.observe(stamp, position, acceleration, supply_pressure, reference)
        if self._reference_stamp >= 0 and self.core.stage == RUN:
            self.watch(stamp, "stale_reference", age * 1e-9)
        if self._operated:
            silent = time.monotonic() - self._operator_at if self.core.stage == RUN else 0.0
            self.watch(stamp, OPERATED, min(silent, CAUSES[OPERATED].high))
        if not self._frame.lockstep:
            self.watch(stamp, "link_loss", max(loss, self._unanswered(stamp)))

    def _unanswered(self, stamp: int) -> float:
        """Share of the last second's samples for which no command came; while none comes, that is a stale command."""
        if self.core.commanded:
            self._asked.add(stamp, 1)
        asked = self._asked.total(stamp)
        if asked * self._frame.sample_time < FILLED:
            return 0.0
        return 1.0 - min(1.0, self._answered.total(stamp) / asked)

    def tick(self, now: int, missed: int) -> None:
        """Each period of real time: how many deadlines were missed, and whether the clock has jumped."""
        if missed:
            self._missed.add(now, missed)
        self.watch(now, "deadline_overruns", float(self._missed.total(now)))
        offset = time.time_ns() - time.monotonic_ns()
        jump = abs(offset - self._clock_offset) * 1e-9
        self._clock_offset = offset
        self.watch(now, "clock_jump", jump)
        if self._references is not None:
            self._references.take()

    def refresh(self) -> None:
        """Between two samples: take changed parameters, look for a second commander, say what has tripped."""
        self._until_look -= 1
        if self._until_look < 0 and not self._frame.lockstep:
            self._until_look = round(LOOKING / self._frame.sample_time)
            self._look_for_two()
        if self._live.changed:
            self.core.apply(self._live.take())
        now = self._acting()
        if now != self._published:  # a page shows it, the controller waits at once, and a recording holds when
            self._published = now
            self._frame.diagnostics.publish()
        ledger = self.core.ledger
        if ledger.trip_count != self._announced:
            for trip in self.core.trips[self._announced - ledger.trip_count :]:
                self._announce(trip)
            self._announced = ledger.trip_count

    def _acting(self) -> tuple[int, bool, bool]:
        """Stage, whether commands act, and whether in full."""
        return self.core.stage, self.core.passes, self.core.gain >= 1.0

    def _announce(self, trip: Trip) -> None:
        """At once on /diagnostics; on the console each cause once a second, but whatever waits for `reset` always."""
        level = WARN if trip.action == INDICATE else ERROR
        values: dict[str, object] = {
            "cause": trip.cause,
            "time_ns": trip.time,
            "value": trip.value,
            "limit": trip.limit,
            "unit": CAUSES[trip.cause].unit,
            "action": trip.action,
        }
        self._frame.diagnostics.event("interlock", level, str(trip), values)
        said = f"{trip.cause}: {trip}" if trip.text else str(trip)
        waits = "; waits for reset" if trip.latched and not trip.text.endswith("waiting for reset") else ""
        self._frame.say(level, f"{trip.action}: {said}{waits}", key="" if trip.latched else trip.cause)

    def _publishers(self) -> tuple[str, int]:
        """Full name of the commands' topic, remaps applied, and how many publish on it."""
        topic = self._frame.resolved(interface.VALVE_COMMAND.name)
        return topic, self._frame.node.count_publishers(topic)

    def _look_for_two(self) -> None:
        """Whether more than one node publishes commands."""
        topic, publishers = self._publishers()
        if publishers > 1:
            self.report(self.core.now, TWO_COMMANDERS, float(publishers), f"{publishers} publishers on {topic}")
        else:
            self.clear(TWO_COMMANDERS)

    def condition(self) -> tuple[int, str]:
        """Level and text of the present state."""
        with self.guard:
            self._look_for_two()
            return self.core.condition()

    def _enable(self, request: Any, response: Any) -> Any:
        with self.guard:
            blocked = request.data and self.core.waits_for_reset
            if not blocked:
                self.core.enable(request.data)
            response.success, response.message = not blocked, self.core.condition()[1]
        self._frame.say(WARN if blocked else OK, f"enable {request.data}: {response.message}")
        return response

    def _stop(self, _request: Any, response: Any) -> Any:
        with self.guard:
            self.core.stop(self.core.now)
            response.success, response.message = True, self.core.condition()[1]
        return response

    def _reset(self, _request: Any, response: Any) -> Any:
        with self.guard:
            self._look_for_two()
            self._before_reset()
            self._reference_stamp = -1
            self.clear("stale_reference")
            response.success, response.message = self.core.reset()
            if response.success:
                self._frame.diagnostics.clear()
        what = "reset" if response.success else "reset refused"
        self._frame.say(OK if response.success else WARN, f"{what}: {response.message}")
        return response


TOPICS = {
    "position": interface.JOINT_STATES,
    "acceleration": interface.IMU,
    "pressure_a": interface.PRESSURE_A,
    "pressure_b": interface.PRESSURE_B,
    "pressure_supply": interface.PRESSURE_SUPPLY,
}


class SensorWriters:
    """A writer for each sensor that is there."""

    def __init__(self, frame: Frame, present: Collection[str] = tuple(TOPICS)) -> None:
        self._writers = {name: frame.writer(topic) for name, topic in TOPICS.items() if name in present}

    def send(self, stamp: int, readings: Mapping[str, float]) -> None:
        """What the sensors say at `stamp` [ns]; one whose cable is off says NaN, and nothing is published."""
        for name, writer in self._writers.items():
            value = readings[name]
            if not math.isnan(value):
                writer.send(stamp, value)

    def declare_noise(self, sensors: SensorParameters) -> None:
        """What the messages say of the sensors' noise: variances [unit²]."""
        pressure = sensors.pressure_noise**2
        variances = dict.fromkeys(("pressure_a", "pressure_b", "pressure_supply"), pressure)
        variances["acceleration"] = sensors.acceleration_noise**2
        for name, writer in self._writers.items():
            writer.codec.variance = variances.get(name, 0.0)
