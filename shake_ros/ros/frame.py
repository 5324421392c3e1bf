"""What every node is made of: the rclpy node, its parameter sets, its place on /diagnostics, writers and readers.

Samples are packed, counted, and refused where they are none; work that need not be done at once waits for the pause
between the answer to one sample and the next.
"""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

from rclpy.clock import Clock as RclpyClock
from rclpy.clock_type import ClockType
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription

from shake_ros.quantities import Parameters, ShakeError, choice, quantity, unknown_name
from shake_ros.realtime import RealtimeParameters
from shake_ros.ros.conversions import SECOND, OtherJointError, codec
from shake_ros.ros.diagnostics import ERROR, OK, WARN, Diagnostics, Input
from shake_ros.ros.exclusive_writer import ExclusiveWriter
from shake_ros.ros.interface import CLOCK, CLOCK_QOS, DIAGNOSTICS, NAMESPACE, TOPICS, Topic, overriding
from shake_ros.ros.parameters import LiveSet, NodeParameters
from shake_ros.settings import find, read_yaml


class Pause:
    """What a node puts off while samples come.

    A report on /diagnostics takes half a period; in the middle of the way from a sample to its command it makes that
    command late.

    >>> pause = Pause()
    >>> pause.put_off(lambda: print("at once, no sample has come"))
    at once, no sample has come
    >>> pause.begins()
    >>> pause.put_off(lambda: print("after the next sample"))
    >>> pause.begins()
    after the next sample
    """

    def __init__(self) -> None:
        self._answered = False  # since something was last put off
        self._waiting: list[Callable[[], None]] = []

    def put_off(self, act: Callable[[], None]) -> None:
        """Do it in the next pause; at once where no sample has been answered since this was last called."""
        if self._answered:
            self._waiting.append(act)
        else:
            self._do_all()
            act()
        self._answered = False

    def begins(self) -> None:
        """A sample has been answered."""
        self._answered = True
        if self._waiting:
            self._do_all()

    def _do_all(self) -> None:
        waiting, self._waiting = self._waiting, []
        for act in waiting:
            act()


AGAIN = 1e-4  # pause before a message is offered again [s]; at SCHED_FIFO the reader would never run without it
BLOCKED = 30.0  # a reader that takes nothing for this long [s] has hung


def insist(publish: Callable[[Any], object], data: Any, ended: Callable[[], bool], name: str) -> None:
    """Offer a message of a topic until its readers have room for it, or until `ended`."""
    give_up = time.monotonic() + BLOCKED
    while not ended():
        try:
            publish(data)
        except RuntimeError:
            if time.monotonic() > give_up:
                raise RuntimeError(f"{name}: a reader has taken no sample for {BLOCKED:g} s") from None
            time.sleep(AGAIN)
        else:
            return


class Writer:
    """Publishes the samples of one topic."""

    def __init__(self, frame: Frame, topic: Topic) -> None:
        self.publisher = frame.publisher(topic)
        self._frame = frame
        self._topic = topic
        packer = self.codec = codec(topic)
        self._encode = packer.encode
        # what `publish` does with bytes, without its checks
        self._publish = self.publisher.handle.publish_raw if packer.packed else self.publisher.publish

    def send(self, stamp: int, *values: float) -> None:
        """Publish a sample; where a lock-step reader is behind, wait for it."""
        data = self._encode(stamp, values)
        try:
            self._publish(data)
        except RuntimeError:
            frame = self._frame
            insist(self._publish, data, lambda: frame.stopping or not frame.node.context.ok(), self._topic.name)


class Reader:
    """Takes the samples of one topic, counts them and passes on what is whole.

    Parameters
    ----------
    accept : called with (stamp [ns], *numbers).
    refuse : called with (stamp, reason) for NaN, infinity, unreadable and unstamped messages; −1 where unknown.
    doubled : called with the stamp of a message that is not newer than the one before.
    profile : quality of service, where it is not the topic's.
    """

    def __init__(
        self,
        frame: Frame,
        topic: Topic,
        accept: Callable[..., None],
        refuse: Callable[[int, str], None] | None = None,
        doubled: Callable[[int], None] | None = None,
        profile: QoSProfile | None = None,
    ) -> None:
        self.input = Input(topic.name, frame.period)
        frame.diagnostics.inputs[topic.name] = self.input
        self._frame = frame
        self._topic = topic
        self._accept = accept
        self._refuse = refuse
        self._doubled = doubled
        self.codec = codec(topic)
        self._decode = self.codec.decode
        self.subscription = frame.subscription(topic, self._arrived, profile=profile)

    def _arrived(self, data: bytes) -> None:
        try:
            stamp, values = self._decode(data)
        except OtherJointError as error:
            self.input.others += 1
            return self._frame.say(OK, f"{error}: left out", key=self._topic.name)
        except ShakeError as error:
            return self._refused(-1, str(error))
        if stamp <= 0:
            return self._refused(stamp, f"{self._topic.name}: no stamp (header.stamp is 0), refused")
        if not self.input.count(stamp):
            if self._doubled is not None:
                self._doubled(stamp)
            return None
        for value in values:
            if not math.isfinite(value):
                return self._refused(stamp, f"{self._topic.name}: {value} at {stamp * 1e-9:.6f} s refused")
        return self._accept(stamp, *values)

    def _refused(self, stamp: int, reason: str) -> None:
        self.input.refused += 1
        self._frame.say(ERROR, reason, key=self._topic.name)
        if self._refuse is not None:
            self._refuse(stamp, reason)

    def take(self) -> int:
        """Take all that has come, without waiting; returns when the newest arrived [ns, wall clock], 0 if nothing."""
        arrived = 0
        for data, at in taken(self.subscription):
            arrived = at
            self._arrived(data)
        return arrived


