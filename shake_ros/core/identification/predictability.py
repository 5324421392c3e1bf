"""What of a residual is predictable at all, shown by three means that do not need a better model.

    sensor noise         the white part of the channel, which no model predicts
    linear               what is coherent with the command: a linear filter would still predict it (residual_tests.py)
    filtered             what a filter of the command takes that may look ahead and has not seen the recording
    repeated, different  what the residual repeats where the command repeats, and what it does not: no model that the
                         command drives has the latter, whatever is added to it (process noise)

The command's feedback from the table is no objection: what a model makes of the recorded command is no longer in the
residual. What repeats between equal commands may be had by a model; which one, it does not say.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shake_ros.core.identification.command_filter import Driven, driven, fitted_filter, taken
from shake_ros.core.identification.noise import white_deviation
from shake_ros.core.identification.recording_problem import RecordingProblem
from shake_ros.core.identification.recordings import Record
from shake_ros.core.identification.repeats import repeated_and_different, repeats
from shake_ros.core.identification.residual_tests import error_split
from shake_ros.core.identification.velocity_filter import velocity_noise_gain

Floats = NDArray[np.float64]
CHANNELS = ("velocity", "acceleration")
LEAST_SHARE = 0.01  # of a mean square that is worth a word
SHORTEST = 64  # samples of a residual that can be told apart


@dataclass(frozen=True)
class Left:
    """A residual of one channel of one record.

    values : measured minus simulated, shape (m,). commands : of the record, shape (n,). start : first sample of the
    values. noise : standard deviation of the sensor's.
    """

    name: str
    held_out: bool
    channel: str
    values: Floats
    commands: Floats
    start: int
    sample_time: float
    noise: float

    @property
    def driven(self) -> Floats:
        """The command at the residual's samples."""
        return self.commands[self.start : self.start + len(self.values)]


@dataclass(frozen=True)
class Predictability:
    """Shares of the mean square of one channel's residual [-]; None where a means was not at hand.

    mean_square : [unit²]. ratio : rms of the residual over the sensor noise [-]. noise : sensor noise.
    linear, filtered, repeated : predictable by each of three means. different : not predictable by any model of the
    command, beyond the sensor noise.
    """

    name: str
    held_out: bool
    channel: str
    mean_square: float
    ratio: float
    noise: float
    linear: float
    filtered: float | None = None
    repeated: float | None = None
    different: float | None = None

    @property
    def predictable(self) -> float:
        """The largest share that a means shows to be predictable."""
        return min(max(self.linear, self.filtered or 0.0, self.repeated or 0.0), 1.0 - self.noise)

    @property
    def unknown(self) -> float:
        """The share of which nothing says whether it is predictable; none where equal commands tell it."""
        return max(1.0 - self.noise - self.predictable - (self.different or 0.0), 0.0)

    @property
    def least_ratio(self) -> float:
        """Residual over the sensor noise that a model of the command would be left with, as far as is known [-]."""
        return self.ratio * math.sqrt(max(1.0 - self.predictable, 0.0))

    @property
    def text(self) -> str:
        """A phrase for a report."""
        parts = [f"{_percent(self.noise)} is sensor noise"]
        if self.filtered is not None:
            parts.append(f"{_percent(self.filtered)} a filter of the command would still predict")
        parts.append(f"{_percent(self.linear)} is coherent with the command")
        if self.repeated is not None:
            parts.append(self.same_text)
        elif self.unknown >= LEAST_SHARE:
            parts.append(f"the rest of {_percent(self.unknown)} is not known to be predictable")
        return f"of the {self.channel}'s residual of {self.ratio:.2f} × the noise {', '.join(parts)}"

    @property
    def same_text(self) -> str:
        """What equal commands tell, as a phrase."""
        if (self.repeated or 0.0) + (self.different or 0.0) < LEAST_SHARE:
            return "equal commands leave noise alone"
        same, other = f"{_percent(self.repeated or 0.0)} repeats between equal commands", self.different or 0.0
        if other < LEAST_SHARE:
            return f"{same} and nothing beyond the sensor noise differs"
        return f"{same} and {_percent(other)} does not, so no model of the command has it"


def _percent(share: float) -> str:
    return f"{100.0 * share:.0f} %"


def sensor_noise(record: Record, channel: str) -> float:
    """Standard deviation of the white noise of a channel, whatever the command repeats.

    What changes from period to period (`Record.velocity_noise`) holds process noise too; here the two are told apart.
    """
    if channel == "velocity":
        return velocity_noise_gain(record.sample_time) * record.position_noise()
    assert record.acceleration is not None
    return min(white_deviation(record.acceleration), record.calmest)


