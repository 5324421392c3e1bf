"""Harmonic cancellation: what a periodic motion lacks in each harmonic is added to the reference, again and again.

Over a window of whole periods the accelerometer is compared with the wanted acceleration,

    E_n = (2/W) Σ (a_wanted − a_measured) exp(−j n ω t),

and the reference gets harmonics of acceleration amplitude R_n' = R_n + μ E_n/G_n, with position and velocity to match.
G_n, the acceleration per acceleration added, starts at one, what a loop that follows its reference has, and is learnt
from window to window, G_n' = G_n + κ (−ΔE_n − G_n ΔR_n)/ΔR_n. A window counts only where the wanted fundamental was
the same in it and in the one before. One table's harmonics are mixed by friction and soft zone, which G_n does not
know: where Σ|E_n|² of a window is well above the least so far, the R_n of the least come back and μ is halved; it
recovers by and by, and what is the least is slowly forgotten. The law under it sees nothing but another reference.

Not in the thesis, which measures the distortion (6.1) and leaves it. Verified against: a linear loop with known lag,
and the distortion of the simulated table's sine (benchmarks/control/harmonic_cancellation.py).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shake_ros.compiled import njit
from shake_ros.quantities import Parameters, quantity

# The state: these, then (harmonics, ·) rows of R before, R, E before, G, the sum of E, the best R, each as real and
# imaginary part. LEAST is the least Σ|E_n|² so far, 0 before the first window that counts; TRUST the part of μ in use.
PHASE, WINDOWS, COUNT, ENTERED, WANTED_RE, WANTED_IM, SUM_RE, SUM_IM, LEAST, TRUST = range(10)
HEAD = 10
ROW = 12
LEARNING_SHARE = 0.5  # κ
SAME = 0.05  # relative change of the wanted fundamental below which a window counts
LEAST_RESPONSE, LARGEST_RESPONSE = 0.2, 5.0  # |G_n| stays between
WORSE = 2.0  # times the least Σ|E_n|² above which the R_n of the least come back
FORGETTING = 1.03  # growth of the least from window to window
LEAST_TRUST, RECOVERY = 0.1, 1.1  # of μ: the smallest part in use, and its growth from window to window
LEAST_AMPLITUDE = 1e-3  # [m/s²] smaller changes of R_n teach nothing about G_n


@dataclass(frozen=True)
class HarmonicCancellation(Parameters):
    """How harmonics are cancelled."""

    fundamental_frequency: float = quantity("Hz", "of the periodic reference", low=0.05, high=50.0, live=True)
    harmonics: int = quantity("-", "highest order that is corrected, the first included", low=1, high=40)
    learning_gain: float = quantity("-", "mu, share of the error that a window corrects", low=0.0, high=1.0, live=True)
    settling_periods: int = quantity("-", "periods between a correction and its window", low=1, high=50)
    window_periods: int = quantity("-", "periods of a window", low=1, high=50)
    amplitude_limit: float = quantity("m/s^2", "largest amplitude added in a harmonic", low=0.0, high=100.0, live=True)


def initial_state(parameters: HarmonicCancellation) -> NDArray[np.float64]:
    """Nothing learnt, nothing added."""
    state = np.zeros(HEAD + ROW * parameters.harmonics)
    state[HEAD + 6 :: ROW] = 1.0
    state[TRUST] = 1.0
    return state


@njit
def limited(re, im, low, high):  # type: ignore[no-untyped-def]
    """The complex number with its magnitude between two bounds; zero becomes the lower one."""
    size = math.hypot(re, im)
    if size < low:
        return (re * low / size, im * low / size) if size > 0.0 else (low, 0.0)
    return (re * high / size, im * high / size) if size > high else (re, im)


@njit
def learn(row, error_re, error_im, gain, limit, known):  # type: ignore[no-untyped-def]
    """One harmonic's row after a window with E_n; `known` says that the window before counted as well."""
    moved_re, moved_im = row[2] - row[0], row[3] - row[1]
    square = moved_re * moved_re + moved_im * moved_im
    if known and square > LEAST_AMPLITUDE**2:
        miss_re = -(error_re - row[4]) - (row[6] * moved_re - row[7] * moved_im)
        miss_im = -(error_im - row[5]) - (row[6] * moved_im + row[7] * moved_re)
        row[6] += LEARNING_SHARE * (miss_re * moved_re + miss_im * moved_im) / square
        row[7] += LEARNING_SHARE * (miss_im * moved_re - miss_re * moved_im) / square
        row[6], row[7] = limited(row[6], row[7], LEAST_RESPONSE, LARGEST_RESPONSE)
    size = row[6] * row[6] + row[7] * row[7]
    row[0], row[1], row[4], row[5] = row[2], row[3], error_re, error_im
    row[2] += gain * (error_re * row[6] + error_im * row[7]) / size
    row[3] += gain * (error_im * row[6] - error_re * row[7]) / size
    row[2], row[3] = limited(row[2], row[3], 0.0, limit)


