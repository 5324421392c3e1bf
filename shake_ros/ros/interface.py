"""Every topic and service: name, type and quality of service. One page per topic stands in msg_docs/.

All names but `/clock` and `/diagnostics` are relative; the nodes' default namespace is `NAMESPACE`.
"""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import SetParametersResult
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import FluidPressure, Imu, JointState
from std_msgs.msg import Float64MultiArray, Header
from std_srvs.srv import SetBool, Trigger
from trajectory_msgs.msg import JointTrajectory

NAMESPACE = "/shake"
# Frames, with the axes of REP 103: x along the travel, positive where chamber A pushes, z up; zero in mid-stroke.
GROUND, TABLE = "ground", "table"
TABLE_JOINT = "table"
VALVE_JOINT = "servo_valve"

# Profiles of rclpy are reliable, volatile and keep the last messages, but for what stands here.
# Lock-step: nothing may be lost, whatever the order of discovery and the speed of the machine. Both sides keep
# everything, so a slow reader holds the writer back; transient local serves the reader that is matched late.
LOCKSTEP_QOS = QoSProfile(history=HistoryPolicy.KEEP_ALL, durability=DurabilityPolicy.TRANSIENT_LOCAL)
# Real time: no reader may hold a writer back. A reader that falls more than a second behind loses samples,
# which shows as a gap in the stamps.
REALTIME_QOS = QoSProfile(depth=1000)
# A recorder or player in real time takes everything that a writer still has.
REALTIME_RECORDER_QOS = QoSProfile(history=HistoryPolicy.KEEP_ALL)
EVENT_QOS = QoSProfile(depth=10)
CLOCK_QOS = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)  # whoever writes it, reliably or not
LOSSLESS = LOCKSTEP_QOS.history, LOCKSTEP_QOS.reliability


@dataclass(frozen=True)
class Topic:
    """A topic: its name, message type, whether it carries one message a sample (else: now and then), and its frame."""

    name: str
    type: Any
    sampled: bool = True
    frame: str = GROUND

    def qos(self, lockstep: bool) -> QoSProfile:
        """Quality of service of writers and readers in lock-step or in real time."""
        if not self.sampled:
            return copied(EVENT_QOS)
        return copied(LOCKSTEP_QOS if lockstep else REALTIME_QOS)


def copied(profile: QoSProfile) -> QoSProfile:
    """A profile of one's own: rclpy writes overrides into the one that it is given."""
    names = ("history", "depth", "reliability", "durability")
    return QoSProfile(**{name: getattr(profile, name) for name in names})


def overriding(topic: Topic, lockstep: bool) -> QoSOverridingOptions:
    """What `qos_overrides` may change: in lock-step nothing that would let a sample get lost."""

    def accepted(profile: QoSProfile) -> SetParametersResult:
        lossy = lockstep and topic.sampled and (profile.history, profile.reliability) != LOSSLESS
        reason = f"qos_overrides: in lock-step {topic.name} is reliable and keeps all" if lossy else ""
        return SetParametersResult(successful=not lossy, reason=reason)

    return QoSOverridingOptions.with_default_policies(callback=accepted)


JOINT_STATES = Topic("joint_states", JointState)
IMU = Topic("imu", Imu, frame=TABLE)
PRESSURE_A = Topic("pressure_a", FluidPressure)
PRESSURE_B = Topic("pressure_b", FluidPressure)
PRESSURE_SUPPLY = Topic("pressure_supply", FluidPressure)
VALVE_COMMAND = Topic("valve_command", JointState)
REFERENCE = Topic("reference", JointTrajectory)
ESTIMATE = Topic("estimate", JointTrajectory)
TRUTH = Topic("truth", JointTrajectory)
THD = Topic("thd", DiagnosticArray, sampled=False)
HARMONICS = Topic("harmonics", Float64MultiArray, sampled=False)
TWIN = Topic("twin", DiagnosticArray, sampled=False)
PREDICTED_JOINT_STATES = Topic("predicted_joint_states", JointState)
PREDICTED_IMU = Topic("predicted_imu", Imu, frame=TABLE)
OPERATOR = Topic("operator", Header, sampled=False)
DIAGNOSTICS = Topic("/diagnostics", DiagnosticArray, sampled=False)
CLOCK = Topic("/clock", Clock, sampled=False)

TOPICS: dict[str, Topic] = {
    topic.name: topic
    for topic in (
        JOINT_STATES,
        IMU,
        PRESSURE_A,
        PRESSURE_B,
        PRESSURE_SUPPLY,
        VALVE_COMMAND,
        REFERENCE,
        ESTIMATE,
        TRUTH,
        THD,
        HARMONICS,
        TWIN,
        PREDICTED_JOINT_STATES,
        PREDICTED_IMU,
        OPERATOR,
        DIAGNOSTICS,
        CLOCK,
    )
}


@dataclass(frozen=True)
class Service:
    """A service: its name and type."""

    name: str
    type: Any


ENABLE = Service("enable", SetBool)
STOP = Service("stop", Trigger)
RESET = Service("reset", Trigger)
SERVICES: dict[str, Service] = {service.name: service for service in (ENABLE, STOP, RESET)}


def interface_class(name: str) -> Any:
    """The class of a type such as sensor_msgs/msg/Imu or std_srvs/srv/Trigger; None where its package is missing.

    >>> interface_class("std_srvs/srv/Trigger").__name__, interface_class("nowhere/msg/Thing")
    ('Trigger', None)
    """
    package, *folder, kind = name.split("/")
    try:
        return getattr(importlib.import_module(f"{package}.{folder[0] if folder else 'msg'}"), kind)
    except (ImportError, AttributeError, ValueError):
        return None


def type_name(kind: Any) -> str:
    """The name of a message's or service's class, such as sensor_msgs/msg/Imu.

    >>> type_name(Trigger)
    'std_srvs/srv/Trigger'
    """
    package, folder, *_ = kind.__module__.split(".")
    return f"{package}/{folder}/{kind.__name__}"


def matching(offered: list[QoSProfile]) -> QoSProfile:
    """A profile that every writer of a topic can serve."""
    profile = copied(REALTIME_QOS)
    if any(one.reliability != ReliabilityPolicy.RELIABLE for one in offered):
        profile.reliability = ReliabilityPolicy.BEST_EFFORT
    if all(one.durability == DurabilityPolicy.TRANSIENT_LOCAL for one in offered):
        profile.durability = DurabilityPolicy.TRANSIENT_LOCAL
    return profile