def residuals_left(problem: RecordingProblem, vector: np.ndarray, held_out: bool) -> list[Left]:
    """The residuals of a table's free runs over all records, channel by channel."""
    found = []
    for record in problem.records:
        simulated = dict(zip(CHANNELS, problem.simulate(vector[None, :], record), strict=True))
        if len(record.commands) - record.start < SHORTEST:
            continue
        rests = {"velocity": (record.velocity - simulated["velocity"][0])[record.start :]}
        if record.acceleration is not None:
            rests["acceleration"] = record.acceleration_left(simulated["acceleration"][0])
        for channel, left in rests.items():
            known = record.name, held_out, channel, left, record.commands
            found.append(Left(*known, record.start, record.sample_time, sensor_noise(record, channel)))
    return found


def predictability(estimation: Sequence[Left], validation: Sequence[Left]) -> tuple[Predictability, ...]:
    """Of each recording and channel; the filter is fitted on estimation data alone, never on what it is judged by."""
    found: list[Predictability] = []
    for channel in CHANNELS:
        learn = [left for left in estimation if left.channel == channel]
        every = [*learn, *(left for left in validation if left.channel == channel)]
        same = _under_equal_commands(every)
        rows = [driven(left.values, left.commands, left.start, left.sample_time) for left in every]
        filtered = _filtered(every, rows, len(learn))
        found += [_shares(*each) for each in zip(every, filtered, same, strict=True)]
    return tuple(merged(found))


def _filtered(every: Sequence[Left], rows: Sequence[Driven], learned: int) -> list[float | None]:
    """Mean square that a filter takes of each held-out residual; None of those it learns from."""
    rate = every[0].sample_time if every else 0.0
    alike = all(left.sample_time == rate for left in every)
    fitted = fitted_filter(rows[:learned]) if alike and learned < len(every) else None
    return [taken(fitted, row) if fitted is not None and k >= learned else None for k, row in enumerate(rows)]


def _under_equal_commands(every: Sequence[Left]) -> list[tuple[float, float] | None]:
    """Mean squares that each residual repeats and does not, over all its stretches under equal commands."""
    known: list[list[tuple[float, float]]] = [[] for _ in every]
    for pair in repeats([left.driven for left in every], [left.sample_time for left in every]):
        parts = repeated_and_different(every[pair.first].values[pair.here], every[pair.second].values[pair.there])
        for k in {pair.first, pair.second}:
            known[k].append(parts)
    return [(float(np.mean(k, axis=0)[0]), float(np.mean(k, axis=0)[1])) if k else None for k in known]


def _shares(left: Left, filtered: float | None, same: tuple[float, float] | None) -> Predictability:
    square = max(float(np.var(left.values)), 1e-300)
    noise = min(left.noise**2 / square, 1.0)
    linear = error_split([left.values], [left.driven], left.sample_time, left.noise).linear / square
    repeated = different = None
    if same is not None:
        there = max(sum(same), 1e-300)  # the mean square of those stretches
        repeated = max(same[0], 0.0) / there
        different = max(min(same[1] / there, 1.0) - min(left.noise**2 / there, 1.0), 0.0)
    taken_share = None if filtered is None else min(filtered / square, 1.0)
    ratio = math.sqrt(square) / max(left.noise, 1e-300)
    known = left.name, left.held_out, left.channel, square, ratio, noise, linear
    return Predictability(*known, taken_share, repeated, different)


def merged(parts: Iterable[Predictability]) -> list[Predictability]:
    """One of each recording and channel: the shares of its pieces, weighted by their mean squares."""
    groups: dict[tuple[str, bool, str], list[Predictability]] = {}
    for part in parts:
        groups.setdefault((part.name, part.held_out, part.channel), []).append(part)
    return [together(group) for group in groups.values()]


def together(group: Sequence[Predictability]) -> Predictability:
    """Several of one channel as one; a share counts where it is known."""
    if len(group) == 1:
        return group[0]
    squares = np.array([p.mean_square for p in group])

    def mean(values: Sequence[float | None]) -> float | None:
        known = np.array([v is not None for v in values])
        shares = np.array([0.0 if v is None else v for v in values])
        return float(shares @ (squares * known) / (squares @ known)) if known.any() else None

    noise = float(np.mean([p.mean_square * p.noise for p in group]))
    square = float(np.mean(squares))
    linear = mean([p.linear for p in group])
    assert linear is not None
    first = group[0]
    known = first.name, first.held_out, first.channel, square, math.sqrt(square / max(noise, 1e-300))
    others = [mean([getattr(p, kind) for p in group]) for kind in ("filtered", "repeated", "different")]
    return Predictability(*known, min(noise / square, 1.0), linear, *others)


def verdict(parts: Sequence[Predictability]) -> str:
    """A phrase on what is held out, acceleration before velocity, with what equal commands of any recording tell."""
    held = [p for p in parts if p.held_out] or list(parts)
    if not held:
        return ""
    channel = "acceleration" if any(p.channel == "acceleration" for p in held) else "velocity"
    text = together([p for p in held if p.channel == channel]).text
    same = [p for p in parts if p.channel == channel and p.repeated is not None]
    if same and not all(p in held for p in same):
        text += f"; in {', '.join(p.name for p in same)} {together(same).same_text}"
    return text
