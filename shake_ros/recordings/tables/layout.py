"""How a table of text is written: separator, decimal sign, where the rows are, names and units, cells and numbers."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np
import numpy.typing as npt

from shake_ros.quantities import ShakeError
from shake_ros.recordings.tables.units import parse_unit, quantity_of, unit_of

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
    """Whether a cell means a missing value."""
    return cell.lower() in NOTHING


def number(cell: str, decimal: str) -> float:
    """The value of a cell, NaN where it is missing; raises ValueError where it is not a number.

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
    """Seconds since midnight of a time of day, NaN where it is missing; raises ValueError where it is none.

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


LOOKED_AT = 2000  # lines from which the layout is found, and from which the decimal sign is
TYPICAL = 50  # rows from which the columns of numbers are found
HEADING = 8  # lines above the rows among which names and units are
MARKED = 3  # lines of a mark between rows
DAMAGED = 4  # numbers to a text from which a column is one of numbers
FOOTER = 60  # lines of text between blocks, or behind the last row
COMMENT = ("#", "%", "//", "!", "*")  # above the table; the first three also among the rows
LABELLED = re.compile(r"[^\w]*(y_)?(unit|einheit|unit[éà]|unidad|单位)", re.IGNORECASE)
REMARKS = re.compile(r"comment|kommentar|remark|marker|event|note|bemerkung|commentaire", re.IGNORECASE)


@dataclass(frozen=True)
class Dialect:
    """How a table is written."""

    separator: str  # between cells; a blank for any white space
    decimal: str  # point or comma
    width: int  # columns of a row
    numbers: tuple[int, ...]  # indices of the columns that hold numbers or times of day
    rows: tuple[tuple[int, int], ...]  # first line and the one after the last of each block of rows, from 0
    # names, units: of the columns, empty where there is none
    names: tuple[str, ...]
    units: tuple[str, ...]
    header: tuple[str, ...]  # lines above the rows
    notes: tuple[str, ...]  # what was left out, a line each


def find_layout(lines: Sequence[str], skip: int = 0, decimal: str = "") -> Dialect:
    """The layout of a table from its lines.

    Parameters
    ----------
    lines : of the file.
    skip : lines above the table that are not looked at.
    decimal : point or comma, where known.

    Raises
    ------
    ShakeError : no rows of numbers, or a decimal sign that cannot be decided; a line without the file's name.
    """
    head = [(i, line) for i, line in enumerate(lines[skip : skip + LOOKED_AT], skip) if line.strip(" \t,;")]
    head = [(i, line) for i, line in head if not line.lstrip().startswith(COMMENT[:3])]
    separator, block = _separator(head)
    if separator == "," and _single(lines, block, decimal):
        separator = BLANK
    if not block:
        raise ShakeError("no rows of numbers found" + (f" behind {skip} skipped lines" if skip else ""))
    typical = [split(lines[i], separator) for i in block[:TYPICAL]]
    numbers = _numbers(typical)
    first = _first(lines, block[0], skip, separator, numbers)
    names, units, heading = _heading(lines, skip, first, separator, typical)
    if heading >= 0 and (again := lines.index(lines[heading], skip)) < heading:
        heading = again
        first = next(i for i in range(again, len(lines)) if _is_row(lines[i], separator, numbers))
    rows, notes = _rows(lines, first, separator, numbers, heading)
    places = [i for start, stop in rows for i in range(start, stop)[: LOOKED_AT // 2]]
    places += [i for start, stop in rows for i in range(start, stop)[:: 1 + (stop - start) // LOOKED_AT]]
    if not decimal:
        decimal = _decimal([lines[i] for i in places], separator, numbers)
    earlier = [i for i, line in head if i < first - HEADING and len(_numbers([split(line, separator)])) > 1]
    if len(earlier) > 2:
        notes.append(f"lines {earlier[0] + 1} … {earlier[-1] + 1} hold numbers of another table; left out")
    width = max(len(names), *(i + 1 for cells in typical for i, cell in enumerate(cells) if cell))
    header = tuple(line.strip() for line in lines[skip:first] if line.strip())
    return Dialect(separator, decimal, width, numbers, tuple(rows), names, units, header, tuple(notes))


def _separator(head: Sequence[tuple[int, str]]) -> tuple[str, list[int]]:
    """The separator with which a block of lines has the most numbers, and that block; none where nothing has any."""
    best: tuple[float, str, list[int]] = (0.0, BLANK, [])
    for separator in SEPARATORS:
        scored = []
        for i, line in head:
            cells = split(line, separator)
            good = sum(map(is_number, cells))
            scored.append((i, len(cells) if good else 0, good - sum(map(_is_text, cells))))
        for width, run in groupby(scored, key=lambda line: line[1]):
            lines = list(run)
            score = sum(line[2] for line in lines)
            pure = best[2] and separator == BLANK and best[1] != BLANK and _pure(head, best)
            if width and score > best[0] and not pure:
                best = (score, separator, [line[0] for line in lines])
    return best[1], best[2]


def _single(lines: Sequence[str], block: Sequence[int], decimal: str) -> bool:
    """Whether whole numbers with a comma between are one column of decimal commas; a ShakeError where that is open."""
    rows = [lines[i].strip() for i in block]
    if not all(re.fullmatch(r"[+-]?\d+,\d+", row) for row in rows):
        return False
    above = next((lines[i] for i in range(block[0] - 1, -1, -1) if re.search(r"[^\W\d_]", lines[i])), "")
    named = bool(above)
    if decimal or named:
        return decimal == "," or (named and "," not in above)
    if any(re.fullmatch(r".*,0\d+", row) for row in rows):
        return True
    raise ShakeError(f"'{rows[0]}': one column of decimal commas or two columns? give --decimal , or .")


def _pure(head: Sequence[tuple[int, str]], found: tuple[float, str, list[int]]) -> bool:
    """Whether a separator other than a blank makes nothing but several numbers of a block's lines."""
    text = dict(head)
    rows = [split(text[i], found[1]) for i in found[2]]
    return all(len(cells) > 1 and not any(map(_is_text, cells)) for cells in rows)


