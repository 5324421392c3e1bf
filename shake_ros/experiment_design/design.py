"""The motion that tells rival models apart: expected growth of the evidence, within what the table may do.

If the model found is true, the recording of a motion is what this model predicts. A rival fitted to it as well moves
its parameters by δ, against what the recordings at hand say of them, and leaves d(δ) of the difference d. The expected
gain in log likelihood over the rival is half of the squares that are left,

    E = ½ min_δ (‖d(δ)‖² + ‖J₀ δ‖²) / w,

all residuals weighted by the noise; w is the widening of the rival's variances on the recordings at hand, by which
residuals that are correlated, or above the sensor noise, count less. The motions of the library are compared to first
order, d(δ) = d − J δ; that promises up to a hundred times too much, so the rivals are fitted to the most promising
ones. Rivals are the answers that a search has left open and every effect that the model found lacks, as strong as the
recordings leave possible: a motion that distinguishes these shows what no recording has shown. What is gained over a
rival counts up to the odds that settle it. What is gained over an absent effect weakens what remains possible, so its
logarithm counts, as a mean over the effects, with the odds of 1 : 10 up to which a trial counts as possible.

A table that sticks and breaks away answers the least change of a parameter with another motion, which no fit follows to
its end. So the model found itself, its parameters moved within their own uncertainty, is held against itself in the
same way: what a motion gains over that counts.
Source: A. Atkinson, V. Fedorov, The design of experiments for discriminating between two rival models, Biometrika 62
(1975) 57; with the information J₀ᵀJ₀ that is there already.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import islice
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shake_ros.control.closed_loop import ClosedLoop, Loop, simulate
from shake_ros.control.laws.feedforward_pi import FeedforwardPI
from shake_ros.control.laws.runner import Controller
from shake_ros.control.reference.motion import Envelope, envelope
from shake_ros.experiment_design.further_sensors import FurtherSensor, WithSensors
from shake_ros.experiment_design.motions import Excitation
from shake_ros.explain.experiments import PAYLOAD, widening
from shake_ros.fit.declared_model import DeclaredModel
from shake_ros.fit.free_parameters import FreeParameters
from shake_ros.fit.identified import damping
from shake_ros.fit.least_squares import LOST, Adjustment, Fit, fit, jacobian
from shake_ros.fit.recording_problem import RecordingProblem
from shake_ros.fit.records import Record
from shake_ros.physics.plant.linearisation import oil_column_frequency
from shake_ros.repair.rival_models import RivalModel
from shake_ros.safety.causes import InterlockParameters
from shake_ros.safety.rehearsal import WatchedRun, first_trip
from shake_ros.search.candidate_effects import CandidateEffect
from shake_ros.search.decision import odds_of
from shake_ros.search.problem import linearised, side_by_side

Array = NDArray[np.float64]
HARDLY = math.log(10.0)  # gain in log likelihood below which two models are not distinguished [nats]
ENOUGH = math.log(1000.0)  # gain in log likelihood at which a rival counts as settled [nats]
ODDS = math.exp(-HARDLY)  # of an absent effect that is as strong as the recordings leave possible
HALVED = math.log(4.0)  # growth of the information on a strength that halves its deviation, on a logarithmic scale
OVERHEAD = 4.0  # of a run beside its motion, in seconds of excitation: many short runs are no gain
FOLLOWED = 12.0  # bandwidth of the plain loop by which a motion is predicted, at most [rad/s]
COMMAND = 0.9  # largest valve command that a motion may need [-]
NOTHING = np.zeros(0)
STEPS = 8  # by which a motion that is too large gets smaller, each by the root of two
CLOSE = 3  # motions to which the rivals are fitted, before the best of them is varied
VARIED = 2  # motions a step about the best one to which they are
EVALUATIONS, TOLERANCE = 6, 1e-2  # of such a fit
BOTH = math.sqrt(2.0)  # of weighted residuals: the second half of a motion tells as much as the first


@dataclass(frozen=True)
class Separation:
    """What a motion is expected to do to one rival."""

    rival: str  # its name
    gain: float  # expected gain in log likelihood of the model found over it [nats]
    # acceleration that its refit leaves unexplained in the first half of the motion, shape (n,) [m/s²]
    left: Array = field(repr=False)

    @property
    def settles(self) -> bool:
        """Whether the rival is expected to be distinguished."""
        return self.gain > HARDLY

    @property
    def odds(self) -> float:
        """Expected odds against it, up to 10⁶."""
        return odds_of(self.gain)


@dataclass(frozen=True)
class PredictedExcitation:
    """A motion as the model found predicts it."""

    motion: Excitation  # asked for
    samples: Array  # of the reference, shape (n, 3)
    record: Record  # what its sensors would show of the first half, which the second mirrors
    separations: tuple[Separation, ...] = ()  # of each rival that a search has left open
    absent: tuple[Separation, ...] = ()  # of each effect that the model found lacks and the recordings do not exclude

    @property
    def rate(self) -> float:
        """What it settles per second: 1 for a rival, ODDS for all absent effects if their strengths halve [1/s]."""
        rivals = sum(min(s.gain / ENOUGH, 1.0) for s in self.separations)
        absent = sum(math.log1p(s.gain / HARDLY) for s in self.absent) / (HALVED * max(len(self.absent), 1))
        return (rivals + ODDS * absent) / (self.motion.seconds + OVERHEAD)


@dataclass(frozen=True)
class Rival:
    """An answer beside the model found."""

    name: str  # of it
    fit: Fit  # that explains the recordings at hand as well as it can
    information: Array = field(repr=False)  # of its parameters from these recordings, per unit of x, shape (p, p)
    wide: float  # widening of its variances

    @classmethod
    def of(cls, name: str, there: Fit, problem: RecordingProblem) -> Rival:
        """With what the recordings at hand say of a fit that has its residuals and Jacobian there."""
        return cls(name, there, there.jacobian.T @ there.jacobian, widening(there, problem.blocks()))


@dataclass(frozen=True)
class Designer:
    """What a design knows."""

    model: DeclaredModel  # of all rivals
    found: Rival  # the model found
    rivals: tuple[Rival, ...]  # that a search has left open
    absent: tuple[Rival, ...]  # the model found with each effect that it lacks and the recordings do not exclude
    limits: Envelope  # of position, velocity and acceleration
    like: Record  # a recording whose noise the next one will have
    # the model found with its parameters a standard deviation away, to either side, as rivals of itself
    moved: tuple[Rival, ...]
    interlock: InterlockParameters | None = None  # that no motion may bring about

    @classmethod
    def of(
        cls,
        model: DeclaredModel,
        final: Fit,
        rivals: Sequence[RivalModel],
        limits: Envelope,
        records: Sequence[Record],
        lacking: Sequence[CandidateEffect] = (),
        interlock: InterlockParameters | None = None,
    ) -> Designer:
        """With what the recordings at hand say of each rival. lacking : effects that the model found lacks."""
        problem = RecordingProblem(list(records), model)
        there = linearised(problem, final)
        found = Rival.of("", there, problem)
        possible = possible_effects(problem, there, found.wide, lacking)
        return cls(
            model,
            found,
            tuple(Rival.of(r.name, linearised(problem, r.fit), problem) for r in rivals),
            tuple(replace(found, name=name, fit=fit) for name, fit in possible.items()),
            limits,
            max(records, key=lambda r: len(r.commands)),
            tuple(replace(found, fit=fit) for fit in within_uncertainty(final, found.information, found.wide)),
            interlock,
        )

    def predicted(self, motion: Excitation) -> PredictedExcitation | None:
        """A motion, smaller where it must be, as the model found predicts it; None where no small one may be."""
        for _ in range(STEPS):
            samples = motion.samples(self.limits, self.like.sample_time)
            if run := self._allowed(self.found, samples):
                return PredictedExcitation(motion, samples, self._half(str(motion), run))
            motion = replace(motion, part=round(motion.part / BOTH, 3))
        return None

    def harmless(self, prediction: PredictedExcitation, models: Sequence[Rival]) -> bool:
        """Whether a motion stays within the limits whichever of some models is true."""
        return all(side_by_side(lambda r: self._allowed(r, prediction.samples) is not None, models))

    def _half(self, name: str, run: ClosedLoop) -> Record:
        """What the sensors at hand would show of the first half of a run."""
        rng, like, half = np.random.default_rng(0), self.like, len(run.command) // 2
        heard = like.acceleration is not None
        felt = run.truth[:half, 2] + like.acceleration_noise() * rng.standard_normal(half) if heard else None
        seen = run.truth[:half, 0] + like.position_noise() * rng.standard_normal(half)
        load = None if like.pressure is None else run.measured[:half, 2] - run.measured[:half, 3]
        return Record(name, like.sample_time, run.command[:half], seen, felt, load, cutoff=like.cutoff)

    @cached_property
    def _controller(self) -> Controller:
        """A plain loop of half the gain at which the oil column would ring, 2 ζ ω_h with its damping at rest."""
        table = self.found.fit.table
        gain, bandwidth = envelope(table).velocity, min(FOLLOWED, damping(table) * oil_column_frequency(table))
        law = FeedforwardPI(
            limit=1.0, start_time=0.0, model_bandwidth=100.0, model_horizon=0.004, proportional_gain=-bandwidth / gain,
            integral_gain=0.0, feedforward_gain=1.0 / gain,
        )  # fmt: skip
        return Controller("feedforward_pi", law, self.like.sample_time)

    def _allowed(self, rival: Rival, samples: Array) -> ClosedLoop | None:
        """A model under a plain loop; None where it leaves the limits or the interlock would hold it."""
        run, finite = simulate(Loop(rival.fit.table, None, self._controller, samples))
        if finite < len(samples) or float(np.max(np.abs(run.command))) > COMMAND:
            return None
        if np.any(np.max(np.abs(run.truth), axis=0) > self.limits):
            return None
        return run if self.interlock is None or not self._held(self.interlock, run) else None

    def _held(self, interlock: InterlockParameters, run: ClosedLoop) -> bool:
        """Whether the interlock would hold a run; the pressure of a table without a data sheet has no unit."""
        position, acceleration, *_, supply = run.measured.T
        if self.model.nuisances:
            supply = np.full(len(supply), np.inf)
        columns = position, acceleration, supply, run.command, run.reference[:, 0]
        return first_trip(interlock, WatchedRun(run.sample_time, *(c.tolist() for c in columns))) is not None

    def separated(self, prediction: PredictedExcitation, *, refit: bool = True) -> PredictedExcitation:
        """A predicted motion with what it does to each rival; else to first order about the model found."""
        problem = RecordingProblem([prediction.record], self.model)
        compare = ModelComparison.of(problem, self.found)
        itself = max(compare.refitted(r).gained()[0] for r in self.moved) if refit else 0.0

        def separation(rival: Rival) -> Separation:
            gain, left = (compare.refitted if refit else compare.first_order)(rival).gained()
            return Separation(rival.name, max(gain - itself, 0.0), acceleration_in(problem, left / BOTH))

        return replace(
            prediction,
            separations=tuple(map(separation, self.rivals)),
            absent=tuple(map(separation, self.absent)),
        )

    def with_sensors(
        self, prediction: PredictedExcitation, sensors: Sequence[FurtherSensor]
    ) -> dict[str, tuple[Separation, ...]]:
        """What it does to the rivals if the table had one of some sensors more, by the sensor's name."""
        problem = WithSensors(RecordingProblem([prediction.record], self.model), sensors, self.found.fit.vector)
        compare, made = ModelComparison.of(problem, self.found), dict[str, tuple[Separation, ...]]()
        compared = [compare.refitted(r) for r in (*self.moved, *self.rivals)]
        for name, own in problem.columns().items():
            gains = [difference.of(own).gained()[0] for difference in compared]
            itself, others = max(gains[: len(self.moved)]), gains[len(self.moved) :]
            pairs = zip(self.rivals, others, strict=True)
            made[name] = tuple(Separation(r.name, max(gain - itself, 0.0), NOTHING) for r, gain in pairs)
        return made

    def heavier(self, part: float) -> Designer:
        """The same with a part of the mass that the model found moves more on the table."""
        more = part * self.found.fit.table.moved_mass

        def loaded(rival: Rival) -> Rival:
            free = rival.fit.free
            base = free.base.with_values({PAYLOAD: free.base.value(PAYLOAD) + more})
            return replace(rival, fit=replace(rival.fit, free=FreeParameters(base, free.free)))

        rivals, moved = (tuple(map(loaded, group)) for group in (self.rivals, self.moved))
        return replace(self, found=loaded(self.found), rivals=rivals, absent=(), moved=moved)

    def best(self, motions: Sequence[Excitation], progress: Callable[[str, float], None]) -> PredictedExcitation | None:
        """The best of the library and of the motions a step about the best of it; None if all leave the limits."""
        progress("predicting the motions of the library", 0.1)
        screened, close = self._screened(motions), dict[str, PredictedExcitation]()
        for p in screened:
            if len(close) < CLOSE and p.motion.name not in close and self._harmless(p):
                close[p.motion.name] = p
        progress("fitting the rivals to the best of them", 0.4)
        found = self._refitted(close.values())
        possible = (p for p in screened if self.harmless(p, self.rivals))
        first = close[found[0].motion.name] if found else next(possible, None)
        if first is not None:
            progress(f"best so far: {first.motion}; varying it", 0.7)
            varied = self._screened(list(first.motion.neighbours()))
            better = (p for p in varied if (p.rate > first.rate or not found) and self._harmless(p))
            found = sorted([*found, *self._refitted(islice(better, VARIED))], key=lambda p: -p.rate)
        return found[0] if found else None

    def _harmless(self, prediction: PredictedExcitation) -> bool:
        return self.harmless(prediction, (*self.rivals, *self.absent))

    def _screened(self, motions: Sequence[Excitation]) -> list[PredictedExcitation]:
        """The motions, no larger than may be, with what they do to each rival to first order, the best first."""
        predicted = {p.motion: p for p in filter(None, side_by_side(self.predicted, motions))}
        made = side_by_side(lambda p: self.separated(p, refit=False), list(predicted.values()))
        return sorted(made, key=lambda p: -p.rate)

    def _refitted(self, predictions: Iterable[PredictedExcitation]) -> list[PredictedExcitation]:
        """Predicted motions with what they do to each rival, the best first."""
        return sorted(side_by_side(self.separated, list(predictions)), key=lambda p: -p.rate)


