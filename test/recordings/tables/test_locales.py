"""One table in ten locales and five layouts, and random tables in random dialects: the same numbers come back."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from shake_ros.recordings.tables.table import Column, read_table

ROWS = 300
TIME = np.arange(ROWS) / 250.0
DRIVE = np.round(8.0 * np.sin(40.0 * TIME), 4)
PLACE = np.round(2500.0 * np.cos(40.0 * TIME), 2)
WANTED = {"time": "time", "command": "command", "position": "position"}


class Locale(NamedTuple):
    """How a place writes numbers and names.

    decimal, group : signs. separator : of lists. encoding : of its programs. names : of time, valve and displacement.
    """

    decimal: str
    group: str
    separator: str
    encoding: str
    names: tuple[str, str, str]


LOCALES = {
    "en_US": Locale(".", ",", ",", "utf-8-sig", ("Time", "Valve", "Displacement")),
    "en_GB": Locale(".", "", "\t", "utf-8", ("Time", "Valve", "Stroke")),
    "de_DE": Locale(",", ".", ";", "cp1252", ("Zeit", "Ventil", "Länge")),
    "de_CH": Locale(".", "'", ";", "cp1252", ("Zeit", "Ventilöffnung", "Weg")),
    "fr_FR": Locale(",", "\u202f", ";", "utf-8", ("Temps", "Vanne", "Déplacement")),
    "fr_CA": Locale(",", "\u00a0", ";", "cp1252", ("Temps", "Vanne", "Déplacement")),
    "it_IT": Locale(",", ".", ";", "utf-16", ("Tempo", "Valvola", "Spostamento")),
    "es_ES": Locale(",", "", ";", "latin-1", ("Tiempo", "Válvula", "Posición")),
    "zh_CN": Locale(".", "", ",", "gbk", ("时间", "阀门", "位移")),
    "ru_RU": Locale(",", " ", "\t", "cp1251", ("Время", "Клапан", "Перемещение")),
}


def written(value: float, digits: int, locale: Locale) -> str:
    """A number as the locale writes it, in quotes where its decimal sign or thousands are the separator."""
    text = f"{value:,.{digits}f}".translate(str.maketrans({",": locale.group, ".": locale.decimal}))
    return f'"{text}"' if locale.separator in text else text


def body(locale: Locale) -> list[str]:
    return [
        locale.separator.join(written(v, d, locale) for v, d in zip(row, (3, 4, 2), strict=True))
        for row in zip(TIME, DRIVE, PLACE, strict=True)
    ]


def bracketed(locale: Locale) -> list[str]:
    units = ("s", "V", "mm")
    return [locale.separator.join(f"{n} [{u}]" for n, u in zip(locale.names, units, strict=True)), *body(locale)]


def unit_row(locale: Locale) -> list[str]:
    return [locale.separator.join(locale.names), locale.separator.join(("s", "V", "mm")), *body(locale)]


def quoted(locale: Locale) -> list[str]:
    heading = [locale.separator.join(f'"{w}"' for w in words) for words in (locale.names, ("(s)", "(V)", "(mm)"))]
    return heading + [locale.separator.join(f'"{c}"' for c in _cells(line, locale)) for line in body(locale)]


def _cells(line: str, locale: Locale) -> list[str]:
    inside = line.split('"')
    if len(inside) == 1:
        return line.split(locale.separator)
    return [c for i, part in enumerate(inside) for c in ([part] if i % 2 else part.strip(",").split(",")) if c]


def framed(locale: Locale) -> list[str]:
    above = ["Rig 3", "2024-05-02 10:22", f"{locale.names[0]}: 4{locale.decimal}5", ""]
    return [*above, *bracketed(locale), "", "End of file"]


def trailing(locale: Locale) -> list[str]:
    return [line + locale.separator for line in bracketed(locale)]


LAYOUTS: dict[str, Callable[[Locale], list[str]]] = {
    f.__name__: f for f in (bracketed, unit_row, quoted, framed, trailing)
}


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("name", LOCALES)
def test_ten_locales_and_five_layouts_give_identical_arrays(tmp_path: Path, name: str, layout: str) -> None:
    locale = LOCALES[name]
    file = tmp_path / "run.csv"
    file.write_bytes("\r\n".join(LAYOUTS[layout](locale)).encode(locale.encoding))
    columns = dict(zip(WANTED, map(Column, locale.names), strict=True))
    found = read_table(file).signals(columns, WANTED)
    assert np.array_equal(found["time"].values, TIME)
    assert np.array_equal(found["command"].values, DRIVE)
    assert np.array_equal(found["position"].values, PLACE * 1e-3)


def random_table(rng: np.random.Generator) -> tuple[str, np.ndarray, list[str]]:
    """A random table in a random dialect, its numbers, and the names of its columns."""

    def one_of(*choices: str) -> str:
        return choices[rng.integers(len(choices))]

    decimal, separator = one_of(".", ","), one_of(";", "\t", "|", ",")
    group = one_of("", "'", "\u202f", "." if decimal == "," else ",")
    width, count, digits = rng.integers(2, 7), rng.integers(5, 41), rng.choice([1, 2, 4, 5, 6])
    size = 10 ** rng.integers(1, 8)
    values = rng.integers(-size, size + 1, (count, width)) / 10.0**digits
    quote = one_of("", '"')

    def cell(value: float) -> str:
        text = f"{value:,.{digits}f}".translate(str.maketrans({",": group, ".": decimal}))
        return f'"{text}"' if quote or separator in text else text

    words = ["".join(rng.choice(list("abcdefgXYZäöüéµ位移 _-"), rng.integers(1, 9))) for _ in range(width)]
    names = [f"N{i} {' '.join(word.split())}".strip() for i, word in enumerate(words)]
    preamble = [one_of("Rig 3", "", "Operator: lab", "Date 2024-05-02") for _ in range(rng.integers(5))]
    end, ending, footer = one_of("", separator), one_of("\n", "\r\n"), one_of("", "\n\nEnd of test", "\n")
    lines = [*preamble, separator.join(names) + end]
    lines += [separator.join(map(cell, row)) + end for row in values]
    return ending.join(lines) + footer.replace("\n", ending) + ending, values, names


def test_random_tables_in_random_dialects_are_read_back(tmp_path: Path) -> None:
    file = tmp_path / "random.csv"
    for seed in range(300):
        rng = np.random.default_rng(seed)
        text, values, names = random_table(rng)
        file.write_bytes(text.encode(str(rng.choice(["utf-8", "utf-8-sig", "utf-16"]))))
        found = read_table(file)
        read = found.read([found.place(name) for name in names])
        assert np.array_equal(np.column_stack(read), values), seed
