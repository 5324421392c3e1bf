"""One account of what a model leaves of each recording: how large it is, what predicts it, and what nothing does.

    sensor noise         the white part of the channel, which no model predicts
    coherent             what a linear filter of the command would still predict
    filtered             what a filter of the command takes that may look ahead and has not seen the recording
    repeated, different  what the residual repeats where the command repeats, and what it does not: no model that the
                         command drives has the latter, whatever is added to it (process noise)
    shape                whether its own past, or the command, predicts it at 99 %

None of them needs a better model. The command's feedback from the table is no objection: what a model makes of the
recorded command is no longer in the residual. What repeats between equal commands may be had by a model; which one, it
does not show.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shake_ros.explain.residual_tests import (
    LAGS,
    Driven,
    ResidualTest,
    coherent_mean_square,
    driven,
    fitted_filter,
    residual_test,
    taken,
)
from shake_ros.fit.nuisances.equal_commands import repeated_and_different, repeats, sensor_noise
from shake_ros.fit.recording_problem import RecordingProblem
from shake_ros.signals.velocity_filter import samples_apart

Floats = NDArray[np.float64]
CHANNELS = ("velocity", "acceleration")
LEAST_SHARE = 0.01  # of a mean square that is worth a word
SHORTEST = 64  # samples of a residual that can be told apart


@dataclass(frozen=True)
class Left:
    """A residual of one channel of one record.

    values : measured minus simulated, shape (m,). commands : of the record, shape (n,). start : first sample of the
    values. noise : standard deviation of the sensor's. independent : samples from one independent one to the next;
    0 where another channel of the record has the tests.
    """

    name: str
    held_out: bool
    channel: str
    values: Floats
    commands: Floats
    start: int
    sample_time: float
    noise: float
    independent: int = 1

    @property
    def driven(self) -> Floats:
        """The command at the residual's samples."""
        return self.commands[self.start : self.start + len(self.values)]


@dataclass(frozen=True)
class Account:
    """One channel's residual over a recording: shares of its mean square [-], None where a means was not at hand.

    mean_square : [unit²]. noise : standard deviation of the sensor's [unit]. coherent, filtered, repeated : predictable
    by each of three means. different : not predictable by any model of the command, beyond the sensor noise.
    shape : tests of its longest piece, of a channel that has independent noise.
    """

    name: str
    held_out: bool
    channel: str
    mean_square: float
    noise: float
    coherent: float
    filtered: float | None = None
    repeated: float | None = None
    different: float | None = None
    shape: ResidualTest | None = None

    @property
    def label(self) -> str:
        """The recording, and whether it was fitted."""
        return f"{self.name} ({'validation' if self.held_out else 'estimation'})"

    @property
    def ratio(self) -> float:
        """Rms of the residual over the sensor noise [-]."""
        return math.sqrt(self.mean_square) / max(self.noise, 1e-150)

    @property
    def noise_share(self) -> float:
        """The share that is sensor noise."""
        return min(self.noise**2 / self.mean_square, 1.0)

    @property
    def predictable(self) -> float:
        """The largest share that a means shows to be predictable."""
        return min(max(self.coherent, self.filtered or 0.0, self.repeated or 0.0), 1.0 - self.noise_share)

    @property
    def unknown(self) -> float:
        """The share of which nothing says whether it is predictable; none where equal commands tell it."""
        return max(1.0 - self.noise_share - self.predictable - (self.different or 0.0), 0.0)

    @property
    def least_ratio(self) -> float:
        """Residual over the sensor noise that a model of the command would be left with, as far as is known [-]."""
        return self.ratio * math.sqrt(max(1.0 - self.predictable, 0.0))

    @property
    def text(self) -> str:
        """A phrase for a report."""
        parts = [f"{_percent(self.noise_share)} is sensor noise"]
        if self.filtered is not None:
            parts.append(f"{_percent(self.filtered)} a filter of the command would still predict")
        parts.append(f"{_percent(self.coherent)} is coherent with the command")
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

    @property
    def predicted_by(self) -> str:
        """What predicts a part of it, as far as the tests show: "nothing", "the command", "its past", or both."""
        if self.shape is None:
            return "not tested"
        parts = ((self.shape.independent, "the command"), (self.shape.white, "its past"))
        return " and ".join(name for passed, name in parts if not passed) or "nothing"


def _percent(share: float) -> str:
    return f"{100.0 * share:.0f} %"