class Difference(NamedTuple):
    """How a rival differs from the model found on a motion, to first order about some parameters.

    Attributes
    ----------
    values : of the weighted residuals where its parameters are as they were, shape (n,).
    slopes : Jacobian, shape (n, p).
    information : on its parameters from the recordings at hand, shape (p, p).
    wide : widening of its variances.
    """

    values: Array
    slopes: Array
    information: Array
    wide: float

    def of(self, samples: NDArray[np.intp]) -> Difference:
        """The same of some of the residuals."""
        return self._replace(values=self.values[samples], slopes=self.slopes[samples])

    def gained(self) -> tuple[float, Array]:
        """Expected gain over the rival fitted as well as it can be [nats], and what that leaves of it, shape (n,)."""
        step = np.linalg.lstsq(self.slopes.T @ self.slopes + self.information, -self.slopes.T @ self.values, 1e-12)[0]
        left = self.values + self.slopes @ step
        return 0.5 * (float(left @ left) + float(step @ self.information @ step)) / self.wide, left


@dataclass(frozen=True)
class ModelComparison:
    """Models on a predicted motion, each compared with the model found."""

    problem: RecordingProblem | WithSensors  # of the first half of the motion
    found: Rival  # the model found
    # truth, slopes: its residuals and Jacobian
    truth: Array
    slopes: Array

    @classmethod
    def of(cls, problem: RecordingProblem | WithSensors, found: Rival) -> ModelComparison:
        """With the model found simulated."""
        there = linearised(problem, found.fit)
        return cls(problem, found, there.residuals, np.nan_to_num(there.jacobian))

    def first_order(self, rival: Rival) -> Difference:
        """The difference of a rival, with slopes and information of the model found."""
        values = BOTH * np.nan_to_num(self.problem.residuals(rival.fit.vector[None, :])[0] - self.truth)
        return Difference(values, BOTH * self.slopes, self.found.information, rival.wide)

    def refitted(self, rival: Rival) -> Difference:
        """The same about the rival fitted to the motion, by the sensors at hand, and to the recordings at hand."""
        free, own = rival.fit.free, self.problem.problem if isinstance(self.problem, WithSensors) else self.problem
        by_own = RivalProblem(own, self.truth[: own.count + len(own.model.priors)], rival)
        x = fit(by_own, free, rival.fit.x, evaluations=EVALUATIONS, tolerance=TOLERANCE).x
        r = self.problem.residuals(free.vectors(x))[0]
        slopes = BOTH * np.nan_to_num(jacobian(self.problem, free, x, r))
        values = BOTH * np.nan_to_num(r - self.truth) - slopes @ (x - rival.fit.x)
        return Difference(values, slopes, rival.information, rival.wide)


