"""The rules by which a test is assessed: each a line with what is asked, what was measured, and pass or fail.

The test response spectrum (TRS) is held against the required one (RRS) on the code's own grid. The strong part lies
between the first and the last time at which |a| reaches a share of its peak (IEC 60068-2-57); the duration from 5 to
75 % of the Arias intensity is that of SRP 3.7.1; stationarity is the spread of the rms of four equal pieces of the
strong part; the power spectral density is the strong part's, averaged over third octaves.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shake_ros.control.reference.baseline import filtered
from shake_ros.qualification.motion import aimed
from shake_ros.qualification.required import RequiredSpectrum
from shake_ros.quantities import Parameters, choice, quantity
from shake_ros.signals.response_spectrum import response_spectrum

Array = NDArray[np.float64]
PIECES = 4  # of the strong part


@dataclass(frozen=True)
class Rules(Parameters):
    """What a code asks of a test; content of config/qualification_rules."""

    name: str = choice("of the code")
    source: str = choice("clauses, and whether they were read in the original")
    per_octave: int = quantity("-", "frequencies of an octave; 0 = points_per_decade counts", low=0, high=96)
    points_per_decade: int = quantity("-", "frequencies of a decade; 0 = per_octave counts", low=0, high=1000)
    points_below: int = quantity("-", "frequencies at which the TRS may lie below the RRS", low=0, high=100)
    adjacent_below: int = quantity("-", "adjacent ones of them, at most", low=0, high=100)
    lowest_share: float = quantity("-", "of the RRS that the TRS keeps everywhere", low=0.1, high=1.0)
    over_share: float = quantity("-", "of the RRS that the TRS may reach; 0 = not limited", low=0.0, high=100.0)
    over_up_to: float = quantity("Hz", "up to which over_share counts", low=0.0, high=1000.0)
    over_points: int = quantity("-", "frequencies at which over_share may be exceeded", low=0, high=100)
    zero_period_share: float = quantity("-", "of the required ZPA that the motion's peak reaches", low=0.0, high=2.0)
    duration: float = quantity("s", "of the motion, at least", low=0.0, high=600.0)
    strong_share: float = quantity(
        "-", "of the peak, between whose first and last time the strong part lies", low=0.01, high=0.9
    )
    strong_duration: float = quantity("s", "of the strong part, at least", low=0.0, high=600.0)
    arias_duration: float = quantity("s", "from 5 to 75 % of the Arias intensity, at least", low=0.0, high=600.0)
    stationarity: float = quantity(
        "-", "largest over smallest rms of the strong part's quarters; 0 = reported only", low=0.0, high=100.0
    )
    aim: float = quantity("-", "target level over the RRS; a choice of this program", low=0.9, high=2.0)
    aim_last: float = quantity(
        "-", "the same at the last required frequency, reached over an octave", low=0.9, high=2.0
    )
    low_pass: float = quantity(
        "Hz", "of the measured acceleration before the TRS, without phase shift", low=0.0, high=2000.0
    )


@dataclass(frozen=True)
class Verdict:
    """One rule: what is asked, what was measured, whether it holds; None = reported, not required."""

    rule: str
    asked: str
    measured: str
    passed: bool | None


@dataclass(frozen=True)
class SpectrumAssessment:
    """A test held against its rules."""

    # frequencies, required, found: RRS and TRS on the code's grid, (m,) [Hz], [m/s²]
    frequencies: Array
    required: Array
    found: Array
    verdicts: tuple[Verdict, ...]  # one a rule

    @property
    def passed(self) -> bool:
        """Whether every rule that is asked holds."""
        return all(v.passed is not False for v in self.verdicts)

    @property
    def failing(self) -> str:
        """The rules that do not hold, with what was asked and measured."""
        return "; ".join(f"{v.rule}, {v.asked}: {v.measured}" for v in self.verdicts if v.passed is False)

    def content(self) -> dict[str, Any]:
        """Verdicts and spectra, for JSON."""
        return {
            "passed": self.passed,
            "rules": [asdict(v) for v in self.verdicts],
            "frequencies": self.frequencies.tolist(),
            "required": self.required.tolist(),
            "found": self.found.tolist(),
        }

    @property
    def ratio(self) -> Array:
        """TRS over RRS (m,) [-]."""
        return np.asarray(self.found / self.required)


def code_grid(required: RequiredSpectrum, rules: Rules) -> Array:
    """Frequencies at which the code compares the spectra [Hz]."""
    if rules.per_octave:
        return required.grid(rules.per_octave)
    decades = math.log10(required.frequencies[-1] / required.frequencies[0])
    ends = required.frequencies[0], required.frequencies[-1]
    return np.asarray(np.geomspace(*ends, math.ceil(decades * rules.points_per_decade) + 1))


def longest_run(flags: NDArray[np.bool_]) -> int:
    """Most true values next to one another.

    >>> longest_run(np.array([True, False, True, True]))
    2
    """
    most = now = 0
    for flag in flags:
        now = now + 1 if flag else 0
        most = max(most, now)
    return most


def strong_part(acceleration: Array, share: float) -> tuple[int, int]:
    """First and last sample at which |a| reaches a share of its peak."""
    high = np.flatnonzero(np.abs(acceleration) >= share * np.max(np.abs(acceleration)))
    return int(high[0]), int(high[-1])


def arias_times(acceleration: Array, time_step: float, low: float = 0.05, high: float = 0.75) -> tuple[float, float]:
    """When the Arias intensity reaches two shares of its end [s]."""
    energy = np.cumsum(np.square(acceleration))
    return (
        float(np.searchsorted(energy, low * energy[-1]) * time_step),
        float(np.searchsorted(energy, high * energy[-1]) * time_step),
    )


def density(acceleration: Array, time_step: float, low: float, high: float) -> tuple[Array, Array]:
    """One-sided power spectral density in third octaves, (m,) [Hz] and [(m/s²)²/Hz]."""
    f = np.fft.rfftfreq(acceleration.size, time_step)
    power = 2.0 * time_step / acceleration.size * np.abs(np.fft.rfft(acceleration)) ** 2
    centres = np.geomspace(low, high, max(2, round(3.0 * math.log2(high / low)) + 1))
    edge = 2.0 ** (1.0 / 6.0)
    return centres, np.array([np.mean(power[(f >= c / edge) & (f < c * edge)]) for c in centres])


def quarters(part: Array) -> float:
    """Largest over smallest rms of the equal pieces of a part [-]."""
    rms = [float(np.sqrt(np.mean(np.square(piece)))) for piece in np.array_split(part, PIECES)]
    return max(rms) / min(rms)


def measured_motion(acceleration: Array, time_step: float, rules: Rules) -> Array:
    """The measured acceleration that is assessed: its mean at rest taken off, low-passed as the rules say."""
    still = acceleration - np.mean(acceleration[: max(8, round(0.3 / time_step))])
    return filtered(still, time_step, 0.0, rules.low_pass)


def assess(motion: Array, time_step: float, required: RequiredSpectrum, rules: Rules) -> SpectrumAssessment:
    """The verdicts on a motion, (n,) as of `measured_motion` [m/s²]."""
    f = code_grid(required, rules)
    asked = required.at(f)
    found = np.abs(response_spectrum(motion, time_step, f, required.damping, band_limited=True).acceleration)
    return SpectrumAssessment(
        f, asked, found, (*_spectrum(f, found / asked, rules), *_time(motion, time_step, required, rules))
    )


@dataclass(frozen=True)
class Tested:
    """One run."""

    drive: Array  # (n, 3) [m], [m/s], [m/s²]
    motion: Array  # (n,) measured acceleration as it is assessed [m/s²]
    assessment: SpectrumAssessment  # its verdicts
    matched: Array  # (m,) TRS at the frequencies of `motion.aimed` [m/s²]
    error: float  # rms of ln(TRS/aim) over those of them within the required band [-]


def tested(
    drive: Array, acceleration: Array, time_step: float, required: RequiredSpectrum, rules: Rules, per_octave: int
) -> Tested:
    """A run from its drive and its measured acceleration (n,) [m/s²]; per_octave : frequencies that are matched."""
    motion = measured_motion(acceleration, time_step, rules)
    f, levels = aimed(required, per_octave, rules.aim, rules.aim_last)
    found = np.abs(response_spectrum(motion, time_step, f, required.damping, band_limited=True).acceleration)
    inside = f <= required.frequencies[-1] * (1.0 + 1e-9)
    error = float(np.sqrt(np.mean(np.square(np.log(found / levels)[inside]))))
    return Tested(drive, motion, assess(motion, time_step, required, rules), found, error)


def _spectrum(f: Array, ratio: Array, rules: Rules) -> list[Verdict]:
    """The rules of the spectrum."""
    below = ratio < 1.0
    grid = f"1/{rules.per_octave} octave" if rules.per_octave else f"{rules.points_per_decade} points a decade"
    least = int(np.argmin(ratio))
    lines = [
        Verdict(
            f"points of the TRS below the RRS ({f.size} at {grid}, {f[0]:g} to {f[-1]:g} Hz)",
            f"at most {rules.points_below}",
            str(int(below.sum())),
            int(below.sum()) <= rules.points_below,
        ),
        Verdict(
            "adjacent points below",
            f"at most {rules.adjacent_below}",
            str(longest_run(below)),
            longest_run(below) <= rules.adjacent_below,
        ),
        Verdict(
            "lowest TRS/RRS",
            f"at least {rules.lowest_share:.2f}",
            f"{ratio[least]:.3f} at {f[least]:.3g} Hz",
            bool(ratio[least] >= rules.lowest_share),
        ),
    ]
    limited = f <= rules.over_up_to if rules.over_up_to else np.full(f.size, True)
    most = int(np.argmax(np.where(limited, ratio, 0.0)))
    text = f"{ratio[most]:.3f} at {f[most]:.3g} Hz, mean {float(np.mean(ratio)):.3f}"
    if rules.over_share:
        over = int(np.sum(ratio[limited] > rules.over_share))
        wanted = f"at most {rules.over_share:.2f}{f' up to {rules.over_up_to:g} Hz' if rules.over_up_to else ''}"
        wanted += f" but at {rules.over_points} points" if rules.over_points else ""
        lines.append(Verdict("over-test, largest TRS/RRS", wanted, f"{text}, {over} above", over <= rules.over_points))
    else:
        lines.append(Verdict("over-test, largest TRS/RRS", "–", text, None))
    return lines


def _time(a: Array, h: float, required: RequiredSpectrum, rules: Rules) -> list[Verdict]:
    """The rules of the motion in time."""
    peak = float(np.max(np.abs(a)))
    needed = rules.zero_period_share * required.zero_period
    first, last = strong_part(a, rules.strong_share)
    five, much = arias_times(a, h)
    begun, all_but = arias_times(a, h, 0.001, 0.999)
    strong, arias, whole = (last - first) * h, much - five, all_but - begun
    spread = quarters(a[first : last + 1])
    _, power = density(a[first : last + 1], h, float(required.frequencies[0]), float(required.frequencies[-1]))

    def least(rule: str, limit: float, value: float) -> Verdict:
        return Verdict(
            rule, f"at least {limit:g} s" if limit else "–", f"{value:.1f} s", value >= limit if limit else None
        )

    return [
        Verdict("zero-period acceleration", f"at least {needed:.3g} m/s²", f"{peak:.3g} m/s²", peak >= needed),
        least("duration (0.1 to 99.9 % of the Arias intensity)", rules.duration, whole),
        least(
            f"strong part, between the first and the last {100.0 * rules.strong_share:g} % of the peak",
            rules.strong_duration,
            strong,
        ),
        least("strong motion, 5 to 75 % of the Arias intensity", rules.arias_duration, arias),
        Verdict(
            "stationarity: largest over smallest rms of the strong part's quarters",
            f"at most {rules.stationarity:g}" if rules.stationarity else "–",
            f"{spread:.2f}",
            spread <= rules.stationarity if rules.stationarity else None,
        ),
        Verdict(
            "power spectral density of the strong part, third octaves",
            "–",
            f"largest over smallest {float(power.max() / max(power.min(), 1e-300)):.3g}",
            None,
        ),
    ]
