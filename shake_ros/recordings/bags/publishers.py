"""Which messages of a topic are the table's: by the joint's name, then by publisher; the rest is left out and reported.

A topic such as /joint_states is shared: every robot of a cell may write on it. A joint is found by its name, wherever
it stands. Only where no message has that name and one other joint is all there is, that one is read, with a finding.

Recordings do not say who published a message. Two publishers of one joint are seen where samples lie between others
that are one period apart, and do not lie on the curve through these: grouped by frame and names or, for a position,
which is smooth, by value.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shake_ros.quantities import ShakeError, unknown_name
from shake_ros.recordings.bags.bag import Finding
from shake_ros.recordings.bags.cdr import Integers
from shake_ros.recordings.bags.series import RESTART_SAMPLES, SIGNALS, Collector, Publisher, Series

Rows = npt.NDArray[np.bool_]
BETWEEN = 0.8  # of the samples of a second publisher lie between two of the first that are one period apart
ONE_PERIOD = 1.5  # of the first publisher's period
OFF_CURVE = 3.0  # times as far from the curve of the first one as its own samples are
FEWEST = 3  # samples that make a second publisher
LEAP, SHARE = 10.0, 0.02  # of the usual step, and of the whole range, beyond which a position is of another publisher
OFTEN = 0.2  # of the messages that repeat a stamp with another value, from which two publishers share it
CROSSING = 1.1  # periods between the neighbours of a sample that is one too many
SMOOTH = "joint_states"  # the signal whose values alone show a second publisher

Take = Mapping[str, "str | int | Iterable[str | int]"]


@dataclass(frozen=True)
class Choice:
    """What is read of a signal of which a recording holds several; empty or 0: what the signal's description says."""

    topic: str = ""
    joint: str = ""
    publisher: int = 0


def choices(take: Take | None) -> dict[str, Choice]:
    """Choices by signal, from names of topics (they begin with /), of joints, and numbers of publishers.

    >>> choices({"joint_states": ["x_axis", 2]})["joint_states"]
    Choice(topic='', joint='x_axis', publisher=2)
    """
    found = {}
    for name, given in (take or {}).items():
        if name not in SIGNALS:
            raise unknown_name("signal to take", name, SIGNALS)
        parts: dict[str, str | int] = {}
        for part in [given] if isinstance(given, str | int) else given:
            text = str(part)
            key = "topic" if text.startswith("/") else "publisher" if text.isdigit() else "joint"
            parts[key] = int(text) if key == "publisher" else text
        if "joint" in parts and not SIGNALS[name].joint:
            raise ShakeError(
                f"{name} has no joints: '{parts['joint']}' is neither a topic (/…) nor a publisher's number"
            )
        found[name] = Choice(**parts)  # type: ignore[arg-type]
    return found


def of_the_table(collector: Collector, series: Series, choice: Choice, path: object, findings: list[Finding]) -> Series:
    """The messages that hold the table's signal, of one publisher, among those that a collector has taken.

    Raises
    ------
    ShakeError : another joint, or several, where the wanted one is missing; several publishers and none chosen.
    """
    signal, sources = collector.signal, collector.sources
    if signal.joint:
        series = _of_the_joint(collector, series, choice, path, findings)
    groups = _publishers(series, signal.name == SMOOTH)
    if choice.publisher > len(groups):
        raise ShakeError(f"{path}: topic '{series.topic}' has {len(groups)} publishers, not {choice.publisher}")
    if len(groups) == 1:
        return series
    if not choice.publisher:
        listed = "; ".join(_described(k + 1, series[rows], sources) for k, rows in enumerate(groups))
        what = f" of joint '{choice.joint or signal.joint}'" if signal.joint else ""
        raise ShakeError(
            f"{path}: topic '{series.topic}' has {len(groups)} publishers{what}: {listed}; choose one, "
            f"as in --take {signal.name}=1"
        )
    kept = groups[choice.publisher - 1]
    text = f"{len(groups)} publishers, of which number {choice.publisher} is read as chosen"
    findings.append(Finding("publishers", series.topic, int(np.sum(~kept)), text))
    return series[kept]


