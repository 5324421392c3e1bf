"""A test run by run: play, assess, correct, until every rule holds or a rule of abortion does.

Two ways to correct: with `learn`, the model of the feedforward is fitted to the last run and the motion stays; without
it, the drive's response spectrum is raised where the TRS was low, frequency by frequency. The model is the way where
the table answers out of proportion (a soft zone, a flexible specimen); the drive where a model does not get closer.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shake_ros.core.analysis.response_spectrum import response_spectrum
from shake_ros.core.plant.parameters import TableParameters
from shake_ros.core.quantities import Parameters, quantity
from shake_ros.iteration.drive import integrate
from shake_ros.qualification.assessment import Rules, SpectrumAssessment, assess, measured_motion
from shake_ros.qualification.motion import MotionParameters, aimed, corrected_drive, demand
from shake_ros.qualification.required import RequiredSpectrum

Array = NDArray[np.float64]


@dataclass(frozen=True)
class RunParameters(Parameters):
    """How a test is iterated, and when it is given up."""

    runs: int = quantity("-", "most runs", low=1, high=50)
    gain: float = quantity("-", "share of a spectrum's error that the next drive corrects", low=0.1, high=1.0)
    growth: float = quantity("-", "error over that of the previous run above which it grows", low=1.0, high=10.0)
    near_limit: float = quantity("-", "share of half the stroke above which the end stops are near", low=0.5, high=1.0)


@dataclass(frozen=True)
class Tested:
    """One run.

    Attributes
    ----------
    drive : (n, 3) [m], [m/s], [m/s²].
    motion : (n,) measured acceleration as it is assessed [m/s²].
    assessment : its verdicts.
    error : rms of ln(TRS/aim) over the matched frequencies [-].
    """

    drive: Array
    motion: Array
    assessment: SpectrumAssessment
    error: float


@dataclass(frozen=True)
class Test:
    """What is asked of whom: the spectrum, the rules, the table that it is to fit, the settings."""

    __test__ = False  # no test of pytest

    required: RequiredSpectrum
    rules: Rules
    table: TableParameters
    motion: MotionParameters
    running: RunParameters
    sample_time: float


def missed(
    motion: Array, sample_time: float, required: RequiredSpectrum, rules: Rules, per_octave: int
) -> tuple[Array, float]:
    """The TRS at the matched frequencies (m,) [m/s²], and rms of ln(TRS/aim) of those within the required band [-]."""
    f, levels = aimed(required, per_octave, rules.aim, rules.aim_last)
    found = np.abs(response_spectrum(motion, sample_time, f, required.damping, band_limited=True).acceleration)
    inside = f <= required.frequencies[-1] * (1.0 + 1e-9)
    return found, float(np.sqrt(np.mean(np.square(np.log(found / levels)[inside]))))


def failing(assessment: SpectrumAssessment) -> str:
    """The rules that do not hold, with what was asked and measured."""
    return "; ".join(f"{v.rule}, {v.asked}: {v.measured}" for v in assessment.verdicts if v.passed is False)


def given_up(test: Test, errors: list[float], position: float) -> str:
    """Why no further run is made; empty where one is."""
    p = test.running
    stop = 0.5 * test.table.value("body.stroke")
    if position >= p.near_limit * stop:
        return f"the table reached {1e3 * position:.0f} mm, the end stops are at {1e3 * stop:.0f} mm"
    if len(errors) >= 3 and errors[-1] > p.growth * errors[-2] and errors[-2] > p.growth * errors[-3]:
        listed = ", ".join(f"{100.0 * e:.1f}" for e in errors)
        return f"the spectrum's error grew twice ({listed} % rms of the logarithm)"
    if len(errors) < p.runs:
        return ""
    return f"not passed after {len(errors)} {'run' if len(errors) == 1 else 'runs'}"


def iterate_test(
    test: Test,
    first: Array,
    play: Callable[[TableParameters, Array, int], tuple[Array, Array]],
    model: TableParameters,
    learn: Callable[[TableParameters, int], TableParameters] | None = None,
    on_run: Callable[[int, Tested], None] = lambda _, __: None,
) -> tuple[list[Tested], str]:
    """Run after run.

    Parameters
    ----------
    first : (n, 3) the motion.
    play : plays a drive under a model in the run of this number and returns the measured acceleration (n,) [m/s²] and
        position (n,) [m].
    learn : the next model from this one and the recording of the run of this number; None corrects the drive.

    Returns
    -------
    (runs, reason) : at least one; `reason` is empty where the last one passed.
    """
    made, errors, drive, carried = list[Tested](), list[float](), first, model
    while True:
        acceleration, position = play(carried, drive, len(made))
        motion = measured_motion(acceleration, test.sample_time, test.rules)
        found, error = missed(motion, test.sample_time, test.required, test.rules, test.motion.per_octave)
        errors.append(error)
        made.append(Tested(drive, motion, assess(motion, test.sample_time, test.required, test.rules), errors[-1]))
        on_run(len(made), made[-1])
        if made[-1].assessment.passed:
            return made, ""
        reason = given_up(test, errors, float(np.max(np.abs(position))))
        if reason:
            return made, f"{reason}; what fails: {failing(made[-1].assessment)}"
        if learn is not None:
            carried = learn(carried, len(made) - 1)
            continue
        peak, gain = float(np.max(np.abs(motion))), test.running.gain
        following = corrected_drive(drive[:, 2], found, peak, test.required, test.motion, test.sample_time, gain)
        states = integrate(following, test.sample_time)
        used = max(demand(states, test.table, test.motion))
        if used > 1.0:
            return made, f"the next drive would need {used:.2f} times what the table may use"
        drive = states
