"""Node `faults`: sits between a writer and its readers and passes on what its faults leave of the samples.

The writer is started with its topic remapped (`-r valve_command:=healthy/valve_command`); this node reads
`healthy/valve_command` and writes `valve_command`, so that nobody else is changed.
"""

from __future__ import annotations

from dataclasses import dataclass

from rclpy.serialization import serialize_message

from shake_ros.quantities import Parameters, ShakeError, choice, quantity, unknown_name
from shake_ros.ros.conversions import codec
from shake_ros.ros.diagnostics import OK, WARN, Input
from shake_ros.ros.frame import Behaviour, Frame
from shake_ros.ros.interface import TOPICS, Topic
from shake_ros.safety.faults import MessageFaultParameters, MessageFaults

HEALTHY = "healthy/"


@dataclass(frozen=True)
class FaultsNodeParameters(Parameters):
    """The node's own settings; each topic adds its faults as TOPIC.NAME."""

    topics: str = choice("names of sampled topics, separated by blanks")
    seed: int = quantity("-", "seed of the random faults", low=0, high=2**31 - 1)


def parse_topics(text: str) -> list[Topic]:
    """The topics that are named; raises ShakeError for none, an unknown one, one named twice, or one not sampled.

    >>> [topic.name for topic in parse_topics("joint_states imu")]
    ['joint_states', 'imu']
    """
    sampled = [topic.name for topic in TOPICS.values() if topic.sampled]
    names = text.split()
    if not names:
        raise ShakeError(f"topics = '{text}': name at least one of {', '.join(sampled)}")
    for name in names:
        if name not in sampled:
            raise unknown_name("sampled topic", name, sampled, "topics")
        if names.count(name) > 1:
            raise ShakeError(f"topics: '{name}' is named twice")
    return [TOPICS[name] for name in names]


class PassedTopic:
    """One topic: from `healthy/NAME` to `NAME`."""

    def __init__(self, frame: Frame, topic: Topic, seed: int) -> None:
        self.topic = topic
        self.passed = 0
        self._frame = frame
        self._codec = codec(topic)
        self._live = frame.parameters.declare(MessageFaultParameters(), f"{topic.name}.")
        self._faults = MessageFaults(seed)
        self._faults.apply(self._live.take())
        self._input = frame.diagnostics.inputs[HEALTHY + topic.name] = Input(HEALTHY + topic.name, frame.period)
        self._publisher = frame.publisher(topic)
        self._subscription = frame.subscription(topic, self._arrived, HEALTHY + topic.name)
        frame.diagnostics.values |= {f"{topic.name}.passed": lambda: self.passed, f"{topic.name}.faults": self.said}

    def said(self) -> str:
        """The faults that are on, in words."""
        return " ".join(f"{name}={value:g}" for name, value in self._faults.parameters.on().items())

    def _arrived(self, data: bytes) -> None:
        try:
            stamp, values = self._codec.decode(data)
        except ShakeError:
            return self._send(data)  # what cannot be read is not ours to judge
        self._input.count(stamp)
        if self._live.changed:
            self._change(stamp)
        self._frame.diagnostics.cycles += 1
        for sample in self._faults.carry(stamp, values):
            self._send(self._packed(*sample))
        return None

    def _packed(self, stamp: int, values: tuple[float, ...]) -> bytes:
        found = self._codec.encode(stamp, values)
        return found if self._codec.packed else serialize_message(found)

    def _send(self, data: bytes) -> None:
        self._publisher.publish(data)
        self.passed += 1

    def _change(self, stamp: int) -> None:
        """Other faults from the sample of this stamp on; said at once, so that a recording has it."""
        self._faults.apply(self._live.take())
        text = self.said() or "none"
        values: dict[str, object] = {"time_ns": stamp, "topic": self.topic.name, "faults": text}
        self._frame.diagnostics.event("fault", WARN, f"{self.topic.name}: {text}", values)


class FaultsNode(Behaviour):
    """The channels that are named."""

    def __init__(self, frame: Frame) -> None:
        super().__init__(frame)
        if frame.lockstep:
            raise ShakeError("lockstep = true: lock-step waits for every sample and cannot lose one; real time only")
        own = frame.settings(FaultsNodeParameters).value
        self._channels = [PassedTopic(frame, topic, own.seed + k) for k, topic in enumerate(parse_topics(own.topics))]
        frame.diagnostics.condition = self._condition

    def _condition(self) -> tuple[int, str]:
        on = [f"{channel.topic.name}: {said}" for channel in self._channels if (said := channel.said())]
        return (WARN, f"faults on {'; '.join(on)}") if on else (OK, "passes everything on")


build = FaultsNode
