"""Free runs of a table as the predictor's limit that never corrects, compared where motion is slow."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from shake_ros.fit.likelihood import LOST, Levels
from shake_ros.fit.prediction import LIMITS, SIGNALS, FilteredSegment, Predictor, moved_level
from shake_ros.fit.segment import Segment
from shake_ros.signals.velocity_filter import low_pass

SLOW = 40.0  # below which free runs are compared [Hz]
OVER_RIPPLES = 2e-2  # step of differences over what ripples in a free run with contacts


class SlowRuns(Predictor):
    """What free runs leave of velocity and acceleration below a frequency: where no predictor follows the contacts.

    The ringing of contacts follows their parameters so fast that a whole free run is a maze within some per cent of the
    truth; what is slow is a single valley from far off.
    """

    floor = 0.05  # contacts leave more than the noise of any model, and every effect takes some of that
    difference = OVER_RIPPLES

    def __init__(self, segments: Sequence[Segment], levels: Levels) -> None:
        super().__init__(segments, replace(levels, force=LIMITS["force"][0]))

    @property
    def own_levels(self) -> tuple[str, ...]:
        """Levels of the sensors."""
        return SIGNALS[: len(self.segments[0].noise)]

    def _every(self, s: Segment) -> int:
        """Samples from one that counts to the next: as many as are independent in the band."""
        return max(int(0.5 / (SLOW * s.dt)), 1)

    def _seen(self, s: Segment, samples: np.ndarray) -> np.ndarray:
        return samples[s.start :: self._every(s)]

    def _white(self, run: FilteredSegment, innovations: np.ndarray) -> np.ndarray:
        s = run.segment
        white = np.nan_to_num(run.weights * innovations, nan=LOST, posinf=LOST, neginf=-LOST)
        slow = low_pass(white.T, s.dt, SLOW).T * math.sqrt(self._every(s))
        slow[:, 0] = np.gradient(slow[:, 0], s.dt) * math.sqrt(3.0) / (2.0 * math.pi * SLOW)  # as of the velocity
        return self._seen(s, slow)

    def tuned(self, vector: np.ndarray, names: Sequence[str]) -> Predictor:
        """The same with the gains of a parameter vector, at the sensors' levels that its residuals show."""
        white = np.concatenate([self._white(run, run.innovations) for run in self.filtered(vector).runs])
        sizes = np.sqrt(np.mean(np.minimum(white, LOST) ** 2, axis=0))
        levels = self.levels
        for name, size in zip(self.own_levels, sizes, strict=True):
            levels = moved_level(levels, name, float(size)) if name in names else levels
        return self.with_levels(levels).filtered(vector).centred(vector)