@njit
def judge(state, scale, harmonics):  # type: ignore[no-untyped-def]
    """Whether to go back to the best R_n after a window; in place, the best ones, their Σ|E_n|² and the trust."""
    total = 0.0
    for n in range(harmonics):
        place = HEAD + n * ROW + 8
        total += (scale * state[place]) ** 2 + (scale * state[place + 1]) ** 2
    least = state[LEAST] * FORGETTING
    if 0.0 < WORSE * least < total:
        state[LEAST], state[TRUST] = least, max(LEAST_TRUST, 0.5 * state[TRUST])
        return True
    state[TRUST] = min(1.0, RECOVERY * state[TRUST])
    state[LEAST] = least
    if least == 0.0 or total < least:
        state[LEAST] = total
        for n in range(harmonics):
            place = HEAD + n * ROW
            state[place + 10 : place + 12] = state[place + 2 : place + 4]
    return False


@njit
def end_window(state, p):  # type: ignore[no-untyped-def]
    """Learn from the sums of a window, in place, and start the next one."""
    scale = 2.0 / state[COUNT]
    re, im = scale * state[SUM_RE], scale * state[SUM_IM]
    wanted = math.hypot(re, im)
    same = math.hypot(re - state[WANTED_RE], im - state[WANTED_IM]) <= SAME * wanted
    counts = wanted > LEAST_AMPLITUDE and same
    if not counts:
        state[LEAST] = 0.0
    back = counts and judge(state, scale, int(p.harmonics))
    for n in range(int(p.harmonics)):
        row = state[HEAD + n * ROW : HEAD + (n + 1) * ROW]
        if counts:
            learn(
                row,
                scale * row[8],
                scale * row[9],
                state[TRUST] * p.learning_gain,
                p.amplitude_limit,
                state[WINDOWS] > 0.0,
            )
            if back:
                row[2], row[3] = row[10], row[11]
        else:
            row[0], row[1] = row[2], row[3]
            if wanted <= LEAST_AMPLITUDE:
                row[2], row[3] = 0.0, 0.0
        row[8], row[9] = 0.0, 0.0
    state[WINDOWS] = state[WINDOWS] + 1.0 if counts else 0.0
    state[WANTED_RE], state[WANTED_IM] = re, im
    state[COUNT], state[SUM_RE], state[SUM_IM] = 0.0, 0.0, 0.0


@njit
def step(state, settings, time, reference, measured_acceleration):  # type: ignore[no-untyped-def]
    """One sample.

    Parameters
    ----------
    state : from `initial_state` or the step before; not changed
    settings : array of one record, `packing.numbers` of the parameters
    time : of the sample, on any clock that keeps its origin [s]
    reference : (3,) wanted position [m], velocity [m/s], acceleration [m/s²]
    measured_acceleration : of the accelerometer [m/s²]

    Returns
    -------
    state : new array
    reference : new (3,) array with the harmonics added
    """
    following = state.copy()
    p = settings[0]
    omega = 2.0 * math.pi * p.fundamental_frequency
    period = 2.0 * math.pi / omega
    cycle = (1.0 + p.settling_periods + p.window_periods) * period
    place = time - math.floor(time / cycle) * cycle
    if place < following[PHASE] and following[COUNT] > 0.0:
        end_window(following, p)
        following[ENTERED] = time
    following[PHASE] = place
    blend = min(1.0, max(0.0, (time - following[ENTERED]) / period))
    blend = blend * blend * (3.0 - 2.0 * blend)
    inside = place >= (1.0 + p.settling_periods) * period
    added = np.zeros(3)
    missing = reference[2] - measured_acceleration
    for n in range(int(p.harmonics)):
        row = following[HEAD + n * ROW : HEAD + (n + 1) * ROW]
        rate = (n + 1) * omega
        c, s = math.cos(rate * time), math.sin(rate * time)
        re, im = row[0] + blend * (row[2] - row[0]), row[1] + blend * (row[3] - row[1])
        added[0] -= (re * c - im * s) / (rate * rate)
        added[1] += (re * s + im * c) / rate
        added[2] += re * c - im * s
        if inside:
            row[8] += missing * c
            row[9] -= missing * s
            if n == 0:
                following[SUM_RE] += reference[2] * c
                following[SUM_IM] -= reference[2] * s
    if inside:
        following[COUNT] += 1.0
    return following, reference + added
