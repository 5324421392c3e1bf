"""The motion of a test: seeded random phases, or a record, under an envelope, matched to a required spectrum.

Rise, strong part and decay as of multi-frequency tests (IEEE 344, IEC 60068-2-57, AC156: 30 s with a strong part of
20 s); of several seeds the one is taken that fits the table and has the lowest peak. The result ends at
rest and is given with its exact velocity and displacement.

To match a spectrum first the motion's Fourier amplitudes, then wavelets, are adjusted.

Wavelets: L. Al Atik and N. Abrahamson, Earthquake Spectra 26 (2010), 601–617, tapered cosines whose place makes the
oscillator's response to each largest where its response to the record is. A_i(t_i), the response of oscillator i at
the time of its peak to wavelet j, is a matrix C; C b = what is missing gives the amplitudes b. The wavelets hold no
static part, so velocity and displacement stay near rest, and `baseline.end_at_rest` takes out what is left. The zero
period is one more row, the record itself where it is largest, with a wavelet of the last frequency centred there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shake_ros.control.reference.baseline import end_at_rest, filtered, states_from_rest
from shake_ros.control.reference.motion import envelope, smooth_step
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.qualification.required import RequiredSpectrum
from shake_ros.quantities import Parameters, ShakeError, quantity
from shake_ros.signals.response_spectrum import resampled, response_spectrum

Array = NDArray[np.float64]
COUPLING = 0.7  # share of the off-diagonal terms that is solved for: more spoils the record, as the authors say
RIDGE = 0.3  # of the mean diagonal: neighbours that peak together do not fight with large wavelets
WIDTH, SLOPE = 1.178, -0.93  # γ = WIDTH f^SLOPE [s], of the authors
WAVELETS = 12  # rounds
CLOSE_ENOUGH = 0.01  # rms difference of the logarithms at which the corrections end


def scale_amplitudes(record: Array, time_step: float, frequencies: Array, target: Array, damping: float) -> Array:
    """The record with its Fourier amplitudes multiplied by target over response spectrum, its phases kept."""
    found = np.abs(response_spectrum(record, time_step, frequencies, damping, band_limited=True).acceleration)
    f = np.fft.rfftfreq(record.size, time_step)
    ratio = np.interp(np.log(np.maximum(f, 1e-9)), np.log(frequencies), np.log(target / found))
    return np.asarray(np.fft.irfft(np.fft.rfft(record) * np.exp(ratio), record.size))


def correct(
    record: Array,
    time_step: float,
    frequencies: Array,
    target: Array,
    damping: float,
    zero_period: float,
) -> Array:
    """The record with wavelets added, the best of some rounds (n,) [m/s²]; a round that makes it worse is halved.

    A record whose largest acceleration lies below `zero_period` [m/s²] is raised there; a larger one is left.
    """
    best, least, step = record, math.inf, 1.0
    now, addition = record, np.zeros_like(record)
    for _ in range(WAVELETS + 1):
        _, values, times = response_spectrum(now, time_step, frequencies, damping, band_limited=True)
        place = int(np.argmax(np.abs(now)))
        low = min(0.0, math.log(abs(float(now[place])) / zero_period))
        missed = np.append(np.log(np.abs(values) / target), low)
        off = float(np.sqrt(np.mean(np.square(missed)))) + abs(low)
        if off < least:
            best, least, step = now, off, min(1.0, 1.5 * step)
            missing = np.sign(values) * (target - np.abs(values))
            rigid = math.copysign(zero_period - abs(float(now[place])), float(now[place])) if low < 0.0 else 0.0
            waves, c = _coupled(record.size, time_step, frequencies, damping, times, place * time_step)
            addition = waves @ _amplitudes(c, np.append(missing, rigid))
        else:
            step *= 0.5
        if least < CLOSE_ENOUGH:
            break
        now = best + step * addition
    return best


def _coupled(n: int, h: float, frequencies: Array, damping: float, times: Array, peak: float) -> tuple[Array, Array]:
    """Wavelets (n, m + 1), and what each adds to the responses at `times` and to the record at `peak`, square."""
    t = np.arange(n) * h
    omega = 2.0 * math.pi * frequencies
    damped = omega * math.sqrt(1.0 - damping**2)
    lead = np.arctan(math.sqrt(1.0 - damping**2) / damping) / damped
    centres, rates = np.append(times - lead, peak), np.append(damped, damped[-1])
    widths = WIDTH * np.append(frequencies, frequencies[-1]) ** SLOPE
    since = t[:, None] - centres
    waves = np.cos(rates * since) * np.exp(-((since / widths) ** 2))
    tau = times[:, None] - t
    past = np.maximum(tau, 0.0)
    sine = omega[:, None] * (1.0 - 2.0 * damping**2) / math.sqrt(1.0 - damping**2) * np.sin(damped[:, None] * past)
    cosine = 2.0 * damping * omega[:, None] * np.cos(damped[:, None] * past)
    answer = np.where(tau >= 0.0, np.exp(-damping * omega[:, None] * past) * (sine + cosine), 0.0) * h
    return waves, np.vstack([answer @ waves, waves[round(peak / h)]])


def _amplitudes(c: Array, missing: Array) -> Array:
    """Amplitudes of the wavelets that add `missing` to what `c` couples them to.

    The record itself, the last, is weighed as the oscillators, whose resonance makes much more of their wavelets.
    """
    weight = np.ones(len(c))
    weight[-1] = math.sqrt(float(np.mean(np.abs(np.diag(c)[:-1]))))
    return weight * _solved(weight[:, None] * c * weight, weight * missing)


def _solved(c: Array, missing: Array) -> Array:
    """b of C b = missing, its couplings lessened and with a ridge."""
    own = np.diag(np.diag(c))
    c = own + COUPLING * (c - own)
    ridge = (RIDGE * float(np.mean(np.abs(np.diag(c))))) ** 2 * np.eye(len(c))
    return np.asarray(c.T @ np.linalg.solve(c @ c.T + ridge, missing))


COARSE = 0.004  # [s], about the time step at which a motion is matched
ABOVE = 1.5  # times the last frequency, to which the motion is kept at the last level
REST = 1.0  # [s] of rest at either end
PASSES, AMPLITUDES = 3, 6  # passes with wavelets, rounds of the amplitudes before them
FINE = 0.5  # frequencies of an octave times the damping, at least: below, the spectrum dips between them
WIDER = 0.5  # of the high-pass of a motion: that of its corrections, each of which would lower the first frequency
TOP = 1.05  # of the peak aimed at: what is above is cut before the wavelets; a spectrum's rigid end is the peak
RIGID = (1.2, ABOVE)  # times the last frequency, kept at the last level


@dataclass(frozen=True)
class MotionParameters(Parameters):
    """How a motion is made, and what of the table it may use."""

    rise: float = quantity("s", "from rest to the strong part", low=0.1, high=60.0)
    strong: float = quantity("s", "length of the strong part", low=1.0, high=600.0)
    decay: float = quantity("s", "from the strong part to rest", low=0.1, high=60.0)
    aim: float = quantity("-", "level aimed at over the required one", low=1.0, high=2.0)
    aim_last: float = quantity("-", "the same at the last required frequency", low=0.9, high=2.0)
    seeds: int = quantity(
        "-", "random phases tried; of those that fit, the one with the lowest peak is kept", low=1, high=100
    )
    high_pass: float = quantity("-", "lower end of the motion over the first required frequency", low=0.1, high=1.0)
    per_octave: int = quantity("-", "frequencies per octave at which it is matched", low=3, high=48)
    position_share: float = quantity("-", "usable share of half the stroke", low=0.01, high=1.0)
    velocity_share: float = quantity("-", "usable share of the velocity left at each acceleration", low=0.01, high=1.0)
    force_share: float = quantity("-", "usable share of the largest force", low=0.01, high=1.0)


class Demand(NamedTuple):
    """What a motion uses of a table, each over what it may use [-]; above 1 does not fit."""

    position: float
    velocity: float
    force: float


def demand(states: Array, table: TableParameters, parameters: MotionParameters) -> Demand:
    """Shares of the envelope that a motion (n, 3) uses.

    The velocity that is left at an acceleration a is v √(1 − |a|/a_max), that of the valve fully open (3.17); above
    a_max the force shows that none is.
    """
    p, most = parameters, envelope(table)
    x, v, a = np.abs(states).T
    left = a < most.acceleration
    pressure = np.sqrt(1.0 - a[left] / most.acceleration)
    return Demand(
        float(x.max()) / (p.position_share * most.position),
        float(np.max(v[left] / pressure, initial=0.0)) / (p.velocity_share * most.velocity),
        float(a.max()) / (p.force_share * most.acceleration),
    )


def frequencies_to_match(required: RequiredSpectrum, per_octave: int) -> tuple[Array, Array]:
    """Frequencies and levels from the first required one to ABOVE the last."""
    dense = max(per_octave, math.ceil(FINE / required.damping))
    f = np.concatenate([required.grid(dense), required.frequencies[-1] * np.array(RIGID)])
    return f, required.at(f)


def aimed(required: RequiredSpectrum, per_octave: int, aim: float, last: float) -> tuple[Array, Array]:
    """Frequencies to match, and the levels aimed at: `aim` over the required ones, `last` from the last one on (m,).

    In between, over the last octave, the factor is straight in log–log.
    """
    f, levels = frequencies_to_match(required, per_octave)
    part = np.clip(np.log2(2.0 * f / required.frequencies[-1]), 0.0, 1.0)
    return f, levels * aim ** (1.0 - part) * last**part


def _aimed(required: RequiredSpectrum, parameters: MotionParameters) -> tuple[Array, Array]:
    return aimed(required, parameters.per_octave, parameters.aim, parameters.aim_last)


def shape(time: Array, parameters: MotionParameters) -> Array:
    """The envelope: REST, a smooth rise, one, a smooth decay, REST."""
    p, t = parameters, time - REST
    fall = (p.rise + p.strong + p.decay - t) / p.decay
    return np.asarray(smooth_step(t / p.rise)[0] * smooth_step(fall)[0])


def _step(sample_time: float) -> tuple[int, float]:
    factor = max(1, round(COARSE / sample_time))
    return factor, factor * sample_time


def random_phases(required: RequiredSpectrum, parameters: MotionParameters, time_step: float, seed: int) -> Array:
    """Noise under the envelope, its Fourier amplitudes roughly those of the spectrum (n,) [m/s²]."""
    p = parameters
    count = round((2.0 * REST + p.rise + p.strong + p.decay) / time_step) + 1
    f = np.fft.rfftfreq(count, time_step)
    low, high = p.high_pass * required.frequencies[0], ABOVE * required.frequencies[-1]
    level = np.where((f >= low) & (f <= high), required.at(np.maximum(f, low)) / np.sqrt(np.maximum(f, low)), 0.0)
    phases = np.random.RandomState(seed).uniform(0.0, 2.0 * np.pi, f.size)
    time: Array = np.arange(count, dtype=np.float64) * time_step
    noise: Array = np.fft.irfft(level * np.exp(1j * phases), count)
    return np.asarray(noise * shape(time, p))


def at_rest(record: Array, time_step: float, low: float) -> Array:
    """The record above `low` [Hz], still at both ends, velocity and displacement ending at zero."""
    pad = round(3.0 / (low * time_step))
    kept = filtered(np.pad(record, pad), time_step, low, 0.0)[pad:-pad]
    still = round(0.5 * REST / time_step)
    place = np.arange(kept.size)
    kept = kept * smooth_step(np.minimum(place, place[::-1]) / still)[0]
    return end_at_rest(kept, time_step)


def matched(
    record: Array,
    time_step: float,
    required: RequiredSpectrum,
    parameters: MotionParameters,
    target: Array | None = None,
    zero_period: float | None = None,
) -> Array:
    """The record with a response spectrum of `target` (n,) and a peak of `zero_period` [m/s²] at least.

    `target` belongs to `frequencies_to_match`; both are the required ones times `aim` where None.
    """
    f, levels = _aimed(required, parameters)
    wanted = levels if target is None else target
    peak = parameters.aim_last * required.zero_period if zero_period is None else zero_period
    keep = f * time_step < 0.4
    low = WIDER * parameters.high_pass * float(required.frequencies[0])
    top = TOP * max(peak, float(wanted[keep][-1]))
    for _ in range(PASSES):
        record = np.clip(record, -top, top)
        record = correct(record, time_step, f[keep], wanted[keep], required.damping, peak)
        record = at_rest(record, time_step, low)
    return record


def rough(record: Array, time_step: float, required: RequiredSpectrum, parameters: MotionParameters) -> Array:
    """The record with amplitudes scaled until its spectrum is about the required one times `aim`."""
    f, levels = _aimed(required, parameters)
    keep = f * time_step < 0.4
    for _ in range(AMPLITUDES):
        record = scale_amplitudes(record, time_step, f[keep], levels[keep], required.damping)
        record = at_rest(record, time_step, parameters.high_pass * float(required.frequencies[0]))
    return record


def synthesise(
    required: RequiredSpectrum,
    table: TableParameters,
    parameters: MotionParameters,
    sample_time: float,
    seed: int = 0,
    record: Array | None = None,
) -> Array:
    """Acceleration of a motion that meets a spectrum, at `sample_time`.

    Parameters
    ----------
    record : (n,) acceleration at `sample_time` to start from, in place of random phases [m/s²].

    Returns
    -------
    (n,) [m/s²]; `demand` says whether the table can make it.
    """
    factor, step = _step(sample_time)
    if record is not None:
        starts = [np.pad(filtered(record, sample_time, 0.0, 0.4 / step)[::factor], round(REST / step))]
    else:
        starts = [random_phases(required, parameters, step, 1000 * seed + k) for k in range(parameters.seeds)]
    rows = [rough(start, step, required, parameters) for start in starts]
    used = [
        (max(1.0, *demand(states_from_rest(row, step), table, parameters)), float(np.max(np.abs(row)))) for row in rows
    ]  # those that fit first, of them the one of the lowest peak
    best = matched(rows[used.index(min(used))], step, required, parameters)
    return fine(best, factor, sample_time)


def fine(record: Array, factor: int, sample_time: float) -> Array:
    """A record at the loop's sample time, at rest in the end."""
    return end_at_rest(resampled(record, factor, straight=False), sample_time) if factor > 1 else record


