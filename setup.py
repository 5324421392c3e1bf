"""Installation by pip and by colcon; names, versions and dependencies are in setup.cfg.

`ros2 run shake_ros NAME` looks for lib/shake_ros/NAME. pip does not honour the `install_scripts` folder of
setup.cfg, so those executables are data files: one small shell script for each entry point, written here from
the table ENTRY_POINTS of shake_ros/entry_points.py.
"""

from __future__ import annotations

import ast
from pathlib import Path

from setuptools import setup

ROOT = Path(__file__).resolve().parent
EXECUTABLES = Path("build") / "executables"

EXECUTABLE = """#!/bin/sh
# Entry point {name} of shake_ros, for `ros2 run shake_ros {name}`; with the Python beside it where there is one.
prefix=$(CDPATH= cd -- "$(dirname -- "$0")/../.." && pwd -P)
python=$prefix/bin/python3
[ -x "$python" ] || python=python3
exec "$python" -m shake_ros {name} "$@"
"""


def entry_points() -> list[str]:
    """The names in the table ENTRY_POINTS, read without importing the package."""
    tree = ast.parse((ROOT / "shake_ros" / "entry_points.py").read_text(encoding="utf-8"))
    for node in tree.body:
        if isinstance(node, ast.AnnAssign) and ast.unparse(node.target) == "ENTRY_POINTS":
            assert isinstance(node.value, ast.Dict), "ENTRY_POINTS is not a literal table"
            return [ast.literal_eval(key) for key in node.value.keys if key is not None]
    raise SystemExit("shake_ros/entry_points.py holds no table ENTRY_POINTS")


def executables() -> list[str]:
    """Write the executables and return their paths, relative to this folder."""
    paths = []
    (ROOT / EXECUTABLES).mkdir(parents=True, exist_ok=True)
    for name in entry_points():
        path = ROOT / EXECUTABLES / name
        path.write_text(EXECUTABLE.format(name=name), encoding="utf-8")
        path.chmod(0o755)
        paths.append(str(EXECUTABLES / name))
    return paths


def configuration() -> list[tuple[str, list[str]]]:
    """Every file of config/ with the folder where it is installed."""
    files: dict[str, list[str]] = {}
    for path in sorted(path for path in (ROOT / "config").rglob("*") if path.is_file()):
        relative = path.relative_to(ROOT)
        files.setdefault(f"share/shake_ros/{relative.parent.as_posix()}", []).append(str(relative))
    return list(files.items())


setup(
    python_requires=">=3.10,<3.15",  # not in setup.cfg: there it becomes an object that colcon cannot read
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/shake_ros"]),
        ("share/shake_ros", ["package.xml"]),
        ("lib/shake_ros", executables()),
        ("share/shake_ros/launch", ["launch/table.launch.py"]),
        *configuration(),
    ],
)