def _of_the_joint(
    collector: Collector, series: Series, choice: Choice, path: object, findings: list[Finding]
) -> Series:
    sources = collector.sources
    own_joint = _joint(collector, series, choice, path, findings)
    own = [k for k, source in enumerate(sources) if own_joint in (source.joints or ("",))]
    kept = np.isin(series.sources, own) | (series.sources < 0)
    there = [sources[k].joints or ("",) for k in np.unique(series.sources[series.sources >= 0]).tolist()]
    if others := sorted({joint for joints in there for joint in joints} - {own_joint}):
        count = int(np.sum(~kept))
        listed = ", ".join(joint or "one without a name" for joint in others)
        text = f"other joints are left out: {listed} ({count} messages have only these)"
        findings.append(Finding("joint", series.topic, count, text))
    empty = [k for k in own if not sources[k].numbers]
    if len(empty) < len(own) and (none := np.isin(series.sources, empty)).any():
        text = f"{int(none.sum())} messages name joint '{own_joint}' without a number; they are left out"
        findings.append(Finding("absent", series.topic, int(none.sum()), text))
        kept &= ~none
    return series[kept]


def _joint(collector: Collector, series: Series, choice: Choice, path: object, findings: list[Finding]) -> str:
    """The joint to read: the one chosen or the table's; its only one where the topic does not have that."""
    name, wanted = collector.signal.name, collector.joint
    every = {joint for source in collector.sources for joint in source.joints}
    counts = Counter(collector.sources[k].joints or ("",) for k in series.sources[series.sources >= 0].tolist())
    if wanted in every or not counts:
        return wanted
    often = [joints for joints, count in counts.items() if count >= FEWEST] or list(counts)  # the rest is damage
    found = sorted({joint for joints in often for joint in joints})
    if choice.joint or len(found) > 1:
        listed = ", ".join(joint or "one without a name" for joint in found)
        raise ShakeError(
            f"{path}: topic '{series.topic}' has no joint '{wanted}', but {listed}; choose one, "
            f"as in --take {name}={next(filter(None, found), 'NAME')}"
        )
    text = f"has no joint '{wanted}'; its only joint, {repr(found[0]) if found[0] else 'without a name'}, is read"
    findings.append(Finding("joint", series.topic, len(series), text))
    return found[0]


def _described(number: int, series: Series, sources: Sequence[Publisher]) -> str:
    x, source = series.values[:, 0], sources[int(series.sources[0])]
    frame = f" in frame '{source.frame}'" if source.frame else ""
    return (
        f"{number}: {len(series)} messages{frame} every {series.period / 1e6:.3g} ms, "
        f"{np.nanmin(x):.4g} … {np.nanmax(x):.4g}"
    )


def _publishers(series: Series, smooth: bool) -> list[Rows]:
    """Rows of each publisher, the one with the most messages first; one group where there is but one."""
    usable = np.isfinite(series.values[:, 0]) & (series.stamps > 0)
    every = np.ones(len(series), dtype=bool)
    labels = series.sources
    numbers, counts = np.unique(labels[usable], return_counts=True)
    if numbers.size > 1:
        groups = [labels == k for k in numbers[np.argsort(-counts, kind="stable")]]
        if any(_apart(series[groups[0] & usable], series[rows & usable]) for rows in groups[1:]):
            return groups
    if back := _jumps_back(series.stamps[usable]):  # now and then: one run behind another
        return _by_clock(series, usable) if back > FEWEST else [every]
    again = _repeated(series) & usable
    if again.sum() > max(FEWEST, OFTEN * len(series)):
        return [~again, again]
    if not smooth or np.sum(usable) < 4 * FEWEST:
        return [every]
    second = np.zeros(len(series), dtype=bool)
    second[np.flatnonzero(usable)] = _other_track(series[usable])
    if not second.any() or not _apart(series[usable & ~second], series[second]):
        return [every]
    return sorted((~second, second), key=lambda rows: -int(rows.sum()))


