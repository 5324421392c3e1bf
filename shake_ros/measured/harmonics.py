"""Harmonic amplitudes of the acceleration under sinusoidal commands, measured for the thesis and made by a table.

`printed_parameters` are those of the full model as table 6.9 prints them, in the names of a table.

The print gives the friction's levels as forces, the Stribeck velocity and λ_1, λ_2 of the thesis's soft zone; a table
has the rise above the Coulomb level, the decay 1/v_s, and the soft zone's relative depth. P_0 is printed without a
unit; it is read in bar.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from shake_ros.physics.plant.simulation import initial_state, run_batch
from shake_ros.quantities import Parameters, ShakeError, quantity
from shake_ros.signals.thd import total_harmonic_distortion

LEAST_WINDOW, LONGEST_WINDOW = 0.5, 20.0  # of a segment of whole periods [s]
SETTLING = 0.5  # at least, before it [s]


@dataclass(frozen=True)
class HarmonicRun:
    """One measured run: command amplitude [-], frequency [Hz], {order: acceleration amplitude [m/s²]}.

    Raises
    ------
    ShakeError : a number that is not finite or not positive, an amplitude above 1, no fundamental.
    """

    amplitude: float
    frequency: float
    harmonics: Mapping[int, float]

    def __post_init__(self) -> None:
        _check("amplitude", self.amplitude, 1.0)
        _check("frequency", self.frequency)
        if not isinstance(self.harmonics, Mapping) or 1 not in self.harmonics:
            raise ShakeError("harmonics: the fundamental, order 1, is missing")
        for order, amplitude in self.harmonics.items():
            if isinstance(order, bool) or not isinstance(order, int) or order < 1:
                raise ShakeError(f"harmonics: order {order!r} is not a whole number from 1 on")
            _check(f"harmonics: order {order}", amplitude)

    @property
    def orders(self) -> np.ndarray:
        """Measured orders, ascending."""
        return np.array(sorted(self.harmonics))

    @property
    def measured(self) -> np.ndarray:
        """Measured amplitudes in the order of `orders` [m/s²]."""
        return np.array([self.harmonics[k] for k in self.orders])


def _check(name: str, value: object, high: float = math.inf) -> None:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if not (number and math.isfinite(value) and 0.0 < value <= high):  # type: ignore[arg-type, operator]
        raise ShakeError(f"{name} = {value!r} is not a positive number{f' up to {high:g}' if high < math.inf else ''}")


def whole_periods(frequency: float, sample_time: float, window: float) -> int:
    """Samples of the shortest segment of whole periods that is a whole number of samples and at least `window` [s].

    Raises
    ------
    ShakeError : where no such segment is shorter than LONGEST_WINDOW.

    >>> whole_periods(5.0, 1e-3, 0.5)
    600
    """
    first = max(1, math.ceil(window * frequency - 1e-9))
    for periods in range(first, max(first, math.floor(LONGEST_WINDOW * frequency)) + 1):
        samples = periods / (frequency * sample_time)
        if abs(samples - round(samples)) < 1e-6:
            return round(samples)
    raise ShakeError(
        f"frequency = {frequency:g} Hz: no number of whole periods within {LONGEST_WINDOW:g} s is a whole number of "
        f"samples of {sample_time:g} s"
    )


def sine_command(run: HarmonicRun, sample_time: float, length: int) -> np.ndarray:
    """u = A cos(2πft): starts at full speed, so that the table swings about where it stood; shape (length,)."""
    time = np.arange(length) * sample_time
    return np.asarray(run.amplitude * np.cos(2.0 * np.pi * run.frequency * time))


def amplitudes(acceleration: np.ndarray, sample_time: float, frequency: float, orders: np.ndarray) -> np.ndarray:
    """Amplitudes at multiples of `frequency` over whole periods.

    Parameters
    ----------
    acceleration : shape (..., n), n samples being whole periods.
    orders : shape (k,).

    Returns
    -------
    shape (..., k), in the unit of the input.
    """
    n = acceleration.shape[-1]
    time = np.arange(n) * sample_time
    basis = np.exp(-2j * np.pi * frequency * np.outer(time, orders))
    return np.asarray(2.0 / n * np.abs(acceleration @ basis))


class HarmonicProblem:
    """Residuals between simulated and measured harmonic amplitudes [m/s²], unweighted.

    Parameters
    ----------
    runs : measured.
    """

    sample_time = 1e-3  # [s]

    def __init__(self, runs: Sequence[HarmonicRun]) -> None:
        self.runs = list(runs)
        self._settled = [whole_periods(r.frequency, self.sample_time, SETTLING) for r in self.runs]
        self._commands = [
            sine_command(r, self.sample_time, first + whole_periods(r.frequency, self.sample_time, LEAST_WINDOW))
            for r, first in zip(self.runs, self._settled, strict=True)
        ]
        for run in self.runs:
            if run.orders[-1] * run.frequency * self.sample_time >= 0.5:
                raise ShakeError(
                    f"frequency = {run.frequency:g} Hz: order {run.orders[-1]} is not below half the sampling rate, "
                    f"{0.5 / self.sample_time:g} Hz"
                )
        self.measured = np.concatenate([r.measured for r in self.runs])

    @property
    def spans(self) -> list[slice]:
        """Where each run's amplitudes stand among `measured`."""
        ends = np.cumsum([len(r.orders) for r in self.runs]).tolist()
        return [slice(end - len(r.orders), end) for r, end in zip(self.runs, ends, strict=True)]

    def distortion(self, values: np.ndarray) -> np.ndarray:
        """THD of each run from amplitudes in the order of `measured`, shape (number of runs,) [-]."""
        return np.array([total_harmonic_distortion(values[span]) for span in self.spans])

    def part(self, indices: Sequence[int]) -> HarmonicProblem:
        """The same problem with some of the runs only."""
        return HarmonicProblem([self.runs[i] for i in indices])

    def steady(self, vectors: np.ndarray, index: int) -> np.ndarray:
        """Acceleration of run `index` over its whole periods for rows of parameters, shape (m, samples) [m/s²].

        At the first of these samples the command is at its peak.
        """
        starts = np.array([initial_state(v) for v in vectors])
        out = run_batch(vectors, starts, self._commands[index], self.sample_time, columns=(2,))
        return np.ascontiguousarray(out[:, self._settled[index] :, 0])

    def simulated(self, vectors: np.ndarray) -> np.ndarray:
        """Amplitudes of all runs for rows of parameters, shape (m, number of measured amplitudes) [m/s²]."""
        parts = [
            amplitudes(self.steady(vectors, i), self.sample_time, run.frequency, run.orders)
            for i, run in enumerate(self.runs)
        ]
        return np.concatenate(parts, axis=1)

    def residuals(self, vectors: np.ndarray) -> np.ndarray:
        """Simulated minus measured amplitudes [m/s²]."""
        return self.simulated(vectors) - self.measured


