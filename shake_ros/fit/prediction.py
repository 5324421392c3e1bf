"""The prediction error of a model over segments: gains of a Kalman filter, then whitened innovations under these gains.

Sensor noise and process noise (a random force, drifting null shift and bias) have levels; where the force's level goes
to nothing the predictor is the free run. The gains are those of one model and are held while its parameters move, so
residuals are smooth functions of them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import astuple, dataclass, field, replace

import numpy as np

from shake_ros.fit.likelihood import LOST, Levels, Likelihood
from shake_ros.fit.model import TABLE
from shake_ros.fit.segment import Segment
from shake_ros.physics.effects.structure import NO_GAP
from shake_ros.physics.plant.integration import MOST
from shake_ros.physics.plant.parameters import FULL_LAYOUT
from shake_ros.physics.plant.prediction import (
    BIAS,
    FILTER_RATE,
    FILTERED,
    FORCE,
    NULL,
    PRESSURE_OFFSET,
    kalman,
    predict,
    relevelled,
)
from shake_ros.physics.plant.sensors import FILTER_DELAY
from shake_ros.physics.plant.simulation import NO_PACE, moving_state, remember, workers
from shake_ros.physics.plant.states import (
    BASE,
    BASE_RATE,
    CLOCK,
    LAGGED_ACCELERATION,
    LAGGED_POSITION,
    POSITION,
    PRESSURE_A,
    ROD,
    ROD_RATE,
    SPECIMEN,
    SPECIMEN_RATE,
    VELOCITY,
)

INDEX = FULL_LAYOUT.index
SIGNALS = ("position", "acceleration", "pressure")  # in the order in which a segment has them
GAP, LATE = INDEX["effects.coupling_backlash.gap"], INDEX["effects.position_sensor_lag.time_constant"]
RESONANT = 8.0  # motion of a specimen over that of its table, with which a segment may begin
SPEED = 0.05  # standard deviation of the velocity with which a segment begins [m/s]
TOLERANCE = 1e-6  # of a run; a hundred times more would make likelihoods wrong by a hundred nats
DIFFERENCE = 2e-4  # step of differences
SETTLING = 0.3  # random force while the state of a segment is found, in parts of its acceleration
CLOSER = 0.03, 0.1, 0.3  # times the likeliest random force, at which effects show
FAR = 200.0  # mean square of innovations beyond which a run has lost the table
NULL_STEP, NULL_MOST = 1e-4, 5e-3  # of a null shift: step of its difference, and at most at once [-]


@dataclass
class FilteredSegment:
    """One segment under the gains of a model. codes, gains, whitening : see physics/plant/prediction.py.

    by_null : change of the residuals by the null shift, over the root of its square and the prior's, shape (N,).
    """

    segment: Segment
    codes: np.ndarray
    gains: np.ndarray
    whitening: np.ndarray
    innovations: np.ndarray
    path: np.ndarray
    transition: np.ndarray
    sensing: np.ndarray
    pace: np.ndarray = field(default_factory=lambda: NO_PACE)
    by_null: np.ndarray | None = None

    @property
    def weights(self) -> np.ndarray:
        """One over the deviation of each innovation once those before it are known, 0 without, shape (n, m)."""
        return np.diagonal(self.whitening, axis1=1, axis2=2)


def coordinates(vector: np.ndarray) -> list[int]:
    """States of a table that the filter corrects."""

    def has(name: str) -> bool:
        return bool(vector[INDEX[f"effects.{name}"]] > 0.0)

    found = [POSITION, VELOCITY, PRESSURE_A]
    if has("specimen_resonance.mass"):
        found += [SPECIMEN, SPECIMEN_RATE]
    if vector[GAP] > NO_GAP:
        found += [ROD, ROD_RATE]
    if has("base_flexibility.compliance"):
        found += [BASE, BASE_RATE]
    if has("accelerometer_lag.time_constant"):
        found += [LAGGED_ACCELERATION]
    if has("position_sensor_lag.time_constant"):
        found += [LAGGED_POSITION]
    return found


class Predictor(Likelihood):
    """Whitened innovations of a model over segments, under gains made at one parameter vector."""

    difference = DIFFERENCE

    @property
    def own_levels(self) -> tuple[str, ...]:
        """Levels of the random force, and of the sensors beside the position's."""
        return ("force", *SIGNALS[1 : len(self.segments[0].noise)])

    def __init__(self, segments: Sequence[Segment], levels: Levels) -> None:
        self.segments, self.levels = tuple(segments), levels
        self.runs: list[FilteredSegment] = []

    def filtered(self, vector: np.ndarray) -> Predictor:
        """The same with the gains of a parameter vector, shape (WIDTH,)."""
        made = type(self)(self.segments, self.levels)
        with ThreadPoolExecutor(workers()) as pool:
            made.runs = list(pool.map(lambda s: self._filter(vector, s), self.segments))
        return made

    def part(self, seconds: float) -> Predictor:
        """Some of its segments, of about so many seconds, from the loudest to the calmest, with their gains."""
        every = max(int(sum(s.seconds for s in self.segments) / seconds), 1)
        order = sorted(range(len(self.segments)), key=lambda i: -self.segments[i].loudness)[::every]
        made = type(self)([self.segments[i] for i in order], self.levels)
        made.runs = [self.runs[i] for i in order] if self.runs else []
        return made

    def with_levels(self, levels: Levels) -> Predictor:
        """The same at other levels of noise; without gains."""
        return type(self)(self.segments, levels)

    def closer(self, vector: np.ndarray) -> Predictor:
        """The same with the gains of a parameter vector beside a smaller random force: the likeliest follows what a
        missing effect would explain.
        """
        found = self
        for part in CLOSER:
            levels = replace(self.levels, force=max(part * self.levels.force, LIMITS["force"][0]))
            if levels == found.levels:
                continue
            found = self.with_levels(levels).filtered(vector)
            white = np.concatenate([found._white(run, run.innovations) for run in found.runs])
            if np.mean(np.minimum(white**2, LOST**2)) < FAR:
                break
        return found

    def tuned(self, vector: np.ndarray, names: Sequence[str]) -> Predictor:
        """The same with the gains of a parameter vector, at levels of noise of a larger likelihood if there are any.

        names : of the levels.
        """
        best = self.filtered(vector).centred(vector)
        levels, before = likeliest(best, vector, names), float(np.sum(best.log_likelihood()))
        for part in PARTS if levels != best.levels else ():
            moved = best.with_levels(between(best.levels, levels, part)).filtered(vector)
            if np.sum(moved.log_likelihood()) > before + GAIN:
                return moved
        return best

    def centred(self, vector: np.ndarray) -> Predictor:
        """The same with the null shift of each segment that is likeliest at the vector of its gains."""
        if not self.levels.null:
            return self
        with ThreadPoolExecutor(workers()) as pool:
            shifts, foreseen = zip(*pool.map(lambda run: self._null_shift(vector, run), self.runs), strict=True)
        if sum(foreseen) < GAIN:
            return self
        moved = type(self)([s.shifted(m) for s, m in zip(self.segments, shifts, strict=True)], self.levels)
        found = moved.filtered(vector)
        gained = float(np.sum(found.log_likelihood()) - np.sum(self.log_likelihood()))
        return found.centred(vector) if gained > GAIN else self

    def _null_shift(self, vector: np.ndarray, run: FilteredSegment) -> tuple[float, float]:
        """Null shift of least residuals [-], and the gain in log likelihood that it foresees, to first order."""
        r = self._run(vector, run, False)
        d = self._by_null(vector, run, r)
        power = float(d @ d) + self.levels.null**-2
        shift = min(max(-float(d @ r) / power, -NULL_MOST), NULL_MOST)
        return shift, -shift * (float(d @ r) + 0.5 * shift * power)

    def _by_null(self, vector: np.ndarray, run: FilteredSegment, r: np.ndarray) -> np.ndarray:
        """Change of a run's residuals r at a vector by the null shift, both of shape (N,)."""
        moved = replace(run, segment=run.segment.shifted(NULL_STEP))
        return (self._run(vector, moved, False) - r) / NULL_STEP

    def _filter(self, vector: np.ndarray, s: Segment) -> FilteredSegment:
        table, n, levels = vector[:TABLE], len(s.commands), self.levels
        cutoff = cutoff_of(vector, s.dt)
        codes = [*coordinates(table), FORCE, NULL, BIAS, *([FILTERED, FILTER_RATE] if cutoff else [])]
        numbers = np.array([*codes, *([] if s.pressure is None else [PRESSURE_OFFSET])], dtype=np.int64)
        size, channels = len(numbers), len(s.noise)
        gains, sensing = np.zeros((n, size, channels)), np.zeros((n, size, channels))
        whitening, out = np.zeros((n, channels, channels)), np.zeros((n, channels))
        transition = np.zeros((n, size, size))
        path = kalman(
            *(FULL_LAYOUT.alone(table)[0], s.commands, s.command_before, s.measured(vector[TABLE]), numbers),
            *(*deviations(table, s, levels, numbers), s.found_by, start_state(table, s), self.decay(s)),
            *(s.dt, TOLERANCE, cutoff, vector[TABLE + 2], gains, whitening, out, transition, sensing),
        )
        return FilteredSegment(s, numbers, gains, whitening, out, path, transition, sensing)

    def decay(self, s: Segment) -> float:
        """Part of the random force that is left after a sample [-]."""
        return math.exp(-s.dt / self.levels.memory)

    def relevelled(self, vector: np.ndarray, levels: Levels) -> float:
        """Log likelihood at other levels of noise, to first order [nats]."""
        other = Predictor(self.segments, levels)

        def one(run: FilteredSegment) -> float:
            s, force = run.segment, int(np.flatnonzero(run.codes == FORCE)[0])
            transition = run.transition
            if levels.memory != self.levels.memory:
                transition = transition.copy()
                transition[:, force] *= other.decay(s) / self.decay(s)
            given = deviations(vector[:TABLE], s, levels, run.codes)
            block = max(round(1.0 / s.dt), 1)
            return float(
                np.sum(
                    relevelled(
                        *(s.measured(vector[TABLE]), run.gains, run.innovations, transition, run.sensing),
                        *(*given, s.found_by, s.start, block),
                    )
                )
            )

        with ThreadPoolExecutor(workers()) as pool:
            return sum(pool.map(one, self.runs))

    def log_likelihood(self) -> np.ndarray:
        """Log likelihood of the filter's own innovations by block of a second, shape (b,); −inf where a run is lost."""
        found = []
        for run in self.runs:
            w, white = self._seen(run.segment, run.weights), self._white(run, run.innovations)
            with np.errstate(divide="ignore"):
                terms = np.sum(np.where(w > 0.0, np.log(w) - 0.5 * white**2, 0.0), axis=1)
            found.append(np.bincount(self._blocks(run), np.nan_to_num(terms, nan=-(LOST**2))))
        return np.concatenate(found)

    def _seen(self, s: Segment, samples: np.ndarray) -> np.ndarray:
        """The samples of a segment that count, of shape (n, …)."""
        return samples[s.start :]

    def _white(self, run: FilteredSegment, innovations: np.ndarray) -> np.ndarray:
        """Innovations (n, m) whitened, of the samples that count."""
        return self._seen(run.segment, np.einsum("ncd,nd->nc", run.whitening, innovations))

    def _blocks(self, run: FilteredSegment) -> np.ndarray:
        """Number of the block of a second of each sample that counts."""
        places = self._seen(run.segment, np.arange(len(run.segment.commands)))
        return (places - places[0]) // max(round(1.0 / run.segment.dt), 1)

    @property
    def count(self) -> int:
        """Number of residuals that count."""
        return sum(int(np.count_nonzero(self._seen(r.segment, r.weights))) for r in self.runs)

    def residuals(self, vectors: np.ndarray) -> np.ndarray:
        """Whitened innovations for rows of parameter vectors, shape (m, WIDTH) → (m, N).

        Each at the null shift that leaves least, to first order (variable projection: Golub and Pereyra 1973).
        """
        tasks, k = [(vector, run, i > 0) for i, vector in enumerate(vectors) for run in self.runs], len(self.runs)
        if len(vectors) > 1:
            for run in self.runs:
                run.pace = np.empty((len(run.segment.commands), 1 + MOST))
        with ThreadPoolExecutor(workers()) as pool:
            every = list(pool.map(lambda t: self._run(*t), tasks[:k]))
            every += pool.map(lambda t: self._run(*t), tasks[k:])
            if self.levels.null:
                nulls = list(pool.map(lambda run, r: self._null_direction(vectors[0], run, r), self.runs, every[:k]))
                every = [without(nulls[i % k], r) for i, r in enumerate(every)]
        for run in self.runs:
            run.pace = NO_PACE
        return np.array([np.concatenate(every[i * k : (i + 1) * k]) for i in range(len(vectors))])

    def _null_direction(self, vector: np.ndarray, run: FilteredSegment, r: np.ndarray) -> np.ndarray:
        """`by_null` of a run under its gains, made once from its residuals r at a vector."""
        if run.by_null is None:
            d = self._by_null(vector, run, r)
            run.by_null = d / math.sqrt(float(d @ d) + self.levels.null**-2)
        return run.by_null

    def _run(self, vector: np.ndarray, run: FilteredSegment, following: bool) -> np.ndarray:
        s = run.segment
        out = np.empty((len(s.commands), len(s.noise)))
        following = following and len(run.pace) > 0
        predict(
            *(FULL_LAYOUT.alone(vector[:TABLE])[0], s.commands, s.command_before, s.measured(vector[TABLE]), run.codes),
            *(run.gains, start_state(vector[:TABLE], s), self.decay(s), s.dt, TOLERANCE),
            *(cutoff_of(vector, s.dt), vector[TABLE + 2], run.pace, following, out),
        )
        return np.clip(np.nan_to_num(self._white(run, out), nan=LOST, posinf=LOST, neginf=-LOST), -LOST, LOST).ravel()

    def run_sizes(self) -> list[int]:
        """Number of residuals of each run."""
        return [len(run.segment.noise) * len(self._blocks(run)) for run in self.runs]

    def blocks(self) -> np.ndarray:
        """Number of the block of a second that each residual belongs to, shape (N,)."""
        found, first = [], 0
        for run in self.runs:
            numbers = first + self._blocks(run)
            found.append(np.repeat(numbers, len(run.segment.noise)))
            first = int(numbers[-1]) + 1
        return np.concatenate(found)


