"""Required response spectra: a code's formula or a user's points, each at its damping.

AC156: ICC-ES Acceptance Criteria AC156, seismic certification by shake-table testing, horizontal and vertical RRS
    at 5 % damping, A_FLX from 1.3 to 8.3 Hz, falling to A_RIG at 33.3 Hz, straight lines in log–log.
    ASCE 7-16: A_FLX-H = S_DS (1 + 2 z/h) ≤ 1.6 S_DS, A_RIG-H = 0.4 S_DS (1 + 2 z/h), A_FLX-V = 0.67 S_DS,
    A_RIG-V = 0.27 S_DS.
    ASCE 7-22: the height factor becomes H_f/R_μ, H_f = 1 + a_1 z/h + a_2 (z/h)^10 with a_1 = min(1/T_a, 2.5) and
    a_2 = max(1 − (0.4/T_a)², 0), or 1 + 2.5 z/h where T_a is not known (13.3.1.1); the bound stays 1.6 S_DS.
RG 1.60: U.S. NRC Regulatory Guide 1.60, horizontal spectrum, control points A 33 Hz, B 9 Hz, C 2.5 Hz, D 0.25 Hz with
    the amplification factors of its table I; D as a displacement of 36 in for 1 g; log–log between points, log–log
    in damping between the five of the table.

None of these was read in the original for this file: the figures are those in general use, each YAML of
config/required_spectra says so, and a laboratory compares them with its own copy before it signs.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shake_ros.quantities import Parameters, ShakeError, choice, member_from, quantity, shown, strict_keys
from shake_ros.settings import find, read_yaml

Array = NDArray[np.float64]
GRAVITY = 9.80665  # [m/s²]
FLEXIBLE_BOUND = 1.6  # of S_DS
LEAST_SCALE = 1e-3
RG160_DAMPING = np.array([0.005, 0.02, 0.05, 0.07, 0.10])
RG160_FREQUENCY = np.array([0.25, 2.5, 9.0, 33.0])  # D, C, B, A [Hz]
RG160_FACTORS = np.array(  # rows by damping: D (of the displacement), C, B, A (of the acceleration)
    [
        [3.20, 5.95, 4.96, 1.0],
        [2.50, 4.25, 3.54, 1.0],
        [2.05, 3.13, 2.61, 1.0],
        [1.88, 2.72, 2.27, 1.0],
        [1.70, 2.28, 1.90, 1.0],
    ]
)
RG160_DISPLACEMENT = 36 * 0.0254  # [m] at 1 g


@dataclass(frozen=True)
class RequiredSpectrum:
    """What a test response spectrum has to reach."""

    name: str  # of the spectrum
    frequencies: Array  # (m,) rising [Hz]
    levels: Array  # (m,) [m/s²]
    damping: float  # ξ [-]
    zero_period: float  # acceleration that the motion itself has to reach [m/s²]
    source: str  # where its numbers are from

    def at(self, frequencies: Array) -> Array:
        """Levels along straight lines in log–log; beyond the ends those of the ends, (n,) [m/s²]."""
        found: Array = np.exp(np.interp(np.log(frequencies), np.log(self.frequencies), np.log(self.levels)))
        return found

    def grid(self, per_octave: int) -> Array:
        """Frequencies from the first to the last at 1/per_octave octave, both ends included (n,) [Hz]."""
        low, high = self.frequencies[0], self.frequencies[-1]
        count = math.ceil(per_octave * math.log2(high / low) - 1e-9)
        return np.asarray(np.geomspace(low, high, count + 1))

    def scaled(self, factor: float) -> RequiredSpectrum:
        """The same shape at another level; ShakeError where the factor is not within 0.001 … 1000."""
        if not LEAST_SCALE <= factor <= 1.0 / LEAST_SCALE:
            raise ShakeError(f"scale = {factor:g} is not within {LEAST_SCALE:g} … {1.0 / LEAST_SCALE:g}")
        name = self.name if factor == 1.0 else f"{self.name}, scaled by {factor:g}"
        levels, zero = factor * self.levels, factor * self.zero_period
        return RequiredSpectrum(name, self.frequencies, levels, self.damping, zero, self.source)


@dataclass(frozen=True)
class Ac156(Parameters):
    """The AC156 spectrum."""

    edition: str = choice("form of the height factor", ("asce_7_16", "asce_7_22"))
    direction: str = choice("of the axis", ("horizontal", "vertical"))
    s_ds: float = quantity("g", "S_DS, design spectral acceleration at short periods", low=0.001, high=10.0)
    height_ratio: float = quantity("-", "z/h, height of the attachment over that of the roof", low=0.0, high=1.0)
    period: float = quantity("s", "T_a of the building for asce_7_22; 0 = not known", low=0.0, high=20.0)
    ductility: float = quantity("-", "R_mu for asce_7_22; 1 at or below grade", low=1.0, high=10.0)
    name: str = choice("of the spectrum")
    source: str = choice("where the formula is from")

    def height_factor(self) -> float:
        """(1 + 2 z/h) of ASCE 7-16, or H_f/R_μ of ASCE 7-22.

        >>> ac = Ac156("asce_7_22", "horizontal", 1.0, 1.0, 1.0, 1.0, "", "")
        >>> round(ac.height_factor(), 3)  # 1 + 1 + 0.84
        2.84
        """
        z = self.height_ratio
        if self.edition == "asce_7_16":
            return 1.0 + 2.0 * z
        if self.period == 0.0:
            return (1.0 + 2.5 * z) / self.ductility
        a1, a2 = min(1.0 / self.period, 2.5), max(1.0 - (0.4 / self.period) ** 2, 0.0)
        return (1.0 + a1 * z + a2 * z**10) / self.ductility

    def required(self) -> RequiredSpectrum:
        """Its levels at 1.3, 8.3 and 33.3 Hz."""
        if self.direction == "vertical":
            flexible, rigid = 0.67 * self.s_ds, 0.27 * self.s_ds
        else:
            flexible = min(self.s_ds * self.height_factor(), FLEXIBLE_BOUND * self.s_ds)
            rigid = 0.4 * self.s_ds * self.height_factor()
        levels = GRAVITY * np.array([flexible, flexible, rigid])
        return RequiredSpectrum(self.name, np.array([1.3, 8.3, 33.3]), levels, 0.05, float(levels[-1]), self.source)


@dataclass(frozen=True)
class Rg160(Parameters):
    """The horizontal spectrum of Regulatory Guide 1.60."""

    peak_acceleration: float = quantity("g", "of the ground", low=0.001, high=10.0)
    damping: float = quantity("-", "xi", low=0.005, high=0.10)
    lowest_frequency: float = quantity("Hz", "from which it is required", low=0.1, high=2.5)
    name: str = choice("of the spectrum")
    source: str = choice("where the formula is from")

    def required(self) -> RequiredSpectrum:
        """Its control points, cut at the lowest frequency."""
        x = math.log(self.damping)
        factors = np.array([math.exp(np.interp(x, np.log(RG160_DAMPING), np.log(row))) for row in RG160_FACTORS.T])
        levels = factors * self.peak_acceleration * GRAVITY
        levels[0] = factors[0] * self.peak_acceleration * RG160_DISPLACEMENT * (2.0 * math.pi * 0.25) ** 2
        whole = RequiredSpectrum(self.name, RG160_FREQUENCY, levels, self.damping, float(levels[-1]), self.source)
        low = self.lowest_frequency
        if low < RG160_FREQUENCY[0]:  # constant displacement below D
            f = np.concatenate([[low], RG160_FREQUENCY])
            found = np.concatenate([[levels[0] * (low / RG160_FREQUENCY[0]) ** 2], levels])
        else:
            f = np.concatenate([[low], RG160_FREQUENCY[RG160_FREQUENCY > low]])
            found = whole.at(f)
        return RequiredSpectrum(self.name, f, found, self.damping, whole.zero_period, self.source)


FORMULAS: dict[str, type[Ac156] | type[Rg160]] = {"ac156": Ac156, "rg_1_60": Rg160}
POINTS = ("kind", "name", "source", "damping", "points", "zero_period")


def from_points(content: Mapping[str, Any], where: str) -> RequiredSpectrum:
    """A user's spectrum: `points` of [Hz, m/s²], `damping`, `zero_period` in m/s² (the last point's where null).

    Raises
    ------
    ShakeError : points that do not rise, are not positive numbers or fewer than two; damping outside 0.001 … 0.5.
    """
    try:
        points = np.array(content["points"], dtype=np.float64)
    except (ValueError, TypeError):
        raise ShakeError(f"{where}: points: pairs of numbers [Hz, m/s²] are needed") from None
    if points.ndim != 2 or points.shape[1:] != (2,) or len(points) < 2:
        raise ShakeError(f"{where}: points: at least two pairs [Hz, m/s²] are needed")
    if not (np.isfinite(points).all() and (points > 0.0).all()):
        bad = int(np.argmin((np.isfinite(points) & (points > 0.0)).all(axis=1)))
        raise ShakeError(f"{where}: points: pair {bad + 1}, {points[bad].tolist()}, is not of positive finite numbers")
    falls = np.flatnonzero(np.diff(points[:, 0]) <= 0.0)
    if falls.size:
        i = int(falls[0])
        raise ShakeError(f"{where}: points: {points[i + 1, 0]:g} Hz comes after {points[i, 0]:g} Hz; sort them, rising")
    damping, zero = content["damping"], content["zero_period"]
    for name, value, low, high in (("damping", damping, 0.001, 0.5), ("zero_period", zero, 1e-3, 1e3)):
        if name == "zero_period" and value is None:
            continue
        if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
            raise ShakeError(f"{where}: {name} = {shown(value)} is not within {low:g} … {high:g}")
    last = float(points[-1, 1]) if zero is None else float(zero)
    f, levels = points.T
    return RequiredSpectrum(str(content["name"]), f.copy(), levels.copy(), float(damping), last, str(content["source"]))


def load_required(name: str) -> tuple[RequiredSpectrum, str]:
    """A required spectrum of config/required_spectra, or of a YAML file, and the name of its rules."""
    path = find("required_spectra", name)
    return required_from(read_yaml(path), str(path))


def required_from(content: Any, where: str) -> tuple[RequiredSpectrum, str]:
    """A required spectrum from a mapping, and the name of its rules."""
    if not isinstance(content, Mapping) or "rules" not in content:
        raise ShakeError(f"{where}: missing key 'rules' (a name of config/qualification_rules or a YAML file)")
    rest = {key: value for key, value in content.items() if key != "rules"}
    rules = str(content["rules"])
    if rest.get("kind") == "points":
        return from_points(strict_keys(rest, POINTS, where, POINTS, kind="key"), where), rules
    if rest.get("kind") not in FORMULAS:
        known = ", ".join(sorted((*FORMULAS, "points")))
        raise ShakeError(f"{where}: kind '{rest.get('kind')}' is not known; known: {known}")
    _, formula = member_from(rest, FORMULAS, where, kind="required spectrum")  # type: ignore[type-var]
    return formula.required(), rules