def _is_text(cell: str) -> bool:
    return not is_nothing(cell) and not is_number(cell)


def _numbers(rows: Sequence[Sequence[str]]) -> tuple[int, ...]:
    """Columns that hold numbers or nothing, but for damaged rows."""
    columns = [[cells[i] for cells in rows] for i in range(min(len(cells) for cells in rows))]
    return tuple(i for i, c in enumerate(columns) if sum(map(is_number, c)) > DAMAGED * sum(map(_is_text, c)))


def _is_row(line: str, separator: str, numbers: Sequence[int]) -> bool:
    """Whether a line holds numbers where the table does."""
    cells = split(line, separator)
    inside = [cells[i] for i in numbers if i < len(cells)]
    return len(inside) == len(numbers) and any(map(is_number, inside)) and not any(map(_is_text, inside))


def _first(lines: Sequence[str], start: int, skip: int, separator: str, numbers: Sequence[int]) -> int:
    """The first row of the block to which line `start` belongs."""
    first = start
    while not _is_row(lines[first], separator, numbers) and _is_text(split(lines[first], separator)[0]):
        first += 1
    for i in range(start - 1, skip - 1, -1):
        if _is_row(lines[i], separator, numbers):
            first = i
        elif lines[i].strip() and _is_remark(lines[i], separator):
            above = lines[max(skip, i - MARKED) : i]
            if len(split(lines[i], separator)) > 1 or not any(_is_row(line, separator, numbers) for line in above):
                break
    return first


def _heading(
    lines: Sequence[str], skip: int, first: int, separator: str, typical: Sequence[Sequence[str]]
) -> tuple[tuple[str, ...], tuple[str, ...], int]:
    """Names and units above the first row, and the line of the names, −1 where there is none."""
    raw = max(len(cells) for cells in typical)
    width = max(i + 1 for cells in typical for i, cell in enumerate(cells) if cell or not i)
    indices = [cells[0] for cells in typical]
    counted = indices[0].isdecimal() and indices == [str(int(indices[0]) + i) for i in range(len(indices))]
    above = [i for i in range(max(skip, first - HEADING), first) if lines[i].strip()]
    found: list[tuple[int, list[str]]] = []
    for i in reversed(above):
        cells = _names(lines[i], separator, raw, width, counted)
        if cells:
            found.append((i, cells))
        elif found and found[0][0] != i + 1:
            break
    unit_row = next((n for n, (_, cells) in enumerate(found) if _are_units(cells)), -1)
    units = tuple(found[unit_row][1]) if unit_row >= 0 else ()
    named = unit_row + 1 if 0 <= unit_row < len(found) - 1 else 0 if unit_row != 0 or len(found) == 1 else -1
    if not units:
        labelled = (split(line, separator) for line in lines[skip:first] if LABELLED.match(line))
        row = next((cells[1:] for cells in labelled if any(map(parse_unit, cells[1:]))), [])
        shift = width - len([cell for cell in row if cell])
        units = tuple(["", *row] if shift == 1 else row)
    if not found or named < 0:
        return (), units, -1
    return tuple(found[named][1]), units, found[named][0]


