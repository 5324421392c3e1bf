"""What a heading says of its column: the unit, by pint, and the quantity, by its name in the languages of loggers."""

from __future__ import annotations

import functools
import re
import unicodedata
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    import pint

LONGEST = 24
BRACKETS = re.compile(r"[\[(<{]([^\[\](){}<>]*(?:\([^()]*\)[^\[\](){}<>]*)?)[\])>}]")
ENCLOSED = re.compile(r"^[\[({<](.*)[\])}>]$")
LOOSE = re.compile(r"[,;:/|]|(?<=\s)in(?=\s)")  # "Disp, mm", "Weg / mm", "Kraft in kN"
SUFFIX = re.compile(r".*[^\d\s_.][_\s.]+([^\W\d_]\S*|%g?)$")  # "x_mm", "Time ms": counts where it is what is wanted
MANGLED = re.compile(r"_([a-z]{1,2})_(s2?)$")  # "Acc_m_s2_", as MATLAB makes of "Acc (m/s2)"
ALLOWED = re.compile(r"(?=.*[^\W\d]|.*%)[\w%°/*^.() -]+")
SPELLINGS = (
    (re.compile(r"\bg['’]?s\b"), "g"),
    (re.compile(r"%\s*g\b", re.IGNORECASE), "percent*g"),
    (re.compile(r"%"), "percent"),
    (re.compile(r"°"), "deg"),
    (re.compile(r"\*\*"), "^"),
    (re.compile(r"[·⋅•]|(?<=[a-zμ])\.(?=[a-z])"), "*"),
    (re.compile(r"\bper\b"), "/"),
    (re.compile(r"^ms\^?-([12])$"), r"m/s^\1"),
    (re.compile(r"(?<=[^\W\d_])\^?(-1|-?[23])(?![\d.])"), r"^(\1)"),
    (re.compile(r"\s*([/*])\s*"), r"\1"),
    (re.compile(r"(?<=[\w)])[. ]+(?=\w)"), "*"),
)
QUANTITIES = {  # name → SI unit, as pint reads it
    "time": "s",
    "position": "m",
    "velocity": "m/s",
    "acceleration": "m/s**2",
    "force": "N",
    "pressure": "Pa",
    "share": "one",
    "voltage": "V",
    "current": "A",
    "count": "count",
}
WORDS = {  # quantity → what headings call it; the first that fits counts
    "index": r"^(index|idx|sample|samples|sample (no|number|nr)\.?|no\.?|nr\.?|number|row|line|scan|scan ?#|point|"
    r"points|n|#|unnamed: 0|id|count|messpunkt|punkt|zeile|probe|序号|编号|点号|indice|numéro|numero|campione)$",
    "time": r"^t$|^ts$|^t[ _]|^x_value$|time|zeit|temps|tempo\b|tiempo|время|时间|時間|时刻|seconds|timestamp",
    "acceleration": r"acc|beschl|加速度|accel|^a$|^a[xyz]?$|^a[ _]|ускорен|ivme|^[nsewud]-[nsewud]$",
    "velocity": r"vel|geschw|vitesse|speed|速度|скорост|hiz\b|^v$",
    "command": r"command|cmd|valve|ventil|vanne|valvol|servo|drive|阀|指令|控制|befehl|stell|^u$|^ut$|^u[ _]|output"
    r"|ausgang|клапан|comand|commande",
    "pressure": r"press|druck|pression|压力|壓力|давлен|presi",
    "force": r"force|load|kraft|last\b|力|载荷|荷重|荷载|forza|fuerza|carico|carga|усили|сила|force",
    "position": r"pos|disp|weg|position|stroke|hub\b|extension|déplac|deplac|spost|位移|变位|変位|行程|перемещ|ход|lvdt"
    r"|^x$|^x[ _]|axial|travel|desplaz|desloc|length|dehnung|yer ?de",
}


class Unit(NamedTuple):
    """A unit as a heading names it."""

    text: str  # as written
    quantity: str  # of QUANTITIES, or what its dimensions are
    factor: float  # to the SI unit [-]
    # it stands in brackets, behind a comma or in a row of units; otherwise it is the end of a name
    certain: bool = True


@functools.cache
def registry() -> pint.UnitRegistry[float]:
    """The units of units.txt, in which g is gravity and gal is cm/s²."""
    import pint

    found: pint.UnitRegistry[float] = pint.UnitRegistry(None)
    found.load_definitions(Path(__file__).with_name("units.txt"))
    return found


@functools.lru_cache(maxsize=1024)
def parse_unit(text: str) -> Unit | None:
    """A text that is a unit and nothing else; None where it is none.

    >>> [(u.quantity, u.factor) for u in map(parse_unit, ("ms", "µm", "g's", "cm/sec/sec")) if u]
    [('time', 0.001), ('position', 1e-06), ('acceleration', 9.80665), ('acceleration', 0.01)]
    >>> parse_unit("Valve") is None, parse_unit("42") is None
    (True, True)
    """
    plain = (
        ENCLOSED.sub(r"\1", unicodedata.normalize("NFKC", text).strip(" \"'"))
        .strip()
        .rstrip(".")
        .replace("\u2212", "-")
    )
    if plain in ("-", "1", "[-]"):
        return Unit(text.strip(), "share", 1.0)
    for pattern, by in SPELLINGS:
        plain = pattern.sub(by, plain)
    if len(plain) > LONGEST or not ALLOWED.fullmatch(plain):
        return None
    for spelling in dict.fromkeys((plain, plain.lower())):
        try:
            base = (1.0 * registry().parse_expression(spelling)).to_base_units()
            kinds, factor = base.dimensionality, float(base.magnitude)
        except Exception:  # pint lets any error of its tokeniser through
            continue
        known = (name for name, unit in QUANTITIES.items() if kinds == registry()(unit).dimensionality)
        return Unit(ENCLOSED.sub(r"\1", text.strip()), next(known, str(kinds)), factor)
    return None


def unit_of(name: str, row: str = "") -> Unit | None:
    """The unit of a column from its cell in a row of units, or from its name.

    >>> [u and u.text for u in map(unit_of, ("Time [ms]", "Disp, mm", "Weg / mm", "x_mm", "Valve"))]
    ['ms', 'mm', 'mm', 'mm', None]
    """
    if row and (found := parse_unit(row)):
        return found
    plain = MANGLED.sub(r"_\1/\2", unicodedata.normalize("NFKC", name).rstrip("_"))
    inside = [unit for text in reversed(BRACKETS.findall(plain)) if (unit := parse_unit(text))]
    if inside:
        return inside[0]
    suffix = SUFFIX.match(plain)
    for certain, text in (
        *((True, plain[m.end() :]) for m in LOOSE.finditer(plain)),
        (False, suffix[1] if suffix else ""),
    ):
        if (found := parse_unit(text)) and found.quantity in QUANTITIES:
            return found._replace(certain=certain)
    return None


def quantity_of(name: str) -> str:
    """The quantity that a column's name speaks of, empty where it says nothing.

    >>> [quantity_of(n) for n in ("Zeit [s]", "Beschleunigung", "加速度", "Vitesse (m/s)", "Sample", "CH1")]
    ['time', 'acceleration', 'acceleration', 'velocity', 'index', '']
    """
    plain = unicodedata.normalize("NFKC", BRACKETS.sub("", name)).strip(" \"'#%_").lower()
    return next((quantity for quantity, words in WORDS.items() if re.search(words, plain)), "")