@dataclass(frozen=True)
class HarmonicAmplitudes:
    """Simulated amplitudes of the measured orders, in the order of `problem.measured`, shape (n,) [m/s²]."""

    problem: HarmonicProblem
    amplitudes: np.ndarray

    @property
    def rms(self) -> float:
        """Root mean square error of all amplitudes [m/s²]."""
        return float(np.sqrt(np.mean((self.amplitudes - self.problem.measured) ** 2)))

    @property
    def run_rms(self) -> np.ndarray:
        """The same for each run, shape (number of runs,) [m/s²]."""
        error = self.amplitudes - self.problem.measured
        return np.array([np.sqrt(np.mean(error[span] ** 2)) for span in self.problem.spans])


@dataclass(frozen=True)
class HarmonicAccount(HarmonicAmplitudes):
    """Simulated harmonics of all runs of a problem."""

    # THD of all orders below half the sampling rate, odd and even, shape (number of runs,) [-]
    whole_distortion: np.ndarray
    # per run the acceleration over its whole periods, from a peak of the command on, shape (samples,) [m/s²]
    traces: tuple[np.ndarray, ...]

    @property
    def distortion(self) -> np.ndarray:
        """THD of the measured orders, shape (number of runs,) [-]."""
        return self.problem.distortion(self.amplitudes)

    @property
    def distortion_error(self) -> np.ndarray:
        """THD minus the measured one, shape (number of runs,) [-]."""
        return self.distortion - self.problem.distortion(self.problem.measured)


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
    return HarmonicAccount(problem, np.concatenate(parts), np.array(whole), tuple(traces))


@dataclass(frozen=True)
class PrintedParameters(Parameters):
    """One column of table 6.9; the column without a soft zone has λ_1 = 1 and λ_2 = 0."""

    internal_leakage: float = quantity("m^3/(s*Pa)", "C_i", low=0.0, high=1e-6)
    external_leakage: float = quantity("m^3/(s*Pa)", "C_e", low=0.0, high=1e-6)
    coulomb_force: float = quantity("N", "F_c", low=0.0, high=1e6)
    static_force: float = quantity("N", "F_s", low=0.0, high=1e6)
    viscous: float = quantity("N*s/m", "F_v", low=0.0, high=1e6)
    stribeck_velocity: float = quantity("m/s", "v_s", low=1e-6, high=10.0)
    modulus: float = quantity("Pa", "E_0", low=1e6, high=1e11)
    reference_pressure: float = quantity("Pa", "P_0", low=1e3, high=1e8)
    slope: float = quantity("-", "m", low=0.0, high=300.0)
    air_fraction: float = quantity("-", "α", low=0.0, high=0.3)
    polytropic_exponent: float = quantity("-", "κ", low=0.3, high=2.0)
    lambda_1: float = quantity("-", "λ_1", low=0.01, high=100.0)
    lambda_2: float = quantity("-", "λ_2", low=0.0, high=100.0)
    sharpness: float = quantity("1/Pa", "μ", low=1e-7, high=1e-4)
    threshold: float = quantity("Pa", "P_Lt", low=1e4, high=1e7)

    def values(self) -> dict[str, float]:
        """The same by dotted names of a table.

        λ_1 multiplies the liquid's modulus and its slope; the air's share stays as it is, which at the printed α is
        below 2 % of the compliance from 10 bar on.
        """
        depth = 2.0 * self.lambda_2 / self.lambda_1 * math.tanh(self.sharpness * self.threshold)  # (6.20)
        return {
            "leakage.internal": self.internal_leakage,
            "leakage.external": self.external_leakage,
            "friction.coulomb_level": self.coulomb_force,
            "friction.stribeck_rise": self.static_force - self.coulomb_force,
            "friction.stribeck_decay": 1.0 / self.stribeck_velocity,
            "friction.viscous": self.viscous,
            "bulk_modulus.modulus": self.lambda_1 * self.modulus,
            "bulk_modulus.reference_pressure": self.reference_pressure,
            "effects.pressure_dependent_bulk_modulus.slope": self.lambda_1 * self.slope,
            "effects.entrained_air.fraction": self.air_fraction,
            "effects.entrained_air.polytropic_exponent": self.polytropic_exponent,
            "effects.soft_zone.depth": depth,
            "effects.soft_zone.threshold": self.threshold,
            "effects.soft_zone.sharpness": self.sharpness,
        }
