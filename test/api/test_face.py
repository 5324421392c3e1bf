"""The Python face: its table of names, what a fresh process loads, how fast."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

import shake_ros
from shake_ros.quantities import ShakeError

ROOT = Path(shake_ros.__file__).resolve().parent.parent
HEAVY = {"rclpy", "numba", "numpy", "scipy", "matplotlib", "rosbags", "tqdm"}


@pytest.mark.parametrize("name", shake_ros.PUBLIC)
def test_every_name_is_documented(name: str) -> None:
    assert getattr(shake_ros, name).__doc__
    assert name in dir(shake_ros)


def test_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="no attribute 'reed'"):
        shake_ros.reed  # noqa: B018


def test_type_checkers_see_the_names_of_the_table() -> None:
    (guarded,) = [node for node in ast.parse(Path(shake_ros.__file__).read_text()).body if isinstance(node, ast.If)]
    seen = {
        alias.asname: node.module for node in guarded.body if isinstance(node, ast.ImportFrom) for alias in node.names
    }
    assert seen == shake_ros.PUBLIC


def test_import_in_a_fresh_process_brings_nothing_heavy_and_is_quick() -> None:
    program = (
        "import time; begin = time.perf_counter(); import shake_ros, sys; print(time.perf_counter() - begin);"
        "print(*{name.split('.')[0] for name in sys.modules})"
    )
    printed = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True)
    seconds, loaded = printed.stdout.splitlines()
    assert not HEAVY & set(loaded.split())
    assert float(seconds) < 0.5


def test_no_name_brings_ros_or_plotting() -> None:
    program = (
        f"import shake_ros, sys\nfor name in {list(shake_ros.PUBLIC)}: getattr(shake_ros, name)\n"
        "print(*{name.split('.')[0] for name in sys.modules})"
    )
    printed = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True)
    assert not {"rclpy", "matplotlib"} & set(printed.stdout.split())


@pytest.mark.parametrize("verb", [shake_ros.close_loop, shake_ros.identify])
def test_a_model_given_by_its_name_is_refused_in_one_line(verb: Callable[..., object]) -> None:
    with pytest.raises(ShakeError, match=r"model: expected a Model, such as sr.model\('unknown'\), not 'full'$"):
        verb("full", "runs", "others")


@pytest.mark.parametrize("verb", [shake_ros.commission, partial(shake_ros.follow, "runs")])
def test_a_model_in_the_place_of_a_table_is_refused_in_one_line(verb: Callable[..., object]) -> None:
    with pytest.raises(ShakeError, match=r"table: expected a name, a file or a table, not a Model$"):
        verb(table=shake_ros.model())
