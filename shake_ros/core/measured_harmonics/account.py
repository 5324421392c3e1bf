"""What a table makes of the measured runs: amplitudes, distortion and a period of the acceleration."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from shake_ros.core.analysis.thd import total_harmonic_distortion
from shake_ros.core.measured_harmonics.harmonics import HarmonicProblem, amplitudes


@dataclass(frozen=True)
class HarmonicAccount:
    """Simulated harmonics of all runs of a problem.

    Attributes
    ----------
    amplitudes : of the measured orders, in the order of `problem.measured`, shape (n,) [m/s²].
    distortion : THD of the measured orders, shape (number of runs,) [-].
    whole_distortion : THD of all orders below half the sampling rate, odd and even, shape (number of runs,) [-].
    traces : per run the acceleration over its whole periods, from a peak of the command on, shape (samples,) [m/s²].
    """

    problem: HarmonicProblem
    amplitudes: np.ndarray
    distortion: np.ndarray
    whole_distortion: np.ndarray
    traces: tuple[np.ndarray, ...]

    @property
    def rms(self) -> float:
        """Root mean square error of all amplitudes [m/s²]."""
        return float(np.sqrt(np.mean((self.amplitudes - self.problem.measured) ** 2)))

    @property
    def run_rms(self) -> np.ndarray:
        """The same for each run, shape (number of runs,) [m/s²]."""
        error = self.amplitudes - self.problem.measured
        return np.array([np.sqrt(np.mean(error[span] ** 2)) for span in self.problem.spans])

    @property
    def distortion_error(self) -> np.ndarray:
        """THD minus the measured one, shape (number of runs,) [-]."""
        return self.distortion - measured_distortion(self.problem)


def measured_distortion(problem: HarmonicProblem) -> np.ndarray:
    """THD of the measured amplitudes of each run, shape (number of runs,) [-]."""
    return distortion(problem, problem.measured)


def distortion(problem: HarmonicProblem, values: np.ndarray) -> np.ndarray:
    """THD of each run from amplitudes in the order of `problem.measured`, shape (number of runs,) [-]."""
    return np.array([total_harmonic_distortion(values[span]) for span in problem.spans])


def account(problem: HarmonicProblem, vector: np.ndarray) -> HarmonicAccount:
    """Simulate all runs with one parameter vector, shape (len(NAMES),)."""
    traces, parts, whole = [], [], []
    for i, run in enumerate(problem.runs):
        trace = problem.steady(vector[None, :], i)[0]
        highest = math.ceil(0.5 / (run.frequency * problem.sample_time)) - 1
        every = amplitudes(trace, problem.sample_time, run.frequency, np.arange(1, highest + 1))
        traces.append(trace)
        parts.append(every[run.orders - 1])
        whole.append(total_harmonic_distortion(every))
    values = np.concatenate(parts)
    return HarmonicAccount(problem, values, distortion(problem, values), np.array(whole), tuple(traces))
