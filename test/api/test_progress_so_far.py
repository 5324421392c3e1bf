"""Answers that work has before its end stay on the screen."""

from __future__ import annotations

import pytest

from shake_ros.api.progress import SO_FAR, Progress


def test_an_answer_so_far_is_a_line_each_time(capsys: pytest.CaptureFixture[str]) -> None:
    with Progress("work") as bar:
        bar("one thing", 0.1)
        bar(f"{SO_FAR}a", 0.2)
        bar("one thing", 0.3)
        bar(f"{SO_FAR}a", 0.4)
    lines = capsys.readouterr().err.splitlines()
    assert lines == ["work: one thing", "work: best so far: a", "work: best so far: a"]


def test_a_function_is_called_with_it_as_with_anything_else() -> None:
    told = list[str]()
    with Progress("work", lambda text, part: told.append(text)) as bar:
        bar(f"{SO_FAR}a", 0.2)
    assert told == ["best so far: a"]