def residuals_left(problem: RecordingProblem, vector: np.ndarray, held_out: bool) -> list[Left]:
    """The residuals of a table's free runs over all records, channel by channel."""
    found = []
    for record in problem.records:
        if len(record.commands) - record.start < SHORTEST:
            continue
        velocity, acceleration = problem.simulate(vector[None, :], record)
        rests, independent = dict[str, Floats](), {"velocity": samples_apart(record.sample_time)}
        if record.position_measured:
            rests["velocity"] = (record.velocity - velocity[0])[record.start :]
        if record.acceleration is not None:
            rests["acceleration"] = record.acceleration_left(acceleration[0])
            independent = {"velocity": 0, "acceleration": 1}
        for channel, left in rests.items():
            known = record.name, held_out, channel, left, record.commands, record.start, record.sample_time
            found.append(Left(*known, sensor_noise(record, channel), independent[channel]))
    return found


def accounts(estimation: Sequence[Left], validation: Sequence[Left]) -> tuple[Account, ...]:
    """Of each recording and channel; the filter is fitted on estimation data alone, never on what it is judged by."""
    found: list[Account] = []
    for channel in CHANNELS:
        learn = [left for left in estimation if left.channel == channel]
        every = [*learn, *(left for left in validation if left.channel == channel)]
        same = _under_equal_commands(every)
        rows = [driven(left.values, left.commands, left.start, left.sample_time) for left in every]
        filtered = _filtered(every, rows, len(learn))
        tested = _tested(every)
        found += [_account(*each) for each in zip(every, filtered, same, tested, strict=True)]
    return tuple(merged(found))


def _tested(every: Sequence[Left]) -> list[ResidualTest | None]:
    """The tests of the longest piece of each recording; None of the others."""
    longest: dict[tuple[str, bool], int] = {}
    for k, left in enumerate(every):
        key = left.name, left.held_out
        if left.independent and len(left.values) >= 8 * LAGS * left.independent:
            longest[key] = max((longest.get(key, k), k), key=lambda i: len(every[i].values))
    return [
        residual_test(left.values[:: left.independent], left.driven[:: left.independent])
        if longest.get((left.name, left.held_out)) == k
        else None
        for k, left in enumerate(every)
    ]


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


def _account(
    left: Left, filtered: float | None, same: tuple[float, float] | None, shape: ResidualTest | None
) -> Account:
    square = max(float(np.var(left.values)), 1e-300)
    coherent = min(coherent_mean_square(left.values, left.driven, left.sample_time) / square, 1.0)
    repeated = different = None
    if same is not None:
        there = max(sum(same), 1e-300)  # the mean square of those stretches
        repeated = max(same[0], 0.0) / there
        different = max(min(same[1] / there, 1.0) - min(left.noise**2 / there, 1.0), 0.0)
    taken_share = None if filtered is None else min(filtered / square, 1.0)
    known = left.name, left.held_out, left.channel, square, left.noise, coherent
    return Account(*known, taken_share, repeated, different, shape)


def merged(parts: Iterable[Account]) -> list[Account]:
    """One of each recording and channel: the shares of its pieces, weighted by their mean squares."""
    groups: dict[tuple[str, bool, str], list[Account]] = {}
    for part in parts:
        groups.setdefault((part.name, part.held_out, part.channel), []).append(part)
    return [together(group) for group in groups.values()]


def together(group: Sequence[Account]) -> Account:
    """Several of one channel as one; a share counts where it is known."""
    if len(group) == 1:
        return group[0]
    squares = np.array([p.mean_square for p in group])

    def mean(values: Sequence[float | None]) -> float | None:
        known = np.array([v is not None for v in values])
        shares = np.array([0.0 if v is None else v for v in values])
        return float(shares @ (squares * known) / (squares @ known)) if known.any() else None

    noise = math.sqrt(float(np.mean([p.noise_share * p.mean_square for p in group])))
    coherent = mean([p.coherent for p in group])
    assert coherent is not None
    first, shape = group[0], next((p.shape for p in group if p.shape), None)
    known = first.name, first.held_out, first.channel, float(np.mean(squares)), noise, coherent
    kinds = ("filtered", "repeated", "different")
    filtered, repeated, different = (mean([getattr(p, kind) for p in group]) for kind in kinds)
    return Account(*known, filtered, repeated, different, shape)


def verdict(parts: Sequence[Account]) -> str:
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