def _names(line: str, separator: str, raw: int, width: int, counted: bool) -> list[str]:
    """The cells of a line that may be the names or units of all columns, empty where it may not.

    counted : the first column counts the rows, and may have no name.
    """
    mark = next((mark for mark in COMMENT if line.lstrip().startswith(mark)), "")
    text = line.strip().removeprefix(mark).strip() if mark else line
    ways = [split(text, way) for way in dict.fromkeys((separator, *SEPARATORS[:-1]))]
    ways.append(re.split(r"\t+|\s{2,}", text.strip()))
    if separator == BLANK:
        ways.append(re.split(r"\s+(?![^(\[]*[)\]])(?![(\[])", text.strip()))
    for cells in ways:
        if mark and separator == BLANK and 2 * sum(map(_says, cells)) <= len(cells):
            continue  # a sentence of as many words as there are columns
        kept = len(cells)
        if kept == width - 1 and counted:
            cells, kept = ["", *cells], width
        while kept > width and not cells[kept - 1]:
            kept -= 1
        remark = kept > width and all(REMARKS.match(cell) for cell in cells[width:kept])
        texts_inside = sum(bool(re.search(r"[^\W\d_]|%|°", cell)) for cell in cells[:kept])
        if (width <= kept <= raw or remark) and texts_inside and not any(map(is_number, cells[1:kept])):
            return cells[:kept]
    return []


def _says(name: str) -> bool:
    """Whether a name says what its column holds."""
    return bool(quantity_of(name)) or unit_of(name) is not None


def _are_units(cells: Sequence[str]) -> bool:
    """Whether a row under the names holds units."""
    words = [cell for cell in cells if not is_nothing(cell.strip("[]() "))]
    known = sum(parse_unit(cell) is not None for cell in words)
    return bool(known) and 2 * known > len(words) and all(len(cell) < 14 for cell in words)


def _rows(
    lines: Sequence[str], first: int, separator: str, numbers: Sequence[int], heading: int
) -> tuple[list[tuple[int, int]], list[str]]:
    """The blocks of rows between headings that repeat, without the text behind the last one; what was left out."""

    def is_row(i: int) -> bool:
        return _is_row(lines[i], separator, numbers)

    notes, starts, stops = list[str](), [first], list[int]()
    if heading >= 0:
        again = (
            [i for i in range(first, len(lines)) if lines[i] == lines[heading]]
            if lines.count(lines[heading]) > 1
            else []
        )
        for place in again:
            before, after = place, place
            while before > starts[-1] and place - before < FOOTER and not is_row(before - 1):
                before -= 1
            while after < len(lines) and after - place < HEADING and not is_row(after):
                after += 1
            stops.append(before)
            starts.append(after)
        notes += [f"the heading occurs {len(again) + 1} times: the blocks are read as one table"] if again else []
    end = len(lines)
    while (
        end > starts[-1] and len(lines) - end < FOOTER and not is_row(end - 1) and _is_remark(lines[end - 1], separator)
    ):
        end -= 1
    behind = [line for line in lines[end:] if line.strip()]
    if behind:
        notes.append(f"line {end + 1} and after: '{behind[0].strip()[:40]}' is not a row; left out")
    return [(a, b) for a, b in zip(starts, [*stops, end], strict=True) if b > a], notes


def _is_remark(line: str, separator: str) -> bool:
    """Whether a line is text, not a row that lacks something."""
    cells = [cell for cell in split(line, separator) if cell]
    return not cells or line.lstrip().startswith(COMMENT) or (_is_text(cells[0]) and not is_number(cells[0]))


def _decimal(sample: Sequence[str], separator: str, numbers: Sequence[int]) -> str:
    """The decimal sign of the rows; a ShakeError that asks for it where it cannot be decided."""
    rows = [split(line, separator) for line in sample if line.strip()]
    columns = [[cells[i] for cells in rows if i < len(cells)] for i in numbers]
    found = decimal_of(columns)
    if found:
        return found
    example = next(cell for column in columns for cell in column if re.search(r"\d[.,]\d{3}$", cell))
    raise ShakeError(
        f"'{example}' may be a thousand or a decimal fraction, and the other numbers do not decide it: give --decimal "
        ". or ,"
    )
