"""A recording of a shaking table → arrays on one time base, with segments, provenance and findings.

The valve's command is recorded as the controller sends it. While the pressure is off or comes up, in a hold, and while
the master gain is below 1, the valve gets another one, or none, and a model that is driven by it learns nonsense. Each
change is reported at once, so the reports in the order of their receipt apply to every sample.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from shake_ros.quantities import ShakeError
from shake_ros.recordings.bags import align
from shake_ros.recordings.bags.align import Grid, hold, matched, shifts
from shake_ros.recordings.bags.bag import Bag, Finding, Message
from shake_ros.recordings.bags.cdr import Floats, Integers, UndecodableError, walk
from shake_ros.recordings.bags.publishers import Choice, Take, choices, of_the_table
from shake_ros.recordings.bags.series import (
    SIGNALS,
    Collector,
    Series,
    choose_topic,
    in_order,
    require,
    same_type,
    topics_of,
    with_acceleration,
)
from shake_ros.signals.stretches import stretches

SHORTEST_SEGMENT = 2
MOTION = {"joint_states": "position", "imu": "acceleration"}  # signals whose stamps may be the time base
NO_POSITION = "no position was recorded; fits compare the acceleration alone"


@dataclass(frozen=True)
class Provenance:
    """Where a recording came from."""

    topics: dict[str, str]  # signal → full topic name
    start_stamp: int  # header.stamp of the first sample [ns]
    complete: bool  # whether the files were closed properly


@dataclass(frozen=True)
class TableRecording:
    """Samples of a table at the stamps of its position sensor, or of its accelerometer where it has no other.

    None for a signal that was not recorded, but for the position.
    """

    name: str  # the recording's (its folder's)
    time: Floats  # (n,) from the first stamp [s]
    sample_time: float  # mean distance of neighbouring samples [s]
    valve_command: Floats  # (n,) acting from each sample until the next [-]; NaN where it is not known
    position: Floats  # (n,) [m]; NaN where it was not measured
    acceleration: Floats | None  # (n,) [m/s²]
    # without a gap, in which the command acted, and it and what there is of position and acceleration are finite
    segments: tuple[slice, ...]
    provenance: Provenance
    findings: tuple[Finding, ...] = ()  # what was not as it should be
    pressure_a: Floats | None = None  # (n,) absolute [Pa]
    pressure_b: Floats | None = None
    pressure_load: Floats | None = None  # (n,) of a transducer between the chambers, of A less that of B [Pa]
    pressure_supply: Floats | None = None  # (n,) absolute [Pa]
    force: Floats | None = None  # (n,) external force on the table [N]
    reference: Floats | None = None  # (n, 3) position [m], velocity [m/s], acceleration [m/s²]; NaN where missing
    estimate: Floats | None = None  # the same
    truth: Floats | None = None  # the same

    def __len__(self) -> int:
        return len(self.time)

    def __getitem__(self, rows: slice) -> TableRecording:
        """The samples of a slice, as one segment."""
        changes: dict[str, Any] = {"segments": (slice(0, len(self.time[rows])),)}
        for name in (*ARRAYS, "time", "valve_command", "position", "acceleration"):
            values = getattr(self, name)
            changes[name] = None if values is None else values[rows]
        return replace(self, **changes)

    def between(self, start: float, stop: float) -> TableRecording:
        """The samples from `start` to before `stop` [s], named after them; its segments stay apart.

        Raises
        ------
        ShakeError : no segment lies there.
        """
        first, last = (int(i) for i in np.searchsorted(self.time, (start, stop)))
        cut = [(max(s.start, first) - first, min(s.stop, last) - first) for s in self.segments]
        segments = tuple(slice(a, b) for a, b in cut if b - a >= SHORTEST_SEGMENT)
        if not segments:
            raise ShakeError(f"{self.name}: no unbroken samples between {start:g} and {stop:g} s")
        return replace(self[first:last], name=f"{self.name}[{start:g}:{stop:g}]", segments=segments)

    @property
    def load(self) -> Floats | None:
        """Pressure of chamber A less that of chamber B, of one transducer or of two, shape (n,) [Pa]; None without."""
        if self.pressure_load is not None or self.pressure_a is None or self.pressure_b is None:
            return self.pressure_load
        return self.pressure_a - self.pressure_b

    @property
    def position_measured(self) -> bool:
        """Whether the position was recorded."""
        return bool(np.isfinite(self.position).any())

    @property
    def longest(self) -> TableRecording:
        """The samples of the longest segment."""
        return self[max(self.segments, key=lambda piece: piece.stop - piece.start)]


ARRAYS = ("pressure_a", "pressure_b", "pressure_load", "pressure_supply", "force", "reference", "estimate", "truth")


DIAGNOSTICS, DIAGNOSTICS_TYPE = "diagnostics", "diagnostic_msgs/msg/DiagnosticArray"
PASSES, SPAN = "passes", "span"  # values of a status: whether commands act, and the master gain
FULL = 0.9995  # master gain that counts as 1, as it is printed
BRIEF = 0.05  # [s] a shorter segment is a matter of which message was received first


def said(data: bytes) -> bool | None:
    """Whether commands act in full, by a message; None where none of its nodes has an interlock."""
    try:
        texts = walk(data, DIAGNOSTICS_TYPE).texts
    except UndecodableError:
        return None
    nodes: dict[str, dict[str, str]] = {}
    for path, key in texts.items():
        if path.endswith("].key"):
            status = path.partition("].values")[0]
            nodes.setdefault(status, {})[key] = texts[path.removesuffix("key") + "value"]
    reported = next((values for values in nodes.values() if PASSES in values), None)
    return None if reported is None else reported[PASSES] == "True" and _number(reported.get(SPAN, "1")) >= FULL


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return 1.0


def without_brief(acts: npt.NDArray[np.bool_], most: int) -> npt.NDArray[np.bool_]:
    """The same, without segments of at most so many samples on which commands did not act.

    >>> without_brief(np.array([False, True, False, False]), 1).tolist()
    [True, True, False, False]
    """
    found = acts.copy()
    for span in stretches(~acts):
        if span.stop - span.start <= most:
            found[span] = True
    return found


class Acting:
    """What the reports of a recording say, in the order of their receipt."""

    def __init__(self) -> None:
        self._received: list[int] = []
        self._acts: list[bool] = []

    def add(self, message: Message) -> None:
        """Take one message; only changes are kept."""
        acts = said(message.data)
        if acts is not None and (not self._acts or acts != self._acts[-1]):
            self._received.append(message.received)
            self._acts.append(acts)

    def samples(self, received: Integers) -> npt.NDArray[np.bool_]:
        """Whether commands acted on samples received at these times [ns]; before the first report as it says."""
        if not self._acts:
            return np.ones(len(received), dtype=bool)
        at = np.searchsorted(np.array(self._received), received, side="right") - 1
        return np.array(self._acts)[np.maximum(at, 0)]

    def usable(self, received: Integers, grid: Grid, topic: str, findings: list[Finding]) -> npt.NDArray[np.bool_]:
        """The samples on which commands acted; all of a recording that has none. What is left out is reported."""
        acts = without_brief(self.samples(received), round(BRIEF / grid.sample_time))
        idle = int(np.sum(~acts))
        if not idle:
            return acts
        what = "commands did not act in full (pressure off, a hold, or a master gain below 1)"
        if idle == len(acts):
            findings.append(Finding("idle", topic, idle, f"{what} on any sample", 0.0))
            return np.ones(len(acts), dtype=bool)
        first = grid.seconds(int(np.argmin(acts)))
        text = f"{what} on {idle} of {len(acts)} samples, which are left out; first at {first:.4g} s"
        findings.append(Finding("idle", topic, idle, text, first))
        return acts


def read_table_recording(path: Path | str, take: Take | None = None) -> TableRecording:
    """Read a recording of a table: any rosbag2 folder, or one .mcap or .db3 file.

    Topics are found by the last component of their names, joints by theirs, and aligned by header.stamp; a command
    stamped t acts from t until the next. Stamps of another clock are put on that of the positions where the times of
    receipt show it. Nothing is filled in: missing samples end a segment, and so does a command that did not act.

    Parameters
    ----------
    path : folder or file.
    take : what to read of a signal of which there are several: signal → full name of a topic, name of a joint, number
        of a publisher, or several of these.

    Raises
    ------
    ShakeError
        one line with path, topic and reason, where the recording cannot be used.
    """
    with Bag(path) as bag:
        chosen, acting = choices(take), Acting()
        collectors = _collectors(bag, chosen)
        topics: dict[str, Collector | Acting] = {c.topic: c for c in collectors.values()}
        for topic in bag.topics.values():
            named = topic.name.rsplit("/", 1)[-1] == DIAGNOSTICS and not topic.refusal
            if named and same_type(topic.type, DIAGNOSTICS_TYPE):
                topics[topic.name] = acting
        for message in bag.messages(list(topics)):
            topics[message.topic].add(message)
        return _assemble(bag, _taken(bag, collectors, chosen), acting)


def _collectors(bag: Bag, chosen: dict[str, Choice]) -> dict[str, Collector]:
    """What takes the messages of each signal that the recording holds; the required ones first."""
    collectors = {}
    blind = "joint_states" not in chosen and not topics_of(bag, SIGNALS["joint_states"])
    felt = any(topic.count for topic in topics_of(bag, SIGNALS["imu"]))
    required = "imu" if blind and felt else "joint_states", "valve_command"
    for name in (*required, *(name for name in SIGNALS if name not in required)):
        choice = chosen.get(name, Choice())
        topic = choose_topic(bag, SIGNALS[name], name in required, choice.topic)
        if topic is not None:
            collectors[name] = Collector(SIGNALS[name], topic.name, choice.joint)
    return collectors


def _taken(bag: Bag, collectors: dict[str, Collector], chosen: dict[str, Choice]) -> dict[str, Series]:
    """What came in: the table's own samples, on the clock of the positions."""
    new = {}
    for name, collector in collectors.items():
        series = collector.take()
        if name == "imu":
            series = with_acceleration(series, bag.findings)
        new[name] = of_the_table(collector, series, chosen.get(name, Choice()), bag.path, bag.findings)
    for name, shift in shifts(new, time_base(new), bag.findings).items():
        new[name] = replace(new[name], stamps=shift.taken_off(new[name].stamps))
    return new