def corrected_drive(
    drive: Array,
    found: Array,
    peak: float,
    required: RequiredSpectrum,
    parameters: MotionParameters,
    sample_time: float,
    gain: float,
) -> Array:
    """The next drive (n,) from the last one, the spectrum that it made at `frequencies_to_match` and its peak [m/s²].

    The drive's own spectrum is raised by (aimed/found)^gain, frequency by frequency; its own peak likewise.
    """
    factor, step = _step(sample_time)
    coarse = drive[::factor]
    f, levels = _aimed(required, parameters)
    keep = f * step < 0.4
    own = np.ones_like(f)
    own[keep] = np.abs(response_spectrum(coarse, step, f[keep], required.damping, band_limited=True).acceleration)
    target = own * (levels / found) ** gain
    largest = float(np.max(np.abs(drive))) * (parameters.aim_last * required.zero_period / peak) ** gain
    record = matched(coarse, step, required, parameters, target, largest)
    return fine(record, factor, sample_time)[: drive.size]


def refusal(states: Array, table: TableParameters, parameters: MotionParameters) -> str:
    """Why a motion does not fit a table: the limit, by how much, and what would fit; empty where it fits."""
    used = demand(states, table, parameters)
    if max(used) <= 1.0:
        return ""
    over = {name: share for name, share in zip(used._fields, used, strict=True) if share > 1.0}
    # near the largest force no velocity is left: there the force is what tells
    name = "force" if "force" in over else max(over, key=lambda key: over[key])
    low, high = 0.0, 1.0  # the level that fits: velocity depends on it twice
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if max(demand(middle * states, table, parameters)) <= 1.0 else (low, middle)
    text = f"the motion needs {over[name]:.2f} times the {name} that the table may use; the same RRS scaled by "
    text += f"{math.floor(100.0 * low) / 100.0:g} fits"
    lighter = _payload(states, table, parameters)
    mass = table.value("body.specimen_mass")
    return text + (f", or a specimen of at most {lighter:.0f} kg in place of {mass:.0f} kg" if lighter >= 0.0 else "")


def _payload(states: Array, table: TableParameters, parameters: MotionParameters) -> float:
    """Largest specimen under which the motion fits, in whole kg; −1 where none is light enough."""
    low, high = -1, int(table.value("body.specimen_mass"))
    while low < high:
        middle = (low + high + 1) // 2
        lighter = table.with_values({"body.specimen_mass": float(middle)})
        low, high = (middle, high) if max(demand(states, lighter, parameters)) <= 1.0 else (low, middle - 1)
    return float(low)


def check_sampling(required: RequiredSpectrum, sample_time: float) -> None:
    """ShakeError where the sampling rate is too low for the last required frequency."""
    last = ABOVE * float(required.frequencies[-1])
    if last * sample_time > 0.4:
        raise ShakeError(
            f"{required.name}: asked to {last / ABOVE:g} Hz, which needs at least {last / 0.4:.0f} samples per second; "
            f"there are {1.0 / sample_time:g}"
        )
