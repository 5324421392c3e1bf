"""physics/EQUATIONS.md against the code, in both directions."""

from __future__ import annotations

import ast
import io
import re
import tokenize
from pathlib import Path
from typing import NamedTuple

import pytest

PACKAGE = Path(__file__).resolve().parent.parent / "shake_ros"
PHYSICS = PACKAGE / "physics"
ROOMS = ("physics", "signals", "control", "safety", "fit", "search")
LIST = PHYSICS / "EQUATIONS.md"
BRACKET = re.compile(r"(?<!\w)\(([2-6]\.\d{1,2}(?:\s*[–,]\s*[2-6]\.\d{1,2})*)\)")  # (2.5), (5.48, 5.49), (6.33–6.37)
BETWEEN = re.compile(r"([2-6])\.(\d{1,2})\)?\s*–\s*\(?\1\.(\d{1,2})")  # (3.19)–(3.22) or 6.33–6.37


class Row(NamedTuple):
    """One line of the list."""

    number: str
    form: str
    source: str
    places: tuple[str, ...]  # file:function


class Function(NamedTuple):
    """A function of the code: its place, and the numbers it and its file's docstring name."""

    place: str
    own: frozenset[str]
    file: frozenset[str]


def numbers(text: str) -> frozenset[str]:
    """Equation numbers in brackets, ranges filled."""
    found = {n for bracket in BRACKET.findall(text) for n in re.findall(r"\d\.\d{1,2}", bracket)}
    for chapter, first, last in BETWEEN.findall(text):
        found |= {f"{chapter}.{n}" for n in range(int(first), int(last) + 1)}
    return frozenset(found)


def rows() -> list[Row]:
    result = []
    for line in LIST.read_text(encoding="utf-8").splitlines():
        cells = [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]]
        if len(cells) == 4 and re.fullmatch(r"\d\.\d{1,2}", cells[0]):
            result.append(Row(cells[0], cells[1], cells[2], tuple(re.findall(r"`([^`]+)`", cells[3]))))
    return result


def functions() -> dict[str, Function]:
    """All functions and methods of ROOMS, and of files of other rooms that the list names, by file:function."""
    result = {}
    named = {PACKAGE / place.split(":")[0] for row in rows() for place in row.places}
    own = (path for room in ROOMS for path in (PACKAGE / room).rglob("*.py"))
    for path in sorted({*own, *filter(Path.exists, named)}):
        source = path.read_text(encoding="utf-8")
        tree = ast.parse(source)
        tokens = tokenize.generate_tokens(io.StringIO(source).readline)
        comments = {token.start[0]: token.string for token in tokens if token.type == tokenize.COMMENT}
        of_file = numbers(ast.get_docstring(tree) or "")
        for name, node in defined(tree):
            lines = range(node.lineno, (node.end_lineno or node.lineno) + 1)
            text = "\n".join([ast.get_docstring(node) or "", *(comments.get(line, "") for line in lines)])
            place = f"{path.relative_to(PHYSICS if path.is_relative_to(PHYSICS) else PACKAGE).as_posix()}:{name}"
            result[place] = Function(place, numbers(text), of_file)
    return result


def defined(node: ast.AST, prefix: str = "") -> list[tuple[str, ast.FunctionDef]]:
    found: list[tuple[str, ast.FunctionDef]] = []
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.FunctionDef):
            found.append((prefix + child.name, child))
        elif isinstance(child, ast.ClassDef):
            found += defined(child, f"{prefix}{child.name}.")
    return found


ROWS, FUNCTIONS = rows(), functions()
WITHOUT_ROW = numbers(LIST.read_text(encoding="utf-8").split("## Without a row")[1])


def test_the_list_is_read() -> None:
    assert len(ROWS) > 100
    assert {"2.32", "3.19", "6.4", "6.36", "6.48"} <= {row.number for row in ROWS}


def test_every_number_stands_once_with_form_source_and_place() -> None:
    listed = [row.number for row in ROWS]
    assert sorted(set(listed)) == sorted(listed)
    for row in ROWS:
        assert row.form, row
        assert row.source, row
        assert row.places, row


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.number)
def test_every_function_of_a_row_exists_and_names_the_number(row: Row) -> None:
    for place in row.places:
        assert place in FUNCTIONS, f"({row.number}): {place} is not in the code"
        function = FUNCTIONS[place]
        assert row.number in function.own | function.file, f"{place} does not name ({row.number})"


def test_every_function_that_names_a_number_stands_in_the_list() -> None:
    listed = {(row.number, place) for row in ROWS for place in row.places}
    missing = [
        f"{f.place} names {', '.join(sorted(f.own))}"
        for f in FUNCTIONS.values()
        if f.own and not any((number, f.place) in listed for number in f.own)
    ]
    assert not missing, "not in physics/EQUATIONS.md: " + "; ".join(missing)


def test_every_number_named_in_the_code_is_known_to_the_list() -> None:
    known = {row.number for row in ROWS} | WITHOUT_ROW
    strange = {f.place: sorted(f.own - known) for f in FUNCTIONS.values() if f.own - known}
    assert not strange


def test_numbers_are_read_from_all_ways_of_writing_them() -> None:
    assert numbers("(2.5), see (3.19)–(3.21)") == {"2.5", "3.19", "3.20", "3.21"}
    assert numbers("(5.48, 5.49) and (6.33–6.35)") == {"5.48", "5.49", "6.33", "6.34", "6.35"}
    assert numbers("version 2.5, (1.234), clip(2.5)") == frozenset()