def time_base(signals: Mapping[str, Any]) -> str:
    """The signal whose stamps are the time base: the position, or the acceleration where there is none."""
    return "joint_states" if "joint_states" in signals else "imu"


def _assemble(bag: Bag, raw: dict[str, Series], acting: Acting) -> TableRecording:
    findings: list[Finding] = []
    ordered, grid = _ordered(bag, raw, findings)
    topics, base = {name: series.topic for name, series in ordered.items()}, time_base(ordered)
    main = {"valve_command": hold(ordered["valve_command"], grid, findings), base: ordered[base].values[:, 0]}
    if base == "imu":
        findings.append(Finding("absent", "", 0, NO_POSITION))
    others: dict[str, Floats | None] = dict.fromkeys(ARRAYS)
    for name, series in ordered.items():
        if name in main:
            continue
        values = matched(series, grid, findings)
        if values is not None and name == "imu":
            main["imu"] = values[:, 0]
        elif values is not None:
            others[name] = values if values.shape[1] > 1 else values[:, 0]
    align.not_a_number(main, topics, grid, findings)
    align.sizes(main | {n: v for n, v in others.items() if v is not None}, topics, grid, findings)
    acts = acting.usable(ordered[base].received, grid, topics["valve_command"], findings)
    segments = _segments(grid, list(main.values()), acts)
    if not segments:
        text = "; ".join(str(finding) for finding in findings[:3])
        raise ShakeError(f"{bag.path}: no segment in which command and {MOTION[base]} are both known ({text})")
    return TableRecording(
        name=_name(bag.path),
        time=grid.time,
        sample_time=grid.sample_time,
        valve_command=main["valve_command"],
        position=main.get("joint_states", np.full(len(grid.stamps), np.nan)),
        acceleration=main.get("imu"),
        segments=segments,
        provenance=Provenance(topics, int(grid.stamps[0]), bag.complete),
        findings=(*bag.findings, *findings),
        **others,
    )


