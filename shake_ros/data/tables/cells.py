"""Lines into cells and cells into numbers: decimal comma or point, thousands, clock times, what stands for nothing."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Sequence

import numpy as np
import numpy.typing as npt

from shake_ros.core.quantities import ShakeError

Floats = npt.NDArray[np.float64]
BLANK = " "  # as a separator: any run of blanks and tabs
SEPARATORS = (";", "\t", ",", "|", BLANK)
NOTHING = {
    "",
    "-",
    "--",
    "---",
    "na",
    "n/a",
    "#n/a",
    "#na",
    "null",
    "none",
    "nan",
    "-nan",
    "+nan",
    "nan(ind)",
    "-nan(ind)",
}
NOTHING |= {"1.#qnan", "1.#ind", "-1.#ind", "1.#inf", "-1.#inf", "#num!", "#div/0!", "1,#qnan", "-1,#ind", "."}
GROUPS = " '’_\u00a0\u2009\u202f"  # between thousands, beside point and comma
EXPONENT = r"(?:[eEdD][+-]?\d{1,3})?"
FORMS = {
    decimal: re.compile(
        rf"[+-]?(?=[\d{decimal}])(?:\d{{1,3}}(?:(?P<group>[{other}{GROUPS}])\d{{3}})(?:(?P=group)\d{{3}})*|\d*)"
        rf"(?:[{decimal}]\d*)?{EXPONENT}"
    )
    for decimal, other in ((".", ","), (",", "."))
}
EITHER = re.compile(r"[+-]?[1-9]\d{0,2}[.,]\d{3}")  # 1,234 or 1.234: a thousand or one
CLOCK = re.compile(
    r"(?:(?P<date>\d{1,4}[-./]\d{1,2}[-./]\d{1,4})[T ,]+)?(?P<h>\d{1,3}):(?P<m>\d{2})(?::(?P<s>\d{2}(?:[.,:]\d+)?))?"
    r"\s*(?P<half>[AaPp][Mm])?(?:Z|[+-]\d{2}:?\d{2})?"
)
DAY = 86400.0  # [s]


def split(line: str, separator: str) -> list[str]:
    """The cells of a line, without blanks and quotes around them."""
    line = line.strip() if separator == BLANK else line
    if '"' in line:
        line = re.sub(r"[ \t]+", BLANK, line) if separator == BLANK else line
        cells = next(csv.reader([line], delimiter=separator, skipinitialspace=True), [])
    else:
        cells = re.split(r"[ \t]+", line) if separator == BLANK else line.split(separator)
    return [cell.strip().strip("\"'").strip() for cell in cells]


def plain(cell: str) -> str:
    """A cell with the minus of typesetters as that of programmers."""
    return cell.replace("\u2212", "-").strip()


def is_number(cell: str) -> bool:
    """Whether a cell may be a number in some way of writing, or a time of day."""
    text = plain(cell)
    return any(form.fullmatch(text) and text[-1:] not in "+-" for form in FORMS.values()) or bool(CLOCK.fullmatch(text))


def is_nothing(cell: str) -> bool:
    """Whether a cell stands for a value that is not there."""
    return cell.lower() in NOTHING


def number(cell: str, decimal: str) -> float:
    """The value of a cell, NaN where it stands for nothing; raises ValueError where it is no number.

    >>> number("1.234,5", ","), number("1'234.5", "."), number("-1.5D-3", "."), number("", ".")
    (1234.5, 1234.5, -0.0015, nan)
    """
    text = plain(cell)
    form = FORMS[decimal].fullmatch(text)
    if form and any(sign.isdigit() for sign in text):
        digits = text.replace(form["group"], "") if form["group"] else text
        return float(digits.replace(decimal, ".").replace("D", "E").replace("d", "e"))
    if is_nothing(text):
        return float("nan")
    if text.lower().lstrip("+-") in ("inf", "infinity"):
        return float(text)
    raise ValueError(cell)


def clock(cell: str) -> float:
    """Seconds since midnight of a time of day, NaN where it stands for nothing; raises ValueError where it is none.

    >>> clock("2024-05-01 00:01:02.5"), clock("12:00:00,25"), clock("01:30 PM")
    (62.5, 43200.25, 48600.0)
    """
    found = CLOCK.fullmatch(plain(cell))
    if not found:
        if is_nothing(cell):
            return float("nan")
        raise ValueError(cell)
    seconds = float((found["s"] or "0").replace(",", ".").replace(":", "."))
    hours = int(found["h"]) % 12 + 12 * (found["half"].lower() == "pm") if found["half"] else int(found["h"])
    return 3600.0 * hours + 60.0 * int(found["m"]) + seconds


def over_midnight(seconds: Floats) -> Floats:
    """Times of day that go on after midnight, shape (n,) [s]."""
    back = np.diff(seconds, prepend=seconds[:1]) < -0.5 * DAY
    return seconds + DAY * np.cumsum(back)


def decimal_of(columns: Iterable[Sequence[str]]) -> str | None:
    """The decimal sign of the numbers in some columns of cells: a point, a comma, or None where it cannot be decided.

    Raises
    ------
    ShakeError : one number has a decimal point and another one a decimal comma.

    >>> decimal_of([["0,5", "1,25"]]), decimal_of([["1,255.8", "12"]]), decimal_of([["1,234", "5,678"]]) is None
    (',', '.', True)
    """
    signs: dict[str, str] = {}
    doubtful = set[str]()
    for column in columns:
        texts = [plain(cell) for cell in column]
        for text in texts:
            marks = [sign for sign in text if sign in ".,"]
            if not marks or CLOCK.fullmatch(text) or not is_number(text):
                continue
            if EITHER.fullmatch(text):
                doubtful.add(marks[-1])
                continue
            alone = len(set(marks)) == 1 and len(marks) > 1
            signs.setdefault({".": ",", ",": "."}[marks[-1]] if alone else marks[-1], text)
        if sum(map(str.isdigit, texts)) > 2 and sum(bool(EITHER.fullmatch(text)) for text in texts) > 2:
            doubtful.add(",")  # 998, 999, 1.000: thousands, or numbers without their last zeros
    if len(signs) == 2:
        raise ShakeError(
            f"a number has a decimal point, '{signs['.'][:20]}', another a decimal comma, '{signs[','][:20]}'"
        )
    if signs:
        return next(iter(signs))
    return None if "," in doubtful else "."