def taken(subscription: Any) -> Iterator[tuple[bytes, int]]:
    """All that has come to a subscription and was not yet served, with the time of arrival [ns, wall clock]."""
    handle = subscription.handle
    with handle:
        while (one := handle.take_message(subscription.msg_type, True)) is not None:
            data, info = one
            yield data, info["received_timestamp"]


P = TypeVar("P", bound=Parameters)
FIRST_STAMP = SECOND  # lock-step time of sample 0 [ns]; zero would read as "no stamp"
QUIET = 1.0  # lines of one key on the console are at least this far apart [s]
SHARED = (DIAGNOSTICS, CLOCK)  # written by several nodes, of several graphs
DELIVERY = 5.0  # at the end, readers get so long [s] to take what was sent


@dataclass(frozen=True)
class LoopParameters(Parameters):
    """How a node runs."""

    lockstep: bool = quantity("", "step by stamps instead of by the wall clock")
    rate: float = quantity("Hz", "sampling rate", low=1.0, high=10000.0)
    wait_for: str = choice("start when these topics have so many readers, e.g. 'joint_states:3 estimate:1'")
    wait_for_writers: str = choice("start when these topics have so many writers, e.g. 'reference:1'")


def parse_wait_for(text: str) -> dict[str, int]:
    """Topic → number of readers or writers to wait for.

    >>> parse_wait_for("joint_states:3 estimate:1")
    {'joint_states': 3, 'estimate': 1}
    """
    counts: dict[str, int] = {}
    for item in text.split():
        name, _, number = item.partition(":")
        if name not in TOPICS:
            raise unknown_name("topic", name, TOPICS, "wait_for")
        if not number.isdigit():
            raise ShakeError(f"wait_for: '{item}' is not topic:count")
        counts[name] = int(number)
    return counts


class Behaviour:
    """What a node does, in its frame. The loop calls `start` once, then `tick` in real time where the node ticks.

    Here is what a node that only answers to messages does: nothing of its own.
    """

    ticks = False

    def __init__(self, frame: Frame) -> None:
        self.frame = frame

    def start(self) -> None:
        """First act, after the awaited readers are there; subscriptions may call in earlier."""

    def tick(self, stamp: int, steps: int) -> None:
        """One period of real time: `stamp` [ns] and how many periods passed since the last (1 unless late)."""

    def finish(self) -> None:
        """Last act before the node goes down."""