class RivalProblem:
    """A rival against the model found on a motion, and against what the recordings at hand say of its parameters.

    Parameters
    ----------
    problem : of the motion. truth : residuals of the model found, shape (n,). rival : which.
    """

    smooth = True

    def __init__(self, problem: RecordingProblem, truth: Array, rival: Rival) -> None:
        self.problem, self.truth, self.rival = problem, truth, rival
        weights, vectors = np.linalg.eigh(rival.information)
        self._root = vectors * np.sqrt(np.maximum(weights, 0.0))

    def residuals(self, vectors: Array) -> Array:
        """Of the motion, of which the second half tells as much as the first, and of the parameters."""
        moved = self.rival.fit.free.rows(vectors) - self.rival.fit.x
        return np.hstack([BOTH * (self.problem.residuals(vectors) - self.truth), moved @ self._root])


def possible_effects(
    problem: RecordingProblem, found: Fit, wide: float, candidates: Sequence[CandidateEffect]
) -> dict[str, Fit]:
    """By effect, the model found with the strongest trial that the recordings leave possible.

    The trials of an effect are those by which the search looks for it, the weakest about as strong as it takes to
    matter. With all parameters of the model adjusted, a trial is possible where the recordings are no more than HARDLY
    against it. They are adjusted to first order, and again as long as that halves what is against the trial: a modulus
    makes up for what a dead volume softens, but near a resonance the first step leaves thousands of times what is to
    be judged. What the recordings have not visited they do not exclude; an effect without a possible trial is excluded.

    Parameters
    ----------
    problem : of the recordings at hand.
    found : the model, with its residuals and its Jacobian there.
    wide : widening of its variances.
    candidates : effects that it lacks.
    """
    adjustment = Adjustment(found.jacobian)
    least = float(np.sum(adjustment.left(found.residuals) ** 2))

    def possible(trial: Mapping[str, float]) -> Fit | None:
        free, x, before = FreeParameters(found.free.base.with_values(trial), found.free.free), found.x, math.inf
        while True:
            moved = np.nan_to_num(problem.residuals(free.vectors(x))[0], nan=LOST)
            against = 0.5 * (float(np.sum(adjustment.left(moved) ** 2)) - least) / wide
            x = np.clip(x + np.clip(adjustment.change(moved), -1.0, 1.0), free.low, free.high)
            if against < HARDLY:
                return replace(found, free=free, x=x)
            if not against < 0.5 * before:
                return None
            before = against

    def strongest(candidate: CandidateEffect) -> Fit | None:
        return next(filter(None, map(possible, reversed(candidate.trials))), None)

    made = zip(candidates, side_by_side(strongest, candidates), strict=True)
    return {candidate.effect: fit for candidate, fit in made if fit is not None}


def acceleration_in(problem: RecordingProblem, left: Array) -> Array:
    """The acceleration's part of the weighted residuals of a recording, or the velocity's where there is none."""
    record, n = problem.records[0], len(problem.records[0].commands) - problem.records[0].start
    if record.acceleration is None:
        return left[:n] / problem.velocity_weights[0]
    return -left[n : 2 * n] / problem.acceleration_weights[0]


def within_uncertainty(fit: Fit, information: Array, wide: float) -> tuple[Fit, ...]:
    """A fit with its parameters moved by a draw of their uncertainty, to either side."""
    weights, vectors = np.linalg.eigh(information / wide)
    size = np.where(weights > 1e-10 * weights[-1], 1.0 / np.sqrt(np.maximum(weights, 1e-300)), 0.0)
    move = vectors @ (size * np.random.default_rng(0).standard_normal(len(size)))
    return tuple(
        replace(fit, x=np.clip(fit.x + sign * np.clip(move, -1.0, 1.0), fit.free.low, fit.free.high))
        for sign in (1.0, -1.0)
    )