def _jumps_back(stamps: Integers) -> int:
    """How often stamps go back by more than RESTART_SAMPLES periods."""
    steps = np.diff(np.sort(stamps))
    period = float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
    return int(np.count_nonzero(np.diff(stamps) < -RESTART_SAMPLES * period))


def _by_clock(series: Series, usable: Rows) -> list[Rows]:
    """Publishers whose stamps are of two clocks, apart by the largest distance of two stamps."""
    stamps = np.sort(series.stamps[usable])
    widest = int(np.argmax(np.diff(stamps)))
    later = series.stamps > stamps[widest]
    jumps = np.count_nonzero(np.diff(later[usable].astype(int)) < 0)
    groups = sorted((~later, later), key=lambda rows: -int(rows.sum()))
    return groups if jumps > FEWEST else [np.ones(len(series), dtype=bool)]


def _repeated(series: Series) -> Rows:
    """Messages with the stamp of one before them and another value."""
    order = np.argsort(series.stamps, kind="stable")
    t, x = series.stamps[order], series.values[order]
    found = np.zeros(len(t), dtype=bool)
    found[order[1:]] = (np.diff(t) == 0) & (np.diff(x, axis=0) != 0.0).any(axis=1)
    return found


def _apart(first: Series, second: Series) -> bool:
    """Whether samples lie between those of another publisher, off the curve through these."""
    first = first[np.argsort(first.stamps, kind="stable")]
    if len(first) < FEWEST or len(second) < FEWEST:
        return False
    t, x = first.stamps.astype(np.float64) - float(first.stamps[0]), first.values[:, 0]
    at, y = second.stamps.astype(np.float64) - float(first.stamps[0]), second.values[:, 0]
    right = np.clip(np.searchsorted(t, at), 1, len(t) - 1)
    between = (at >= t[0]) & (at <= t[-1]) & (t[right] - t[right - 1] <= ONE_PERIOD * first.period)
    if between.sum() < max(FEWEST, BETWEEN * len(second)):
        return False
    off = float(np.median(np.abs(y - np.interp(at, t, x))[between]))
    whole = np.maximum(t[2:] - t[:-2], 1.0)
    own = np.abs(x[1:-1] - x[:-2] - (x[2:] - x[:-2]) * (t[1:-1] - t[:-2]) / whole)
    return off > OFF_CURVE * float(np.median(own)) and off > 1e-3 * float(np.ptp(x))


def _other_track(series: Series) -> Rows:
    """Samples of a smooth signal that leap from the others and among themselves do not."""
    order = np.argsort(series.stamps, kind="stable")
    t, x = series.stamps[order], series.values[order, 0]
    usual = min(float(np.median(np.abs(x[lag:] - x[:-lag]))) for lag in (1, 2, 3, 4))
    limit = max(LEAP * usual, SHARE * float(np.ptp(x)))
    second = np.zeros(len(x), dtype=bool)
    if np.count_nonzero(np.abs(np.diff(x)) > limit) < 2 * FEWEST:
        return second
    last, before, other = 0, -1, -1  # rows: the newest two of the first track, the newest of the second
    for k in range(1, len(x)):
        aim = x[last]
        if before >= 0 and t[last] > t[before]:
            aim += (x[last] - x[before]) * min(float(t[k] - t[last]) / float(t[last] - t[before]), 2.0)
        off = min(abs(x[k] - aim), abs(x[k] - x[last]))
        if off > limit if other < 0 else off > abs(x[k] - x[other]):
            second[k], other = True, k
        else:
            before, last = last, k
    second[np.flatnonzero(~second)[_in_between(t[~second])]] = True
    result = np.zeros(len(x), dtype=bool)
    result[order] = second
    return result


def _in_between(stamps: Integers) -> Rows:
    """Samples between two others one period apart, which the value alone does not show: where the two curves cross."""
    found = np.zeros(len(stamps), dtype=bool)
    if len(stamps) > FEWEST:
        span = np.concatenate(([np.inf], stamps[2:] - stamps[:-2], [np.inf]))
        least = (span[1:-1] <= span[:-2]) & (span[1:-1] < span[2:])
        found[1:-1] = least & (span[1:-1] < CROSSING * float(np.median(np.diff(stamps))))
    return found
