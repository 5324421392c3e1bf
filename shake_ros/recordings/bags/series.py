"""One topic of a recording as columns: stamps, times of receipt, numbers; put in order, with what was wrong."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from shake_ros.quantities import ShakeError
from shake_ros.recordings.bags.bag import Bag, BagTopic, Finding, Message
from shake_ros.recordings.bags.cdr import MISSING_STAMP, Floats, Integers, Layout, columns

BATCH = 4096
RESTART_SAMPLES = 100
GAP_FACTOR = 1.5
JITTER_LIMIT = 0.1
MEASURED, NOT_MEASURED = "linear_acceleration_covariance[0]", -1.0
STRAY = 0.01  # share of values other than zero among messages that say that they hold none
AROUND = 10  # samples on either side over which a stamp's jitter is distinguished from a gap


class Publisher(NamedTuple):
    """What distinguishes the publishers of a topic: frame and joints that messages name, whether they hold numbers."""

    frame: str
    joints: tuple[str, ...]
    numbers: bool = True


@dataclass(frozen=True)
class Signal:
    """What is read from a topic."""

    name: str  # last component of the topic's name
    type: str  # message type
    paths: tuple[str, ...]  # field of each column; `{joint}` means the index of the joint
    joint: str = ""  # name of the joint to take
    also: tuple[str, ...] = ()  # other ends of its name, in the order in which they are preferred

    def joints(self, layout: Layout) -> tuple[str, ...]:
        """Names of the joints in messages with this layout."""
        return tuple(text for path, text in layout.texts.items() if path.startswith(("name[", "joint_names[")))

    def fields(self, joints: Sequence[str], joint: str, only: bool = True) -> Sequence[str]:
        """The fields of a joint in a message that has these; of its only one, whatever its name, with `only`."""
        if not self.joint:
            return self.paths
        if joint not in joints and not (only and len(joints) < 2):
            return ()
        number = joints.index(joint) if joint in joints else 0
        return [path.replace("{joint}", str(number)) for path in self.paths]

    def choose(self, layout: Layout) -> tuple[int, Sequence[str]]:
        """As `columns` asks: 0 and the fields of the table's joint, or −1 and none in a message without it."""
        found = self.fields(self.joints(layout), self.joint, only=False)
        return (0 if found else -1), found


JOINT, POINT = "sensor_msgs/msg/JointState", "trajectory_msgs/msg/JointTrajectory"
PRESSURE = "sensor_msgs/msg/FluidPressure"
POINT_PATHS = tuple(f"points[0].{name}[{{joint}}]" for name in ("positions", "velocities", "accelerations"))
SIGNALS = {
    signal.name: signal
    for signal in (
        Signal("valve_command", JOINT, ("position[{joint}]",), "servo_valve"),
        Signal("joint_states", JOINT, ("position[{joint}]",), "table"),
        Signal("imu", "sensor_msgs/msg/Imu", ("linear_acceleration.x",), also=("imu/data_raw", "imu/data")),  # REP 145
        Signal("pressure_a", PRESSURE, ("fluid_pressure",)),
        Signal("pressure_b", PRESSURE, ("fluid_pressure",)),
        Signal("pressure_load", PRESSURE, ("fluid_pressure",)),
        Signal("pressure_supply", PRESSURE, ("fluid_pressure",)),
        Signal("force", "geometry_msgs/msg/WrenchStamped", ("wrench.force.x",)),
        Signal("reference", POINT, POINT_PATHS, "table"),
        Signal("estimate", POINT, POINT_PATHS, "table"),
        Signal("truth", POINT, POINT_PATHS, "table"),
    )
}


ARRAYS = ("stamps", "received", "values", "sources")  # of a series


@dataclass(frozen=True)
class Series:
    """The samples of one topic."""

    topic: str  # full name
    # stamps, received: (n,) header.stamp and time of receipt [ns]
    stamps: Integers
    received: Integers
    values: Floats  # (n, width) numbers in the units of the message
    sources: Integers  # (n,) number of the `Publisher` of each message; −1 where it cannot be decoded

    def __len__(self) -> int:
        return len(self.stamps)

    def __getitem__(self, rows: slice | npt.NDArray[np.bool_] | Integers) -> Series:
        return replace(self, **{name: getattr(self, name)[rows] for name in ARRAYS})

    @property
    def period(self) -> float:
        """Median distance of stamps [ns]; NaN for fewer than two samples."""
        return float(np.median(np.diff(self.stamps))) if len(self) > 1 else float("nan")


