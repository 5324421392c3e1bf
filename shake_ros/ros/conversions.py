"""Numbers ↔ messages: every sampled topic carries a stamp and one to three numbers, `/clock` a stamp alone.

A sampled message has a fixed layout (CDR, little endian, one joint), so it is packed and unpacked with one
`struct` instead of through a message object, which saves 30 µs a message. Whatever has another layout
(another joint order, a frame, velocities) goes through the message object; the numbers are the same.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from builtin_interfaces.msg import Time
from rclpy.serialization import deserialize_message, serialize_message
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import FluidPressure, Imu, JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from shake_ros.core.quantities import ShakeError
from shake_ros.ros.interface import (
    CLOCK,
    ESTIMATE,
    IMU,
    JOINT_STATES,
    PRESSURE_A,
    PRESSURE_B,
    PRESSURE_SUPPLY,
    REFERENCE,
    TABLE_JOINT,
    TRUTH,
    VALVE_COMMAND,
    VALVE_JOINT,
    Topic,
)

SECOND = 1_000_000_000
ENCAPSULATION = b"\x00\x01\x00\x00"  # plain CDR, little endian
NOT_MEASURED = -1.0
Values = tuple[float, ...]


def time_message(stamp: int) -> Time:
    """Time message of a stamp [ns]."""
    return Time(sec=stamp // SECOND, nanosec=stamp % SECOND)


def _joint_index(names: list[str], joint: str, count: int) -> int:
    """Place of `joint` among the names of a message; a single unnamed or foreign-named joint is not guessed."""
    if joint not in names:
        raise ShakeError(f"joint '{joint}' is not among {names}")
    index = names.index(joint)
    if index >= count:
        raise ShakeError(f"joint '{joint}' has no value")
    return index


def _joint_state(joint: str) -> tuple[Callable[[Time, Values], Any], Callable[[Any], Values]]:
    def build(stamp: Time, values: Values) -> JointState:
        message = JointState(name=[joint], position=list(values))
        message.header.stamp = stamp
        return message

    def read(message: JointState) -> Values:
        return (message.position[_joint_index(message.name, joint, len(message.position))],)

    return build, read


def _trajectory(stamp: Time, values: Values) -> JointTrajectory:
    position, velocity, acceleration = values
    point = JointTrajectoryPoint(positions=[position], velocities=[velocity], accelerations=[acceleration])
    message = JointTrajectory(joint_names=[TABLE_JOINT], points=[point])
    message.header.stamp = stamp
    return message


def _read_trajectory(message: JointTrajectory) -> Values:
    if len(message.points) != 1:
        raise ShakeError(f"{len(message.points)} points instead of 1")
    point = message.points[0]
    rows = (point.positions, point.velocities, point.accelerations)
    index = _joint_index(message.joint_names, TABLE_JOINT, min(len(row) for row in rows))
    return point.positions[index], point.velocities[index], point.accelerations[index]


def _imu(stamp: Time, values: Values) -> Imu:
    message = Imu()
    message.header.stamp = stamp
    message.orientation_covariance[0] = NOT_MEASURED
    message.angular_velocity_covariance[0] = NOT_MEASURED
    message.linear_acceleration.x = values[0]
    return message


def _pressure(stamp: Time, values: Values) -> FluidPressure:
    message = FluidPressure(fluid_pressure=values[0])
    message.header.stamp = stamp
    return message


# Layouts after the header (frame_id empty: length 1 and its zero, then alignment). `x` is padding, whose
# content is undefined on the wire; the constants are what a message must hold to be read this way.
HEADER = "<4s i I I s"
JOINT_LAYOUTS = {
    TABLE_JOINT: "3x I I 6s 2x I 4x d I I",
    VALVE_JOINT: "3x I I 12s I d I I",
}
TRAJECTORY_LAYOUT = "3x I I 6s 2x I I d I 4x d I 4x d I i I"


class Codec:
    """Packs and unpacks the messages of one topic.

    Parameters
    ----------
    build, read : numbers → message and message → numbers.
    form : struct format of the whole message with one stamp (i, I) after the encapsulation.
    constants : every field of `form` but the stamp; None stands for a number.
    size : how many numbers.
    """

    def __init__(
        self,
        topic: Topic,
        build: Callable[[Time, Values], Any],
        read: Callable[[Any], Values],
        form: str,
        constants: tuple[Any, ...],
        size: int,
    ) -> None:
        self.topic = topic
        self.build = build
        self.read = read
        self.size = size
        self._struct = struct.Struct(form)
        self._pattern: list[Any] = [ENCAPSULATION, 0, 0, *constants]
        self._places = [place for place, value in enumerate(self._pattern) if value is None]
        self._template = [0.0 if value is None else value for value in self._pattern]
        self.packed = self._agrees_with_middleware()

    def _agrees_with_middleware(self) -> bool:
        """Whether the middleware reads our packed form as the message that it stands for, and writes it alike."""
        values = tuple(1.5 + place for place in range(self.size))
        stamp = 3 * SECOND + 7
        try:
            message = deserialize_message(self.pack(stamp, values), self.topic.type)
            own = serialize_message(self.build(time_message(stamp), values))
        except Exception:  # any complaint of another middleware means: use message objects
            return False
        return message == self.build(time_message(stamp), values) and self._unpack(own) == (stamp, values)

    def pack(self, stamp: int, values: Values) -> bytes:
        """Serialised message of a stamp [ns] and its numbers."""
        fields = self._template.copy()
        fields[1], fields[2] = divmod(stamp, SECOND)
        for place, value in zip(self._places, values, strict=True):
            fields[place] = value
        return self._struct.pack(*fields)

    def encode(self, stamp: int, values: Values) -> Any:
        """What a publisher takes: bytes where the middleware agrees with them, else a message."""
        if self.packed:
            return self.pack(stamp, values)
        return self.build(time_message(stamp), values)

    def _unpack(self, data: bytes) -> tuple[int, Values] | None:
        """Stamp and numbers where `data` has this layout and its constants, else None."""
        if len(data) < self._struct.size:
            return None
        fields = list(self._struct.unpack_from(data))
        stamp = fields[1] * SECOND + fields[2]
        values = tuple([fields[place] for place in self._places])
        fields[1] = fields[2] = 0
        for place in self._places:
            fields[place] = None
        return (stamp, values) if fields == self._pattern else None

    def decode(self, data: bytes) -> tuple[int, Values]:
        """Stamp [ns] and numbers of a serialised message; raises ShakeError where it does not hold them."""
        found = self._unpack(data) if self.packed else None
        if found is not None:
            return found
        message = deserialize_message(data, self.topic.type)
        stamp = message.clock if self.topic is CLOCK else message.header.stamp
        try:
            return stamp.sec * SECOND + stamp.nanosec, self.read(message)
        except ShakeError as error:
            raise ShakeError(f"{self.topic.name}: {error}") from None


def _joint_codec(topic: Topic, joint: str) -> Codec:
    build, read = _joint_state(joint)
    name = joint.encode() + b"\x00"
    constants = (1, b"\x00", 1, len(name), name, 1, None, 0, 0)
    return Codec(topic, build, read, f"{HEADER} {JOINT_LAYOUTS[joint]}", constants, 1)


def _trajectory_codec(topic: Topic) -> Codec:
    name = TABLE_JOINT.encode() + b"\x00"
    constants = (1, b"\x00", 1, len(name), name, 1, 1, None, 1, None, 1, None, 0, 0, 0)
    return Codec(topic, _trajectory, _read_trajectory, f"{HEADER} {TRAJECTORY_LAYOUT}", constants, 3)


def _imu_codec(topic: Topic) -> Codec:
    zeros = (0.0,) * 8
    orientation = (0.0, 0.0, 0.0, 1.0, NOT_MEASURED, *zeros)
    angular = (0.0, 0.0, 0.0, NOT_MEASURED, *zeros)
    constants = (1, b"\x00", *orientation, *angular, None, 0.0, 0.0, 0.0, *zeros)
    return Codec(topic, _imu, lambda m: (m.linear_acceleration.x,), f"{HEADER} 3x 37d", constants, 1)


def _pressure_codec(topic: Topic) -> Codec:
    return Codec(topic, _pressure, lambda m: (m.fluid_pressure,), f"{HEADER} 3x d d", (1, b"\x00", None, 0.0), 1)


def _clock_codec(topic: Topic) -> Codec:
    return Codec(topic, lambda stamp, _: Clock(clock=stamp), lambda _: (), "<4s i I", (), 0)


@dataclass(frozen=True)
class _Family:
    """Topics that share a way of packing."""

    topics: tuple[Topic, ...]
    make: Callable[[Topic], Codec]


_FAMILIES = (
    _Family((JOINT_STATES,), lambda topic: _joint_codec(topic, TABLE_JOINT)),
    _Family((VALVE_COMMAND,), lambda topic: _joint_codec(topic, VALVE_JOINT)),
    _Family((REFERENCE, ESTIMATE, TRUTH), _trajectory_codec),
    _Family((IMU,), _imu_codec),
    _Family((PRESSURE_A, PRESSURE_B, PRESSURE_SUPPLY), _pressure_codec),
    _Family((CLOCK,), _clock_codec),
)


def codec(topic: Topic) -> Codec:
    """The codec of a sampled topic or `/clock`."""
    for family in _FAMILIES:
        if topic in family.topics:
            return family.make(topic)
    raise ShakeError(f"{topic.name} is not a sampled topic")
