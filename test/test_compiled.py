"""Compiled code follows its sources: an edit anywhere in the package is seen, plain Python gives the same numbers."""

from __future__ import annotations

import ast
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks.plant import reference_model as reference
from shake_ros.compiled import PACKAGE, imported, source_hash
from shake_ros.physics.plant.simulation import run
from shake_ros.settings import load_table

FLOW = """
import numba  # before the package: its settings are read by then
from shake_ros.settings import load_table
from shake_ros.physics.plant.parameters import records
from shake_ros.physics.plant.right_hand_side import port_flows
print(port_flows(records(load_table("bergamo").vector())[0], 0.5, 0.0, 1e7, 1e7, 2e7)[0])
"""
EDIT_WHILE_RUNNING = (
    FLOW
    + """
import subprocess, sys
from pathlib import Path
import shake_ros.physics.valve.ports as ports
path = Path(ports.__file__)
path.write_text(path.read_text().replace("min(max(x, 0.0), 1.0)", "0.25"))
print(subprocess.run([sys.executable, "-c", sys.argv[1]], capture_output=True, text=True, check=True).stdout)
"""
)
SAME = """
import sys
import numpy as np
from shake_ros.physics.plant.simulation import run
from shake_ros.settings import load_table
changes = {"effects.soft_zone.depth": 0.5, "effects.supply_droop.resistance": 1e9}
changes["effects.entrained_air.fraction"] = 0.01
commands = np.load(sys.argv[1])
np.save(sys.argv[2], [run(load_table("bergamo").with_values(c), commands, 0.001) for c in ({}, changes)])
"""


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the package and its configuration that may be edited."""
    folder, skipped = tmp_path_factory.mktemp("copy"), shutil.ignore_patterns("__pycache__")
    shutil.copytree(PACKAGE, folder / "shake_ros", ignore=skipped)
    shutil.copytree(PACKAGE.parent / "config", folder / "config")
    return folder


def python(folder: Path, code: str, *arguments: str, **environment: str) -> str:
    """Standard output of a Python process that imports the package from `folder`."""
    clean = {k: v for k, v in os.environ.items() if not k.startswith("NUMBA_")}
    clean.update(PYTHONPATH=str(folder), PYTHONDONTWRITEBYTECODE="1", **environment)
    command = [sys.executable, "-c", code, *arguments]
    done = subprocess.run(command, check=False, cwd=folder, env=clean, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_hash_follows_a_file_and_what_it_imports_and_nothing_else(copy: Path) -> None:
    program = (
        "from shake_ros.compiled import PACKAGE, source_hash\n"
        "print(*(source_hash(PACKAGE / 'physics' / name) for name in "
        "('plant/right_hand_side.py', 'friction/tustin.py', 'bulk_modulus/lee.py')))"
    )
    physics = copy / "shake_ros" / "physics"
    before = python(copy, program).split()
    assert before == [
        source_hash(PACKAGE / "physics" / name)
        for name in ("plant/right_hand_side.py", "friction/tustin.py", "bulk_modulus/lee.py")
    ]
    path = physics / "friction" / "tustin.py"
    path.write_text(path.read_text(encoding="utf-8") + "\n", encoding="utf-8")
    after = python(copy, program).split()
    assert [a == b for a, b in zip(before, after, strict=True)] == [False, False, True]


def test_an_edited_kernel_of_another_file_is_seen_at_once_also_by_a_child(copy: Path) -> None:
    cache = str(copy / "cache")
    before, after = python(copy, EDIT_WHILE_RUNNING, FLOW, XDG_CACHE_HOME=cache).split()
    both_a_quarter_open = 1.81e-7 * 0.25 * (np.sqrt(1e7) - np.sqrt(1e7 - 1e5))
    assert float(after) == pytest.approx(both_a_quarter_open, rel=1e-2)
    assert float(before) == pytest.approx(1.81e-7 * 0.505 * np.sqrt(1e7), rel=1e-4)
    assert python(copy, FLOW, XDG_CACHE_HOME=cache).split() == [after]
    assert list((copy / "cache").rglob("*.nbc"))
    assert not list((copy / "shake_ros").rglob("*.nb[ci]"))  # nothing compiled lies among the sources


def test_every_file_of_the_package_that_is_imported_counts() -> None:
    for path in PACKAGE.rglob("*.py"):
        named = {
            f"{node.module}.{alias.name}"
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("shake_ros.")
            for alias in node.names
        }
        found = {".".join(("shake_ros", *p.relative_to(PACKAGE).with_suffix("").parts)) for p in imported(path)}
        for name in named:
            assert name in found or name.rpartition(".")[0] in found or f"{name.rpartition('.')[0]}.__init__" in found


def test_plain_python_gives_the_compiled_numbers(tmp_path: Path) -> None:
    commands = reference.sine(0.5, 8.0, 0.06)
    np.save(tmp_path / "commands.npy", commands)
    python(PACKAGE.parent, SAME, str(tmp_path / "commands.npy"), str(tmp_path / "plain.npy"), NUMBA_DISABLE_JIT="1")
    plain = np.load(tmp_path / "plain.npy")
    changes = {
        "effects.soft_zone.depth": 0.5,
        "effects.supply_droop.resistance": 1e9,
        "effects.entrained_air.fraction": 0.01,
    }
    for made, table in zip(plain, (load_table("bergamo"), load_table("bergamo").with_values(changes)), strict=True):
        np.testing.assert_allclose(made, run(table, commands, 0.001), rtol=1e-7, atol=1e-7)