class Collector:
    """Gathers the messages of one topic and decodes them in batches.

    Parameters
    ----------
    signal : what is read.
    topic : full name.
    joint : its name; the signal's where empty.
    """

    def __init__(self, signal: Signal, topic: str, joint: str = "") -> None:
        self.signal, self.topic, self.joint = signal, topic, joint or signal.joint
        self.sources: list[Publisher] = []  # of the messages so far, in the order of their first
        self._messages: list[bytes] = []
        self._received: list[int] = []
        self._parts: list[Series] = []

    def add(self, message: Message) -> None:
        """Take one message."""
        self._messages.append(message.data)
        self._received.append(message.received)
        if len(self._messages) >= BATCH:
            self._decode()

    def _choose(self, layout: Layout) -> tuple[int, Sequence[str]]:
        joints = self.signal.joints(layout)
        paths = self.signal.fields(joints, self.joint)
        source = Publisher(layout.texts.get("header.frame_id", ""), joints, not paths or paths[0] in layout.fields)
        if source not in self.sources:
            self.sources.append(source)
        return self.sources.index(source), [*paths, MEASURED] if self.signal.name == "imu" else paths

    def _decode(self) -> None:
        signal = self.signal
        width = len(signal.paths) + (signal.name == "imu")
        stamps, values, sources = columns(self._messages, signal.type, self._choose, width)
        received = np.array(self._received, dtype=np.uint64).astype(np.int64)
        self._parts.append(Series(self.topic, stamps, received, values, sources))
        self._messages, self._received = [], []

    def take(self) -> Series:
        """All samples so far."""
        self._decode()
        return Series(self.topic, *(np.concatenate([getattr(part, name) for part in self._parts]) for name in ARRAYS))


def with_acceleration(series: Series, findings: list[Finding]) -> Series:
    """Messages of an Imu with an acceleration, their covariance's first element taken off the columns.

    An element of −1 means: not measured. Zeros beside it are left out; data are kept, with a warning.
    """
    without = series.values[:, 1] == NOT_MEASURED
    series = replace(series, values=series.values[:, :1])
    if not without.any():
        return series
    count = int(without.sum())
    if np.mean(series.values[without, 0] != 0.0) > STRAY:
        text = (
            f"{count} messages declare their acceleration as not measured (covariance −1) but contain data, which are "
            "kept"
        )
        findings.append(Finding("covariance", series.topic, count, text))
        return series
    text = f"{count} of {len(series)} messages contain no acceleration (covariance −1); they are left out"
    findings.append(Finding("absent", series.topic, count, text))
    return series[~without]


def choose_topic(bag: Bag, signal: Signal, required: bool = False, chosen: str = "") -> BagTopic | None:
    """The topic of a signal: the one chosen, else the one whose last name component is the signal's name.

    Raises
    ------
    ShakeError
        where two topics qualify (both are listed), where a required one is missing (all are listed), or where it
        cannot be used (the reason is given).
    """
    name, kind = signal.name, signal.type
    found = [bag.topics[chosen]] if chosen in bag.topics else [] if chosen else topics_of(bag, signal)
    if len(found) > 1:
        both = " and ".join(sorted(topic.name for topic in found))
        raise ShakeError(
            f"{bag.path}: two topics end in '{name}': {both}; a recording of one table is needed, "
            f"or choose one, as in --take {name}={found[0].name}"
        )
    if not found:
        if required or chosen:
            names = ", ".join(sorted(bag.topics)[:12]) or "no topic at all"
            damage = "".join(f"; {finding.text}" for finding in bag.findings if finding.kind == "damage")
            raise ShakeError(f"{bag.path}: no topic '{chosen or name}'; the recording holds {names}{damage}")
        return None
    topic = found[0]
    reason = topic.refusal or (f"is {topic.type}, expected {kind}" if kind and not same_type(topic.type, kind) else "")
    if not reason and not topic.count:
        reason = "holds no message"
    if reason:
        if required:
            raise ShakeError(f"{bag.path}: topic '{topic.name}' {reason}")
        if not topic.refusal:
            bag.findings.append(Finding("absent", topic.name, topic.count, f"{reason}; left out"))
        return None
    return topic


def topics_of(bag: Bag, signal: Signal) -> list[BagTopic]:
    """Topics that end in the signal's name, those with messages before those without; of one sensor the preferred."""
    best: dict[str, tuple[int, BagTopic]] = {}
    for topic in bag.topics.values():
        for rank, end in enumerate((signal.name, *signal.also)):
            if f"/{topic.name}".endswith(f"/{end}") and (not rank or same_type(topic.type, signal.type)):
                sensor = f"/{topic.name}".removesuffix(f"/{end}")
                order = rank + (0 if topic.count else len(signal.also) + 1)
                if sensor not in best or order < best[sensor][0]:
                    best[sensor] = order, topic
    named = [topic for _, topic in best.values()]
    return [topic for topic in named if topic.count] or named[:1]