def without(direction: np.ndarray, residuals: np.ndarray) -> np.ndarray:
    """Residuals of a run less their part along a direction, both of shape (N,); those of a lost run as they are."""
    if np.max(np.abs(residuals)) >= LOST:
        return residuals
    return np.asarray(residuals - direction * float(direction @ residuals))


def deviations(
    table: np.ndarray, s: Segment, levels: Levels, codes: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Standard deviations of the coordinates at the first sample, of what a sample adds to them, and of the sensors.

    What a sample adds is of shape (2, s): while the state is found, when a loose filter follows the sensors, and then.
    """
    swing, rock = (
        max(2.0 * math.pi * float(table[INDEX[f"effects.{e}.frequency"]]), 1.0)
        for e in ("specimen_resonance", "base_flexibility")
    )
    force, left = max(levels.force * s.loudness, levels.least_force), math.exp(-s.dt / levels.memory)
    size = {
        POSITION: (math.hypot(s.noise[0], SPEED * table[LATE]), 0.02 * s.noise[0]),
        VELOCITY: (SPEED, 0.0),
        PRESSURE_A: (0.2 * table[INDEX["supply.supply_pressure"]], 0.0),
        SPECIMEN: (RESONANT * s.loudness / swing**2, 0.0),
        SPECIMEN_RATE: (RESONANT * s.loudness / swing, 0.0),
        ROD: (1e-5, 0.0),
        ROD_RATE: (1e-3, 0.0),
        BASE: (s.loudness / rock**2, 0.0),
        BASE_RATE: (s.loudness / rock, 0.0),
        LAGGED_ACCELERATION: (1.0, 0.0),
        LAGGED_POSITION: (s.noise[0], 0.0),
        FORCE: (force, force * math.sqrt(1.0 - left**2)),
        NULL: (0.0 if levels.null else levels.null_drift, levels.null_drift * math.sqrt(s.dt)),
        BIAS: (levels.bias, levels.bias_drift * math.sqrt(s.dt)),
        FILTERED: (1.0, 0.0),
        FILTER_RATE: (100.0, 0.0),
        PRESSURE_OFFSET: (0.0 if s.pressure is None else float(np.ptp(s.pressure)), 0.0),
    }
    first, settled = (np.array([size[int(c)][i] for c in codes]) for i in (0, 1))
    loose = max(force, SETTLING * s.loudness) * math.sqrt(1.0 - left**2)
    process = np.array([np.where(codes == FORCE, loose, settled), settled])
    sensors = [getattr(levels, name) * noise for name, noise in zip(SIGNALS, s.noise, strict=False)]
    return first, process, np.array(sensors)


def cutoff_of(vector: np.ndarray, dt: float) -> float:
    """Cut-off of the anti-aliasing filter of a parameter vector [Hz]; 0 where it has none."""
    lag = float(vector[TABLE + 1])
    return FILTER_DELAY / lag if lag > 0.05 * dt else 0.0


def start_state(vector: np.ndarray, s: Segment) -> np.ndarray:
    """State at a segment's first sample: the spool has followed the command, and the acceleration gives the load.

    A table whose transducer is late has moved on since. Backlash is left out: within its gap nothing pushes the table.
    """
    table, late, a = vector.copy(), float(vector[LATE]), float(s.acceleration[0])
    table[GAP] = 0.0
    moved = late * s.velocity
    gained = late * a if math.isfinite(a) else 0.0
    state = moving_state(table, float(s.position[0]) + moved, s.velocity + gained, a, s.command_before)
    state[LAGGED_POSITION] -= moved
    remember(table, state, s.past, s.slid, s.dt)
    state[CLOCK] = s.begin
    return state


LIMITS = {  # within which levels of noise are estimated; beside a larger force no parameter is held where it should be
    "force": (1e-4, 0.3),
    "acceleration": (1.0, 1e3),
    "position": (1.0, 1e3),
    "pressure": (1.0, 1e3),
    "memory": (4e-3, 0.1),
}
FACTORS = (4.0, 1.6)  # by which they are moved, as long as that helps
GAIN = 1.0  # in log likelihood from which a move counts [nats]
PARTS = (1.0, 0.5, 0.25)  # of the way that is tried: along a path the likelihood is foreseen only so far


def between(one: Levels, other: Levels, part: float) -> Levels:
    """Levels a part of the way from one to another, on a logarithmic scale."""
    pairs = zip(astuple(one), astuple(other), strict=True)
    return Levels(*(a if a == b else a ** (1.0 - part) * b**part for a, b in pairs))


def likeliest(prediction: Predictor, vector: np.ndarray, names: Sequence[str]) -> Levels:
    """Levels of the largest likelihood along the path of a filter: each moved by a factor as long as that helps."""
    levels, value = prediction.levels, prediction.relevelled(vector, prediction.levels)
    for factor in FACTORS:
        for name in names:
            for way in (1.0 / factor, factor):
                began = levels
                while (other := moved_level(levels, name, way)) != levels:
                    if not (new := prediction.relevelled(vector, other)) > value + GAIN:
                        break
                    levels, value = other, new
                if levels != began:
                    break
    return levels


def moved_level(levels: Levels, name: str, factor: float) -> Levels:
    """The same with one level moved by a factor within its limits."""
    low, high = LIMITS[name]
    return replace(levels, **{name: min(max(getattr(levels, name) * factor, low), high)})
