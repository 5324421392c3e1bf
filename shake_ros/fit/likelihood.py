"""The likelihood of a model given recordings: residuals of unit variance, and its logarithm by block of time.

Of a table they are the whitened innovations of a predictor (prediction.py); of a reduced model and of a force-driven
axis what their free runs leave, the limit of a predictor that never corrects.
"""

from __future__ import annotations

import copy
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from shake_ros.fit.declared_model import DeclaredModel
from shake_ros.fit.least_squares import difference_of
from shake_ros.fit.recording_problem import RecordingProblem
from shake_ros.fit.records import Record, windows

LOST = 1e3  # weighted residual of a run that ends in no number


@dataclass(frozen=True)
class Levels:
    """Standard deviations of the noise.

    Attributes
    ----------
    position, acceleration, pressure : of the sensors, in parts of what the recordings show [-].
    force : of the random force, in parts of the segment's acceleration [-]. memory : of that force [s].
    least_force : of the random force at least, per moved mass [m/s²].
    null, null_drift : of a segment's own null shift, 0 where it has none [-], and of its drift [1/√s].
    bias, bias_drift : of the accelerometer's bias [m/s²] and of its drift [m/s²/√s].
    """

    position: float = 1.0
    acceleration: float = 1.0
    force: float = 0.3
    memory: float = 0.03
    least_force: float = 0.0
    null: float = 0.0
    null_drift: float = 1e-5
    bias: float = 0.1
    bias_drift: float = 1e-4
    pressure: float = 1.0


class Likelihood(ABC):
    """Recordings at levels of noise, to which models are fitted; vectors are rows of parameters, shape (m, width).

    Attributes
    ----------
    levels : of noise. floor : fall of the logarithm of what is left by which an effect counts, whatever the noise.
    difference : step of differences, as a part of a parameter's scale or of its value if that is larger.
    """

    levels: Levels
    floor: float = 2e-3  # no model of a real table is right to a thousandth
    difference: float

    @property
    @abstractmethod
    def own_levels(self) -> tuple[str, ...]:
        """Names of the levels that are a recording's own."""

    @abstractmethod
    def with_levels(self, levels: Levels) -> Likelihood:
        """The same at other levels of noise."""

    @abstractmethod
    def filtered(self, vector: np.ndarray) -> Likelihood:
        """The same with what it takes from a model, at a parameter vector, shape (width,)."""

    @abstractmethod
    def tuned(self, vector: np.ndarray, names: Sequence[str]) -> Likelihood:
        """`filtered`, at levels of noise of a larger likelihood if there are any. names : of the levels."""

    def closer(self, vector: np.ndarray) -> Likelihood:
        """The same at a parameter vector, beside less process noise; here beside none."""
        return self.filtered(vector)

    @abstractmethod
    def part(self, seconds: float) -> Likelihood:
        """The same of about so many seconds."""

    @abstractmethod
    def residuals(self, vectors: np.ndarray) -> np.ndarray:
        """Residuals of unit variance where a model is right, shape (m, n)."""

    @abstractmethod
    def log_likelihood(self) -> np.ndarray:
        """Log likelihood at the vector of `filtered` by block, shape (b,); far below all others where a run is lost."""

    @property
    @abstractmethod
    def count(self) -> int:
        """Number of independent residuals."""

    @abstractmethod
    def run_sizes(self) -> list[int]:
        """Number of residuals of each run."""


class FreeRuns(Likelihood):
    """Free runs of a model over recordings, at the one level of noise that they leave.

    Velocity and acceleration count; the position drifts with the error of a run's first velocity. Within the noise,
    with the floor below which no model is expected to be right, none is better than another.
    """

    floor = 0.05  # a free run leaves more than the noise of any model, and every effect takes some of that
    least: ClassVar[float] = 1.0  # level of noise at least

    def __init__(self, records: Sequence[Record], model: DeclaredModel, levels: Levels) -> None:
        self.records, self.model, self.levels = list(records), model, levels
        self._problem = RecordingProblem(self.records, model)
        self._problem.position_weights = [0.0] * len(records)
        self.difference = difference_of(self._problem)
        self._found: np.ndarray | None = None  # what the runs at a vector leave, in parts of the sensors' noise

    @property
    def own_levels(self) -> tuple[str, ...]:
        """Of the position, for all that is compared."""
        return ("position",)

    def with_levels(self, levels: Levels) -> FreeRuns:
        """The same at another level of noise, of which it has but the one."""
        made = copy.copy(self)
        made.levels = Levels(position=levels.position)
        return made

    def filtered(self, vector: np.ndarray) -> FreeRuns:
        """The same with the runs at a parameter vector."""
        made = copy.copy(self)
        made._found = self._left(vector[None, :])[0]
        return made

    def tuned(self, vector: np.ndarray, names: Sequence[str]) -> FreeRuns:
        """The same with the runs at a parameter vector, and at the level of noise that they leave."""
        made = self.filtered(vector)
        assert made._found is not None
        level = max(float(np.sqrt(np.sum(made._found**2) / self.count)), self.least)
        return made.with_levels(replace(self.levels, position=level)) if "position" in names else made

    def part(self, seconds: float) -> FreeRuns:
        """The same on evenly spread pieces of the recordings, without runs."""
        return type(self)(windows(self.records, seconds), self.model, self.levels)

    def _left(self, vectors: np.ndarray) -> np.ndarray:
        """Residuals in parts of the sensors' noise, shape (m, n)."""
        found = self._problem.residuals(vectors[:, : len(self.model.layout.names)])
        return np.clip(np.nan_to_num(found, nan=LOST, posinf=LOST, neginf=-LOST), -LOST, LOST)

    def residuals(self, vectors: np.ndarray) -> np.ndarray:
        """Residuals at the level of noise."""
        return self._left(vectors) / self.levels.position

    def log_likelihood(self) -> np.ndarray:
        """Log likelihood of its runs by block of time."""
        assert self._found is not None
        blocks, r = self._problem.blocks(), self._found / self.levels.position
        left, count = np.bincount(blocks, r**2), np.bincount(blocks, self._problem.independent())
        return np.asarray(-count * np.log(self.levels.position) - 0.5 * np.maximum(left, self.least * count))

    @property
    def count(self) -> int:
        """Number of independent residuals."""
        return round(float(np.sum(self._problem.independent())))

    def run_sizes(self) -> list[int]:
        """Number of residuals of each recording."""
        return self._problem.run_sizes()


class ShakenRuns(FreeRuns):
    """Free runs of a table that something beside its command shakes, below the frequency up to which that explains it.

    What counts as noise there is what a linear filter of the command leaves: a mark, which a model may beat.
    """

    floor = Likelihood.floor
    least = 0.0
