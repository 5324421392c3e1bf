"""Numbers and units as a person reads them: MPa, mm, kN; an uncertainty only where it means something."""

from __future__ import annotations

import math
from collections.abc import Mapping

from shake_ros.core.identification.uncertainty import Estimate

UNITS: Mapping[str, tuple[float, str]] = {  # SI unit → factor and unit to read
    "Pa": (1e-6, "MPa"),
    "1/Pa": (1e6, "1/MPa"),
    "m": (1e3, "mm"),
    "m/s": (1e3, "mm/s"),
    "s": (1e3, "ms"),
    "m^2": (1e4, "cm²"),
    "m^3": (1e6, "cm³"),
    "N/m": (1e-3, "kN/m"),
    "m^3/(s*Pa)": (6e10, "L/(min·MPa)"),
    "m^3/(s*sqrt(Pa))": (6e7, "L/(min·√MPa)"),
    "Pa*s/m^3": (1e-6 / 6e4, "MPa·min/L"),
    "-": (1.0, ""),
}
KNOWN = 1.0  # relative standard error from which on a parameter is not known


def unit_of(unit: str) -> tuple[float, str]:
    """Factor and unit to read an SI unit in.

    >>> unit_of("Pa"), unit_of("N*s/m")
    ((1e-06, 'MPa'), (1.0, 'N·s/m'))
    """
    factor, text = UNITS.get(unit, (1.0, unit))
    return factor, text.replace("*", "·").replace("^2", "²").replace("^3", "³")


def rounded(value: float, error: float | None = None) -> str:
    """A number with the digits that it deserves: two of its error's, else four of its own.

    >>> rounded(0.0204132, 0.00031), rounded(123456.7), rounded(-3e-9), rounded(float("nan"))
    ('0.02041', '123500', '−3·10⁻⁹', '–')
    """
    if not math.isfinite(value):
        return "–"
    digits = 4
    if error and value:
        digits = min(max(math.floor(math.log10(abs(value))) - math.floor(math.log10(error)) + 2, 1), 6)
    shown = float(f"{value:.{digits - 1}e}")
    size = math.floor(math.log10(abs(shown))) if shown else 0
    if -4 <= size <= 6:
        text = f"{shown:.{min(max(digits - 1 - size, 0), 9)}f}"
        text = text if error or "." not in text else text.rstrip("0").rstrip(".")
    else:
        power = str(size).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
        text = f"{shown / 10.0**size:.{digits - 1}f}".rstrip("0").rstrip(".") + f"·10{power}"
    return text.replace("-", "−")


def bound_text(value: float, low: float, high: float) -> str:
    """At which of its two bounds a value rests.

    >>> bound_text(0.01, 0.0, 5.0)
    'at its lower bound'
    """
    return f"at its {'lower' if value - low < high - value else 'upper'} bound"


def estimate_text(p: Estimate) -> str:
    """Value and standard deviation (noise and the forms assumed near rest) without the unit.

    >>> estimate_text(Estimate("x", 9.1e8, 2e6, "Pa")), estimate_text(Estimate("x", 0.059, 2.6e2, "-"))
    ('910.0 ± 2.0', 'not known (0.059)')
    """
    factor, _ = unit_of(p.unit)
    value = factor * p.value
    if p.deviation is None:
        return rounded(value)
    error = factor * p.deviation
    if error > KNOWN * abs(value):
        return f"not known ({rounded(value)})"
    if error == 0.0:
        return rounded(value)
    spread = float(f"{error:.1e}")
    places = max(1 - math.floor(math.log10(spread)), 0)
    text = f"{spread:.{places}f}" if places < 10 else rounded(error)
    return f"{rounded(value, error)} ± {text}"