def same_type(name: str, wanted: str) -> bool:
    """Whether two message types are one, with or without the `msg` between package and name."""
    return name.replace("/msg/", "/") == wanted.replace("/msg/", "/")


def in_order(series: Series, findings: list[Finding]) -> Series:
    """The series with rising stamps; what was undecodable, unstamped, repeated or out of order is reported.

    A jump back by more than 100 samples is a second run in the same recording: the longer run is kept, since
    sorting would shuffle two runs into one another.
    """
    topic = series.topic

    def report(kind: str, bad: npt.NDArray[np.bool_], text: str) -> None:
        count = int(bad.sum())
        if count:
            first = int(np.argmax(bad))
            findings.append(Finding(kind, topic, count, f"{count} {text} (first: message {first})"))

    bad = series.stamps == MISSING_STAMP
    report("undecodable", bad, "messages cannot be decoded")
    series = series[~bad]
    bad = series.stamps == 0
    if bad.any() and len(series) > 1:
        following = series.stamps[1] - series.stamps[0]
        bad[0] &= not 0 < following <= _far(series.stamps[1:])  # simulated time may start at zero
        report("missing_stamp", bad, "messages have no stamp")
        series = series[~bad]
    report("reversed_time", bad := _strays(series.stamps), "stamps are far from both neighbours; left out")
    series = _one_run(series[~bad], findings)
    steps = np.diff(series.stamps, prepend=series.stamps[:1] - 1)
    report("reversed_time", steps < 0, "stamps go back in time; sorted")
    if (steps < 0).any():
        series = series[np.argsort(series.stamps, kind="stable")]
    same = np.diff(series.stamps, prepend=series.stamps[:1] - 1) == 0
    if same.any():
        before = np.flatnonzero(same)
        differ = ~np.isclose(series.values[before], series.values[before - 1], rtol=0, atol=0, equal_nan=True)
        changed = int(differ.any(axis=1).sum())
        report("duplicate", same, f"stamps occur twice, {changed} with another value; the first is used")
        series = series[~same]
    return series


def broken(stamps: Integers) -> npt.NDArray[np.bool_]:
    """Whether samples are missing after each stamp but the last, shape (n − 1,).

    A late stamp with an early one behind it is jitter: a gap is where the stamps behind are later on the whole.
    """
    steps = np.diff(stamps)
    period = float(np.median(steps)) if len(steps) else 0.0
    gaps = np.asarray(steps > GAP_FACTOR * period)
    for k in np.flatnonzero(gaps & (steps < (GAP_FACTOR + 1.0) * period)).tolist():
        count = min(AROUND, k + 1, len(stamps) - k - 1)
        later = float(np.mean(stamps[k + 1 : k + 1 + count] - stamps[k + 1 - count : k + 1]))
        gaps[k] = later > (count + GAP_FACTOR - 1.0) * period
    return gaps


def _far(stamps: Integers) -> float:
    """The distance of two stamps from which they do not belong to one run [ns]."""
    forward = np.diff(stamps)
    forward = forward[forward > 0]
    return RESTART_SAMPLES * float(np.median(forward)) if forward.size else np.inf


def _strays(stamps: Integers) -> npt.NDArray[np.bool_]:
    """Single stamps far from both neighbours, which are close to each other."""
    stray = np.zeros(len(stamps), dtype=np.bool_)
    if len(stamps) > 2:
        limit = _far(stamps)
        away = np.abs(np.diff(stamps)) > limit
        stray[1:-1] = away[:-1] & away[1:] & (np.abs(stamps[2:] - stamps[:-2]) <= limit)
    return stray


def _one_run(series: Series, findings: list[Finding]) -> Series:
    """The longest segment of a series without a jump back by more than RESTART_SAMPLES."""
    if len(series) < 2:
        return series
    cuts = np.flatnonzero(np.diff(series.stamps) < -_far(series.stamps)) + 1
    if not cuts.size:
        return series
    edges = [0, *(int(cut) for cut in cuts), len(series)]
    lengths = np.diff(edges)
    longest = int(np.argmax(lengths))
    left_out = len(series) - int(lengths[longest])
    text = f"time starts again {len(cuts)} times; the longest run is kept, {left_out} samples of others are left out"
    findings.append(Finding("restart", series.topic, len(cuts), text))
    return series[edges[longest] : edges[longest + 1]]


def require(series: Series, path: object, findings: list[Finding]) -> None:
    """Raise ShakeError where a required topic has nothing left to use, with what was found on it."""
    if len(series) < 2:
        found = "".join(f"; {finding.text}" for finding in findings if finding.topic == series.topic)
        raise ShakeError(
            f"{path}: topic '{series.topic}' has {len(series)} usable stamped samples, at least 2 are needed{found}"
        )
