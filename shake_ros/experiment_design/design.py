"""The motion that tells rival models apart: expected growth of the evidence, within what the table may do.

If the model found is true, the recording of a motion is what this model predicts. A rival fitted to it as well moves
its parameters by δ, against what the recordings at hand say of them, and leaves d − J δ of the difference d. The
expected gain in log likelihood over the rival is half of the squares that are left,

    E = ½ min_δ (‖d − J δ‖² + ‖J₀ δ‖²) / w,

all residuals weighted by the noise; w is the widening of the rival's variances on the recordings at hand, by which
residuals that are correlated, or above the sensor noise, count less. A table that sticks and breaks away answers the
least change of a parameter with another motion, which no linear δ follows. So the model found itself, its parameters
moved within their own uncertainty, is held against itself in the same way: what a motion gains over that counts.
Source: A. Atkinson, V. Fedorov, The design of experiments for discriminating between two rival models, Biometrika 62
(1975) 57; with the information J₀ᵀJ₀ that is there already.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from shake_ros.core.control.feedforward_pi import FeedforwardPI
from shake_ros.core.control.runner import Controller
from shake_ros.core.discovery.problem import side_by_side
from shake_ros.core.identification.experiments import PAYLOAD
from shake_ros.core.identification.fit import Fit, jacobian
from shake_ros.core.identification.free_parameters import FreeParameters
from shake_ros.core.identification.identifiability import widening
from shake_ros.core.identification.recording_problem import RecordingProblem
from shake_ros.core.identification.recordings import DeclaredModel, Record
from shake_ros.core.loop.compiled import Loop, simulate
from shake_ros.core.plant.parameters import TableParameters
from shake_ros.core.reference.motion import Envelope, envelope
from shake_ros.experiment_design.further_sensors import FurtherSensor, WithSensors
from shake_ros.experiment_design.motions import Excitation
from shake_ros.search.rival_models import RivalModel

Array = NDArray[np.float64]
ENOUGH = math.log(1000.0)  # gain in log likelihood at which a rival counts as settled [nats]
HARDLY = math.log(10.0)  # below it a motion does not tell a rival apart [nats]
OVERHEAD = 4.0  # of a run beside its motion, in seconds of excitation: many short runs are no gain
FOLLOWED = 12.0  # bandwidth of the plain loop by which a motion is predicted [rad/s]
COMMAND = 0.9  # largest valve command that a motion may need [-]
NOTHING = np.zeros(0)
CLOSE = 12  # motions whose evidence is worked out with refitted rivals: those of the largest difference


@dataclass(frozen=True)
class Separation:
    """What a motion is expected to do to one rival.

    Attributes
    ----------
    rival : its name.
    gain : expected gain in log likelihood of the model found over it [nats].
    left : acceleration that its refit leaves unexplained, shape (n,) [m/s²].
    """

    rival: str
    gain: float
    left: Array = field(repr=False)

    @property
    def settles(self) -> bool:
        """Whether the rival is expected to be distinguished."""
        return self.gain > HARDLY

    @property
    def odds(self) -> float:
        """Expected odds against it, up to 10⁶."""
        return float(min(math.exp(min(self.gain, 20.0)), 1e6))


@dataclass(frozen=True)
class PredictedExcitation:
    """A motion as the model found predicts it.

    Attributes
    ----------
    motion : asked for.
    samples : of the reference, shape (n, 3).
    record : what its sensors would show.
    separations : of each rival.
    """

    motion: Excitation
    samples: Array
    record: Record
    separations: tuple[Separation, ...] = ()

    @property
    def rate(self) -> float:
        """Rivals that it settles per second, those that it settles in part counted in part [1/s]."""
        settled = sum(min(max(s.gain, 0.0) / ENOUGH, 1.0) for s in self.separations)
        return settled / (self.motion.seconds + OVERHEAD)


@dataclass(frozen=True)
class Designer:
    """What a design knows.

    Attributes
    ----------
    model : of all rivals. final : fit of the model found. rivals : of it. limits : of position, velocity, acceleration.
    like : a recording whose noise the next one will have. moved : the model found with its parameters a standard
    deviation away, to either side, as rivals of itself. known : information of each rival from the recordings at
    hand, per unit of x, and its widening; itself : the same of the model found.
    """

    model: DeclaredModel
    final: Fit
    rivals: tuple[RivalModel, ...]
    limits: Envelope
    like: Record
    moved: tuple[Fit, ...]
    known: tuple[tuple[Array, float], ...]
    itself: tuple[Array, float]

    @classmethod
    def of(
        cls, model: DeclaredModel, final: Fit, rivals: Sequence[RivalModel], limits: Envelope, records: Sequence[Record]
    ) -> Designer:
        """With what the recordings at hand say of each rival."""
        problem = RecordingProblem(list(records), model)

        def informed(fit: Fit) -> tuple[Array, float]:
            r = problem.residuals(fit.vector[None, :])[0]
            there = Fit(fit.free, fit.x, r, jacobian(problem, fit.free, fit.x, r), 0.5 * float(r @ r), 0)
            return there.jacobian.T @ there.jacobian, widening(there, problem.blocks())

        like, itself = max(records, key=lambda r: len(r.commands)), informed(final)
        away = within_uncertainty(final, *itself)
        return cls(model, final, tuple(rivals), limits, like, away, tuple(informed(r.fit) for r in rivals), itself)

    def predicted(self, motion: Excitation) -> PredictedExcitation | None:
        """A motion as the model found predicts it; None where any model would leave the limits."""
        samples = motion.samples(self.limits, self.like.sample_time)
        table = self.final.table
        runs = [self._followed(t, samples) for t in (table, *(r.fit.table for r in self.rivals))]
        if any(run is None for run in runs) or runs[0] is None:
            return None
        command, position, acceleration = runs[0]
        rng, like, n = np.random.default_rng(0), self.like, len(position)
        heard = like.acceleration is not None
        felt = acceleration + like.acceleration_noise() * rng.standard_normal(n) if heard else None
        record = Record(
            str(motion),
            like.sample_time,
            command,
            position + like.position_noise() * rng.standard_normal(n),
            felt,
            cutoff=like.cutoff,
        )
        return PredictedExcitation(motion, samples, record)

    def _followed(self, table: TableParameters, samples: Array) -> tuple[Array, Array, Array] | None:
        """Command, position and acceleration of a table under a plain loop; None where it leaves the limits."""
        gain = envelope(self.final.table).velocity
        law = FeedforwardPI(
            limit=1.0, start_time=0.0, model_bandwidth=100.0, model_horizon=0.004, proportional_gain=-FOLLOWED / gain,
            integral_gain=0.0, feedforward_gain=1.0 / gain,
        )  # fmt: skip
        run, finite = simulate(Loop(table, None, Controller("feedforward_pi", law, self.like.sample_time), samples))
        if finite < len(samples) or float(np.max(np.abs(run.command))) > COMMAND:
            return None
        largest = np.max(np.abs(run.truth), axis=0)
        return None if np.any(largest > self.limits) else (run.command, run.truth[:, 0], run.truth[:, 2])

    def separated(self, prediction: PredictedExcitation, *, refitted: bool = True) -> tuple[Separation, ...]:
        """What a predicted motion does to each rival; without their refits an upper bound."""
        problem = RecordingProblem([prediction.record], self.model)
        if refitted:
            return self._separations(self._compared(problem), lambda left: self._acceleration(problem, left))
        truth = problem.residuals(self.final.vector[None, :])[0]
        ends = [problem.residuals(rival.fit.vector[None, :])[0] - truth for rival in self.rivals]
        gains = [0.5 * float(np.nansum(end**2)) / wide for end, (_, wide) in zip(ends, self.known, strict=True)]
        return tuple(Separation(r.name, gain, NOTHING) for r, gain in zip(self.rivals, gains, strict=True))

    def with_sensors(
        self, prediction: PredictedExcitation, sensors: Sequence[FurtherSensor]
    ) -> dict[str, tuple[Separation, ...]]:
        """The same if the table had one of some sensors more, by the sensor's name."""
        problem = WithSensors(RecordingProblem([prediction.record], self.model), sensors, self.final.vector)
        compared = self._compared(problem)
        return {
            name: self._separations([(left[own], j[own]) for left, j in compared], lambda _: NOTHING)
            for name, own in problem.columns().items()
        }

    def heavier(self, part: float) -> Designer:
        """The same with a part of the mass that the model found moves more on the table."""
        more = part * self.final.table.moved_mass

        def loaded(fit: Fit) -> Fit:
            base = fit.free.base.with_values({PAYLOAD: fit.free.base.value(PAYLOAD) + more})
            return replace(fit, free=FreeParameters(base, fit.free.free))

        rivals = tuple(replace(r, result=replace(r.result, fit=loaded(r.fit))) for r in self.rivals)
        return replace(self, final=loaded(self.final), rivals=rivals, moved=tuple(map(loaded, self.moved)))

    def _compared(self, problem: RecordingProblem | WithSensors) -> list[tuple[Array, Array]]:
        """Weighted difference from the model found, and its Jacobian, of `moved` and of every rival."""
        truth = problem.residuals(self.final.vector[None, :])[0]

        def one(fit: Fit) -> tuple[Array, Array]:
            r = problem.residuals(fit.vector[None, :])[0]
            return np.nan_to_num(r - truth), np.nan_to_num(jacobian(problem, fit.free, fit.x, r))

        return [one(fit) for fit in (*self.moved, *(rival.fit for rival in self.rivals))]

    def _separations(
        self, compared: Sequence[tuple[Array, Array]], shown: Callable[[Array], Array]
    ) -> tuple[Separation, ...]:
        """What is gained over each rival beyond what is gained over the model found itself."""
        known = [*[self.itself] * len(self.moved), *self.known]
        ends = [gained(*pair, *of) for pair, of in zip(compared, known, strict=True)]
        itself = max((gain for gain, _ in ends[: len(self.moved)]), default=0.0)
        others = zip(self.rivals, ends[len(self.moved) :], strict=True)
        return tuple(Separation(rival.name, max(gain - itself, 0.0), shown(left)) for rival, (gain, left) in others)

    @staticmethod
    def _acceleration(problem: RecordingProblem, residuals: Array) -> Array:
        """The acceleration's part of weighted residuals in its unit, of the velocity where there is none."""
        record, n = problem.records[0], len(problem.records[0].commands) - problem.records[0].start
        if record.acceleration is None:
            return residuals[:n] / problem.velocity_weights[0]
        return -residuals[n : 2 * n] / problem.acceleration_weights[0]

    def best(self, motions: Sequence[Excitation], progress: Callable[[str, float], None]) -> list[PredictedExcitation]:
        """Predictions with their separations, the best first: of the library, then a step about the best of it."""
        progress("predicting the motions of the library", 0.1)
        possible = [p for p in side_by_side(self.predicted, motions) if p is not None]
        rough = side_by_side(lambda p: sum(math.log1p(s.gain) for s in self.separated(p, refitted=False)), possible)
        rates = [gain / p.motion.seconds for gain, p in zip(rough, possible, strict=True)]
        order = np.argsort(rates)[::-1]
        progress("refitting the rivals to the best of them", 0.4)
        found = self._worked_out([possible[i] for i in order[:CLOSE]])
        if found:
            progress(f"best so far: {found[0].motion}; varying it", 0.8)
            around = [p for p in side_by_side(self.predicted, list(found[0].motion.neighbours())) if p is not None]
            found = sorted([*found, *self._worked_out(around)], key=lambda p: -p.rate)
        return found

    def _worked_out(self, predictions: Sequence[PredictedExcitation]) -> list[PredictedExcitation]:
        made = side_by_side(lambda p: replace(p, separations=self.separated(p)), predictions)
        return sorted(made, key=lambda p: -p.rate)


def gained(difference: Array, slopes: Array, information: Array, wide: float) -> tuple[float, Array]:
    """Expected gain over a fit [nats], and what its refit leaves of a weighted difference, shape (n,).

    slopes : Jacobian, shape (n, p). information, wide : of the recordings at hand, and the widening.
    """
    step = np.linalg.lstsq(slopes.T @ slopes + information, -slopes.T @ difference, rcond=1e-12)[0]
    left = difference + slopes @ step
    return 0.5 * (float(left @ left) + float(step @ information @ step)) / wide, left


def within_uncertainty(fit: Fit, information: Array, wide: float) -> tuple[Fit, ...]:
    """A fit with its parameters moved by a draw of their uncertainty, to either side."""
    weights, vectors = np.linalg.eigh(information / wide)
    size = np.where(weights > 1e-10 * weights[-1], 1.0 / np.sqrt(np.maximum(weights, 1e-300)), 0.0)
    move = vectors @ (size * np.random.default_rng(0).standard_normal(len(size)))
    return tuple(
        replace(fit, x=np.clip(fit.x + sign * np.clip(move, -1.0, 1.0), fit.free.low, fit.free.high))
        for sign in (1.0, -1.0)
    )
