"""Each measured run predicted by a model that was fitted to the other runs only.

A model with many parameters follows a few amplitudes closely and still knows nothing; what it predicts for a run that
it has not seen tells the two apart, without any account of parameters.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shake_ros.core.identification.fit import Fit, fit
from shake_ros.core.measured_harmonics.harmonics import HarmonicProblem
from shake_ros.core.measured_harmonics.variants import LONG, SHORT

NEIGHBOURS = 3  # random starts around the solution of all runs, beside that solution itself
SPREAD = 0.3  # their logarithmic standard deviation


@dataclass(frozen=True)
class LeftOut:
    """Predictions of runs left out: `amplitudes` in the order of the measured ones [m/s²], shape (n,)."""

    problem: HarmonicProblem
    amplitudes: np.ndarray

    @property
    def rms(self) -> float:
        """Root mean square error over all amplitudes [m/s²]."""
        return float(np.sqrt(np.mean((self.amplitudes - self.problem.measured) ** 2)))

    @property
    def run_rms(self) -> np.ndarray:
        """The same for each run, shape (number of runs,) [m/s²]."""
        error = self.amplitudes - self.problem.measured
        return np.array([np.sqrt(np.mean(error[span] ** 2)) for span in self.problem.spans])


def predicted(problem: HarmonicProblem, fitted: Fit, index: int, neighbours: int = NEIGHBOURS) -> np.ndarray:
    """Amplitudes of run `index` by the model fitted to all other runs, shape (orders of the run,) [m/s²].

    The fit starts at the solution of all runs and at random places around it, and the best fit to the other runs
    counts. That solution has seen the run; where the other runs leave a direction open, the start shows through.
    """
    others = problem.part([i for i in range(len(problem.runs)) if i != index])
    rng = np.random.default_rng(index)
    factors = np.exp(SPREAD * rng.standard_normal((neighbours, len(fitted.x))))
    starts = [fitted.x, *np.clip(fitted.x * factors, fitted.free.low, fitted.free.high)]
    short = [fit(others, fitted.free, x, evaluations=SHORT, tolerance=1e-3) for x in starts]
    best = min(short, key=lambda f: f.cost)
    best = fit(others, fitted.free, best.x, evaluations=LONG, tolerance=1e-4)
    return np.asarray(problem.part([index]).simulated(fitted.free.vectors(best.x))[0])


def left_out(problem: HarmonicProblem, fitted: Fit, neighbours: int = NEIGHBOURS) -> LeftOut:
    """Every run predicted from the others.

    Parameters
    ----------
    fitted : fit to all runs, whose free parameters are fitted anew each time. neighbours : random starts around it.
    """
    parts = [predicted(problem, fitted, i, neighbours) for i in range(len(problem.runs))]
    return LeftOut(problem, np.concatenate(parts))
