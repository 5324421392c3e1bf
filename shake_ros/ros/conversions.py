"""Numbers ↔ messages: every sampled topic carries a stamp and one to three numbers, `/clock` a stamp alone.

A sampled message has a fixed layout (CDR, little endian, one joint), so it is packed and unpacked with one
`struct` instead of through a message object, which saves 30 µs a message. Whatever has another layout
(another joint order, another frame, velocities) goes through the message object; the numbers are the same.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any

from builtin_interfaces.msg import Duration, Time
from rclpy.serialization import deserialize_message, serialize_message
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import FluidPressure, Imu, JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from shake_ros.quantities import ShakeError
from shake_ros.ros.interface import CLOCK, TABLE_JOINT, VALVE_COMMAND, VALVE_JOINT, Topic

SECOND = 1_000_000_000
ENCAPSULATION = b"\x00\x01\x00\x00"  # plain CDR, little endian
NOT_MEASURED = -1.0
Values = tuple[float, ...]


def time_message(stamp: int) -> Time:
    """Time message of a stamp [ns]."""
    return Time(sec=stamp // SECOND, nanosec=stamp % SECOND)


class OtherJointError(ShakeError):
    """A message of other joints, which a shared topic carries as well: not for its reader, and no fault."""


def _joint_index(names: list[str], joint: str, count: int) -> int:
    """Place of `joint` among the names of a message; a single unnamed or foreign-named joint is not guessed."""
    if joint not in names:
        raise OtherJointError(f"joint '{joint}' is not among {names}")
    index = names.index(joint)
    if index >= count:
        raise ShakeError(f"joint '{joint}' has no value")
    return index


def _read_joint(message: JointState, joint: str) -> Values:
    return (message.position[_joint_index(message.name, joint, len(message.position))],)


def _trajectory(values: Values, _: float) -> JointTrajectory:
    position, velocity, acceleration = values
    point = JointTrajectoryPoint(positions=[position], velocities=[velocity], accelerations=[acceleration])
    return JointTrajectory(joint_names=[TABLE_JOINT], points=[point])


def _read_trajectory(message: JointTrajectory) -> Values:
    if len(message.points) != 1:
        raise ShakeError(f"{len(message.points)} points instead of 1")
    point = message.points[0]
    rows = (point.positions, point.velocities, point.accelerations)
    index = _joint_index(message.joint_names, TABLE_JOINT, min(len(row) for row in rows))
    return point.positions[index], point.velocities[index], point.accelerations[index]


def _imu(values: Values, variance: float) -> Imu:
    message = Imu()
    message.orientation_covariance[0] = NOT_MEASURED
    message.angular_velocity_covariance[0] = NOT_MEASURED
    message.linear_acceleration.x = values[0]
    message.linear_acceleration_covariance[0] = variance
    return message


def _read_imu(message: Imu) -> Values:
    felt = message.linear_acceleration.x
    if message.linear_acceleration_covariance[0] == NOT_MEASURED and felt == 0.0:
        raise ShakeError("no acceleration is measured (covariance −1)")
    return (felt,)


# What stands in a message behind the stamp: struct codes with what they must hold to be read this way; NUMBER stands
# for one of the sample's, VARIANCE for that of the sensor, which a reader does not ask for, LEAD and LEAD_REST for the
# seconds and nanoseconds of `time_from_start`.
NUMBER, VARIANCE, LEAD, LEAD_REST = object(), object(), object(), object()
Parts = list[tuple[str, Any]]
ALIGNMENT = {"I": 4, "i": 4, "d": 8, "s": 1}


def _text(text: str) -> Parts:
    data = text.encode() + b"\x00"
    return [("I", len(data)), (f"{len(data)}s", data)]


def _aligned(parts: Parts) -> str:
    """Struct format with the padding of CDR, whose content is undefined on the wire.

    >>> _aligned([("i", 0), *_text("table"), ("d", 0.0)])
    '<4s i I 6s 2x d'
    """
    form, offset = ["<4s"], 0
    for code, _ in parts:
        padding = -offset % ALIGNMENT[code[-1]]
        form += [f"{padding}x", code] if padding else [code]
        offset += padding + struct.calcsize(f"<{code}")
    return " ".join(form)


class Codec:
    """Packs and unpacks the messages of one topic.

    Parameters
    ----------
    build : numbers and variance → message, without its header.
    read : message → numbers.
    parts : what stands behind the stamp.
    """

    def __init__(
        self, topic: Topic, build: Callable[[Values, float], Any], read: Callable[[Any], Values], parts: Parts
    ) -> None:
        self.topic = topic
        self._read = read
        self.variance = 0.0  # of the sensor's noise [unit²], where the message has a place for it; 0: unknown
        # by which the motion of a trajectory's point is later than the stamp [ns]; of the last message that was read
        self.lead = 0
        self._build = build
        stamped: Parts = [("i", 0), ("I", 0), *parts]
        self._struct = struct.Struct(_aligned(stamped))
        self._pattern: list[Any] = [ENCAPSULATION, *(value for _, value in stamped)]
        self._places = [place for place, value in enumerate(self._pattern) if value is NUMBER]
        self.size = len(self._places)  # how many numbers
        self._variances = [place for place, value in enumerate(self._pattern) if value is VARIANCE]
        self._lead_at = self._pattern.index(LEAD) if LEAD in self._pattern else 0
        self._template = [0.0 if value in (NUMBER, VARIANCE) else value for value in self._pattern]
        self.packed = self._agrees_with_middleware()

    def build(self, stamp: int, values: Values) -> Any:
        """The message of a stamp [ns] and its numbers."""
        message = self._build(values, self.variance)
        if self._lead_at:
            message.points[0].time_from_start = Duration(sec=self.lead // SECOND, nanosec=self.lead % SECOND)
        if self.topic is CLOCK:
            message.clock = time_message(stamp)
        else:
            message.header.stamp, message.header.frame_id = time_message(stamp), self.topic.frame
        return message

    def _agrees_with_middleware(self) -> bool:
        """Whether the middleware reads our packed form as the same message, and writes it alike."""
        values = tuple(1.5 + place for place in range(self.size))
        stamp = 3 * SECOND + 7
        try:
            built = self.build(stamp, values)
            agrees = deserialize_message(self.pack(stamp, values), self.topic.type) == built
            return bool(agrees) and self._unpack(serialize_message(built)) == (stamp, values)
        except Exception:  # any complaint of another middleware means: use message objects
            return False

    def pack(self, stamp: int, values: Values) -> bytes:
        """Serialised message of a stamp [ns] and its numbers."""
        fields = self._template.copy()
        fields[1], fields[2] = divmod(stamp, SECOND)
        for place, value in zip(self._places, values, strict=True):
            fields[place] = value
        for place in self._variances:
            fields[place] = self.variance
        if self._lead_at:
            fields[self._lead_at : self._lead_at + 2] = divmod(self.lead, SECOND)
        return self._struct.pack(*fields)

    def encode(self, stamp: int, values: Values) -> Any:
        """What a publisher takes: bytes where the middleware agrees with them, else a message."""
        return self.pack(stamp, values) if self.packed else self.build(stamp, values)

    def _unpack(self, data: bytes) -> tuple[int, Values] | None:
        """Stamp and numbers where `data` has this layout and its constants, else None."""
        if len(data) < self._struct.size:
            return None
        fields = list(self._struct.unpack_from(data))
        stamp = fields[1] * SECOND + fields[2]
        values = tuple([fields[place] for place in self._places])
        fields[1] = fields[2] = 0
        for place in self._places:
            fields[place] = NUMBER
        for place in self._variances:
            fields[place] = VARIANCE if fields[place] != NOT_MEASURED else None
        if self._lead_at:
            seconds, rest = fields[self._lead_at : self._lead_at + 2]
            fields[self._lead_at : self._lead_at + 2] = LEAD, LEAD_REST
            if fields == self._pattern:
                self.lead = seconds * SECOND + rest
        return (stamp, values) if fields == self._pattern else None

    def decode(self, data: bytes) -> tuple[int, Values]:
        """Stamp [ns] and numbers of a serialised message; raises ShakeError where it does not hold them."""
        found = self._unpack(data) if self.packed else None
        if found is not None:
            return found
        message = deserialize_message(data, self.topic.type)
        stamp = message.clock if self.topic is CLOCK else message.header.stamp
        try:
            values = self._read(message)
        except ShakeError as error:
            raise type(error)(f"{self.topic.name}: {error}") from None
        if self._lead_at:
            later = message.points[0].time_from_start
            self.lead = later.sec * SECOND + later.nanosec
        return stamp.sec * SECOND + stamp.nanosec, values


UNMEASURED = (NOT_MEASURED, *(0.0,) * 8)  # a covariance
IMU_NUMBERS = (
    *(0.0, 0.0, 0.0, 1.0, *UNMEASURED),  # orientation
    *(0.0, 0.0, 0.0, *UNMEASURED),  # angular velocity
    *(NUMBER, 0.0, 0.0, VARIANCE, *(0.0,) * 8),  # acceleration
)


def codec(topic: Topic) -> Codec:
    """The codec of a sampled topic or `/clock`."""
    parts = _text(topic.frame)
    if topic.type is JointState:
        joint = VALVE_JOINT if topic is VALVE_COMMAND else TABLE_JOINT
        parts += [("I", 1), *_text(joint), ("I", 1), ("d", NUMBER), ("I", 0), ("I", 0)]
        return Codec(
            topic,
            lambda values, _: JointState(name=[joint], position=list(values)),
            lambda message: _read_joint(message, joint),
            parts,
        )
    if topic.type is JointTrajectory:
        parts += [("I", 1), *_text(TABLE_JOINT), ("I", 1)]
        parts += [("I", 1), ("d", NUMBER)] * 3 + [("I", 0), ("i", LEAD), ("I", LEAD_REST)]
        return Codec(topic, _trajectory, _read_trajectory, parts)
    if topic.type is Imu:
        return Codec(topic, _imu, _read_imu, [*parts, *(("d", number) for number in IMU_NUMBERS)])
    if topic.type is FluidPressure:
        return Codec(
            topic,
            lambda values, variance: FluidPressure(fluid_pressure=values[0], variance=variance),
            lambda message: (message.fluid_pressure,),
            [*parts, ("d", NUMBER), ("d", VARIANCE)],
        )
    if topic.type is Clock:
        return Codec(topic, lambda *_: Clock(), lambda _: (), [])
    raise ShakeError(f"{topic.name} is not a sampled topic")
