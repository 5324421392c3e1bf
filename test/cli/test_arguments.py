"""Options of a command from the signature and docstring of its verb."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import pytest

from shake_ros.cli.arguments import CommandLine, parameter_texts
from shake_ros.quantities import ShakeError


def verb(
    source: str,
    name: str | Path = "bergamo",
    at: Sequence[float] | None = None,
    *,
    share: float = 0.5,
    most_runs: int | None = None,
    set: Mapping[str, float] | None = None,  # noqa: A002 (as a verb has it)
    fit: bool = False,
    progress: bool | Callable[[str], None] = True,
) -> None:
    """A verb.

    Parameters
    ----------
    source : a recording.
    name, at : of a table, and
        where.
    share : 50 % where not given [-].
    most_runs : at most.
    set : values.
    fit : whether.
    progress : show it.

    Raises
    ------
    ShakeError : never.
    """


@pytest.fixture
def line() -> CommandLine:
    found = CommandLine("thd")
    found.add_verb(verb, "fit", most_runs="runs")
    return found


def test_option_has_the_type_and_the_default_of_its_parameter(line: CommandLine) -> None:
    assert line.options(line.read([])) == {"name": "bergamo", "at": None, "share": 0.5, "most_runs": None, "set": {}}
    given = line.read(["--name", "x", "--at", "1", "2.5", "--runs", "3", "--set", "a=1", "b=2", "--set", "c.d=3"])
    changed = {"a": 1.0, "b": 2.0, "c.d": 3.0}
    assert line.options(given) == {"name": "x", "at": [1.0, 2.5], "share": 0.5, "most_runs": 3, "set": changed}
    assert given.line.startswith("./shake thd --name x --at 1 2.5 ")


def test_change_that_is_no_number_is_named(line: CommandLine) -> None:
    with pytest.raises(ShakeError, match=r"--set a=b: expected KEY=NUMBER"):
        line.options(line.read(["--set", "a=b"]))


def test_help_is_what_the_docstring_says(line: CommandLine) -> None:
    assert parameter_texts(verb)["at"] == "of a table, and where."
    text = " ".join(line.format_help().split())
    assert "--share X 50 % where not given (default: 0.5)" in text
    assert "--runs N at most" in text
    assert "--progress" not in text and "--source" not in text and "--fit" not in text