def _ordered(bag: Bag, raw: dict[str, Series], findings: list[Finding]) -> tuple[dict[str, Series], Grid]:
    """Every series in the order of its stamps, and the time base; commands and positions must be there."""
    base = time_base(raw)
    position = in_order(raw[base], findings)
    require(position, bag.path, findings)
    grid = Grid.of(position, findings)
    ordered = {base: position}
    for name, series in raw.items():
        if name != base:
            ordered[name] = in_order(_within(series, position, grid), findings)
    command = ordered["valve_command"]
    if not len(command):
        raise ShakeError(
            f"{bag.path}: topic '{command.topic}' has no stamped sample in the time of the {MOTION[base]}s"
        )
    return ordered, grid


def _within(series: Series, position: Series, grid: Grid) -> Series:
    """The samples received while the positions were, so that a second run in the recording does not mix in."""
    if not grid.restarted:
        return series
    margin = int(10 * grid.sample_time * 1e9)
    first, last = int(position.received.min()) - margin, int(position.received.max()) + margin
    return series[(series.received >= first) & (series.received <= last)]


def _segments(grid: Grid, signals: list[Floats], acts: npt.NDArray[np.bool_]) -> tuple[slice, ...]:
    """Runs of neighbouring samples in which all signals are finite and the command acts."""
    good = np.logical_and.reduce([acts, *(np.isfinite(signal) for signal in signals)])
    joined = good[1:] & good[:-1] & ~grid.gaps
    return tuple(slice(span.start, span.stop + 1) for span in stretches(joined))


def _name(path: Path) -> str:
    absolute = path.absolute()
    return absolute.name if absolute.is_dir() else absolute.name.split(".")[0]