class Frame:
    """One node: built before its behaviour, which fills it with parameter sets, writers and readers.

    Parameters
    ----------
    name : executable and default node name.
    context : of rclpy.
    arguments : ROS arguments of this node alone; None takes those of the process.
    """

    def __init__(self, name: str, context: Context, arguments: Sequence[str] | None = None) -> None:
        self.name = name
        self.node = Node(
            name,
            namespace=NAMESPACE,
            context=context,
            cli_args=None if arguments is None else list(arguments),
            use_global_arguments=arguments is None,
        )
        self.exclusive = ExclusiveWriter(context.get_domain_id())
        context.on_shutdown(self.exclusive.give_up)  # also where the node could not be built
        self.exclusive.take("node", self.node.get_fully_qualified_name())
        self.parameters = NodeParameters(self.node)
        self.realtime = self.settings(RealtimeParameters, "realtime", file="common").value
        self.loop = self.settings(LoopParameters, file="common").value
        self.lockstep = self.loop.lockstep
        self.simulated = self.node.get_parameter("use_sim_time").value is True
        self.period = round(SECOND / self.loop.rate)
        self.diagnostics = Diagnostics(self.node, name, self.lockstep, self.period, self.publisher(DIAGNOSTICS))
        self.stopping = False
        self.stop_loop: Callable[[], None] = lambda: None
        self._readers = parse_wait_for(self.loop.wait_for)
        self._sources = parse_wait_for(self.loop.wait_for_writers)
        self.start_line = ""
        self._writers: list[Writer] = []
        self._said: dict[str, float] = {}  # key of a line → when it was last said
        self.pause = Pause()

    def settings(self, kind: type[P], section: str = "", *, file: str = "") -> LiveSet[P]:
        """Declare what config/node/<name>.yaml holds: one of its sections, or all that stands outside of them."""
        path = find("node", file or self.name)
        content = read_yaml(path)
        if not isinstance(content, dict):
            raise ShakeError(f"{path}: expected names and values")
        sections = {name: content.pop(name) for name in list(content) if isinstance(content[name], dict)}
        if not section:
            declared = self.parameters.declare(kind.from_mapping(content, str(path)))
            if not file:
                self.start_line = self._start_line(declared.value)
            return declared
        found = kind.from_mapping(sections.get(section, {}), f"{path}: {section}")
        return self.parameters.declare(found, f"{section}.")

    def _start_line(self, own: Parameters) -> str:
        """What a node is configured as, how it runs, what it waits for."""
        configured = [
            f"{name} '{value}'" for name, value in dataclasses.asdict(own).items() if isinstance(value, str) and value
        ]
        mode = "lock-step" if self.lockstep else "real time"
        awaited = " and ".join(
            f"{what} of {text}"
            for what, text in (("readers", self.loop.wait_for), ("writers", self.loop.wait_for_writers))
            if text
        )
        line = ", ".join([*configured, mode, f"{self.loop.rate:g} Hz"])
        return f"starting: {line}{'; waits for ' if awaited else ''}{awaited}"

    @property
    def sample_time(self) -> float:
        """Sampling period [s]."""
        return self.period / SECOND

    def sample(self, stamp: int) -> int:
        """Number of the sample at a lock-step stamp [ns]."""
        return round((stamp - FIRST_STAMP) / self.period)

    def publisher(self, topic: Topic) -> Publisher[Any]:
        """A publisher on a topic, whose quality of service `qos_overrides` may change.

        The only one on this machine, but on what every graph writes: see `ExclusiveWriter`.
        """
        if topic not in SHARED:
            self.exclusive.take("topic", self.resolved(topic.name))
        profile = topic.qos(self.lockstep)
        options = overriding(topic, self.lockstep)
        return self.node.create_publisher(topic.type, topic.name, profile, qos_overriding_options=options)

    def subscription(
        self, topic: Topic, arrived: Callable[[bytes], None], name: str = "", profile: QoSProfile | None = None
    ) -> Subscription[Any]:
        """A subscription for serialised messages on a topic, or with its type on another, likewise."""
        chosen = profile or topic.qos(self.lockstep)
        options = overriding(topic, self.lockstep)
        return self.node.create_subscription(
            topic.type, name or topic.name, arrived, chosen, raw=True, qos_overriding_options=options
        )

    def writer(self, topic: Topic) -> Writer:
        """A writer of a sampled topic."""
        writer = Writer(self, topic)
        self._writers.append(writer)
        return writer

    def resolved(self, topic: str) -> str:
        """Full name of a topic, its remaps applied."""
        return str(self.node.resolve_topic_name(topic))

    def say(self, level: int, text: str, key: str = "") -> None:
        """A line on the console, INFO, WARN or ERROR; what has the same key at most once in QUIET seconds."""
        now = time.monotonic()
        if key and now - self._said.get(key, -QUIET) < QUIET:
            return
        self._said[key] = now
        log = self.node.get_logger()
        if level == ERROR:  # rclpy wants one level a line
            log.error(text)
        elif level == WARN:
            log.warning(text)
        else:
            log.info(text)

    def now(self) -> int:
        """The clock on which real-time stamps lie [ns]: the wall's, or with `use_sim_time` that of /clock."""
        return int(self.node.get_clock().now().nanoseconds) if self.simulated else time.time_ns()

    def follow_clock(self, tick: Callable[[int, int], None]) -> None:
        """With `use_sim_time`: tick by /clock, a period after the other; anew where it goes back."""
        first = last = -1

        def heard(message: Any) -> None:
            nonlocal first, last
            now = message.clock.sec * SECOND + message.clock.nanosec
            if first < 0 or now < first + last * self.period:
                first, last = now, -1
            count = (now - first) // self.period
            if count > last:
                tick(first + count * self.period, count - last)
                last = count

        self.node.create_subscription(CLOCK.type, CLOCK.name, heard, CLOCK_QOS)

    def every(self, seconds: float, act: Callable[[], None]) -> None:
        """Call again and again by the machine's clock, whatever the time of /clock."""
        self.node.create_timer(seconds, act, clock=RclpyClock(clock_type=ClockType.STEADY_TIME))

    def ready(self) -> bool:
        """Whether every awaited topic has its readers and writers."""
        node = self.node
        return all(node.count_subscribers(self.resolved(topic)) >= n for topic, n in self._readers.items()) and all(
            node.count_publishers(self.resolved(topic)) >= n for topic, n in self._sources.items()
        )

    def stop(self) -> None:
        """Ask the loop to end this node; safe inside callbacks."""
        self.stopping = True
        self.stop_loop()

    def close(self) -> None:
        """Wait until lock-step readers have what was sent, then destroy the node."""
        try:
            if self.lockstep and self.node.context.ok():
                deadline = time.monotonic() + DELIVERY
                for writer in self._writers:
                    left = max(0.0, deadline - time.monotonic())
                    writer.publisher.wait_for_all_acked(Duration(seconds=left))
        except RuntimeError:
            pass
        self.node.destroy_node()
        self.exclusive.give_up()
