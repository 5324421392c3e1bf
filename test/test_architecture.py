"""The house's own rules: which folder may import which, what a fresh process loads, what the repository may hold."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from shake_ros import settings

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = ROOT / "shake_ros"

# From the bottom up. A module may import from its own group (one folder or file) and from any lower layer.
LAYERS: tuple[tuple[str, ...], ...] = (
    ("quantities", "compiled", "failures", "entry_points"),
    ("packing",),
    ("physics.fluid", "physics.bulk_modulus", "physics.friction", "physics.valve"),
    ("physics.effects",),
    ("physics.plant",),
    ("control.laws", "control.observer", "control.reference", "signals", "safety"),
    ("control",),
    ("fit",),
    ("fit.nuisances",),
    ("fit.start",),
    ("search",),
    ("explain",),
    ("repair",),
    ("settings", "realtime", "result_folder"),
    ("declared",),
    ("recordings", "bridge"),
    ("report",),
    ("api",),
    # slices, each with its computation, verb and page
    ("iteration", "measured", "experiment_design", "twin"),
    ("commissioning",),
    ("qualification", "campaigns"),
    ("page",),  # the live page's web part: its node in ros feeds it, it shows what api reads and makes
    ("cli", "ros"),
    ("demonstration", "thesis"),  # nothing imports them
    ("__main__",),
)
# Arrows that go sideways or up, each with its reason.
ALLOWED = {
    ("shake_ros.cli.arguments", "shake_ros.ros.live_table"),  # a command that moves the table of a running graph
}
RANKS = {group: rank for rank, layer in enumerate(LAYERS) for group in layer}
# the rooms of mathematics, and what they stand on
MATHEMATICS = ("physics", "signals", "control", "safety", "fit", "search", "explain", "repair")
GROUND = ("quantities", "compiled", "failures", "packing")
ROS_MODULES = re.compile(r"^(rclpy|rcl_interfaces|builtin_interfaces|std_srvs|rosidl_\w+|\w+_msgs)$")
OUTSIDE_MATHEMATICS = {"pathlib", "yaml", "time", "datetime", "matplotlib", "rosbags", "mcap", "tqdm", "sqlite3"}
# the compiled code's cache is a folder, and its name a hash of the sources; a fit may be given some seconds
MAY_USE_FILES_AND_CLOCK = {"shake_ros/compiled.py", "shake_ros/fit/solver.py"}
BUILT = {".git", "build", "install", "log", "out", "__pycache__", ".pytest_cache", ".mypy_cache", ".ruff_cache"}
TEXT = {".py", ".md", ".yaml", ".yml", ".cfg", ".toml", ".xml", ".lock", ".in", ".txt", ".html", ".css", ".js", ""}


def sources(folder: Path = PACKAGE) -> list[Path]:
    return sorted(folder.rglob("*.py"))


def mathematics() -> list[Path]:
    rooms = [path for room in MATHEMATICS for path in sources(PACKAGE / room)]
    return rooms + [PACKAGE / f"{name}.py" for name in GROUND]


def imports(path: Path) -> Iterator[tuple[int, str]]:
    """Line and dotted name of everything that a file imports, within functions too."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}:{node.lineno}: a relative import"
            yield from ((node.lineno, f"{node.module}.{alias.name}") for alias in node.names)


def group(module: str) -> str:
    """The layer group of a dotted name: the longest known beginning behind `shake_ros.`; empty where there is none."""
    parts = module.split(".")[1:]
    return next((name for n in (2, 1) if (name := ".".join(parts[:n])) in RANKS), "")


def allowed(path: Path, name: str) -> bool:
    return any(module_of(path) == own and f"{name}.".startswith(f"{other}.") for own, other in ALLOWED)


def module_of(path: Path) -> str:
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


def test_every_module_belongs_to_a_layer() -> None:
    homeless = [
        m for path in sources() if not group(m := module_of(path)) and m not in ("shake_ros", "shake_ros.physics")
    ]
    assert not homeless


def test_imports_go_downward_only() -> None:
    wrong = []
    for path in sources():
        own = group(module_of(path))
        for line, name in imports(path):
            other = group(name) if name.startswith("shake_ros.") else ""
            if own and other and own != other and RANKS[other] >= RANKS[own] and not allowed(path, name):
                wrong.append(f"{path.relative_to(ROOT)}:{line}: {own} imports {other}")
    assert not wrong, "\n".join(wrong)


def test_only_the_folder_ros_imports_rclpy_or_messages() -> None:
    wrong = [
        f"{path.relative_to(ROOT)}:{line}: {name}"
        for path in sources()
        if PACKAGE / "ros" not in path.parents
        for line, name in imports(path)
        if ROS_MODULES.match(name.split(".")[0])
    ]
    assert not wrong, "\n".join(wrong)


def test_mathematics_has_no_files_no_clock_and_no_plotting() -> None:
    wrong = [
        f"{path.relative_to(ROOT)}:{line}: {name}"
        for path in mathematics()
        if path.relative_to(ROOT).as_posix() not in MAY_USE_FILES_AND_CLOCK
        for line, name in imports(path)
        if name.split(".")[0] in OUTSIDE_MATHEMATICS
    ]
    wrong += [
        f"{path.relative_to(ROOT)}:{node.lineno}: {ast.unparse(node.func)}"
        for path in mathematics()
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Call) and ast.unparse(node.func) in ("open", "print", "input", "np.load", "np.save")
    ]
    assert not wrong, "\n".join(wrong)


def test_mathematics_in_a_process_of_its_own_brings_no_ros_and_no_plotting() -> None:
    names = [module_of(path) for path in mathematics()]
    program = (
        f"import importlib, sys\nfor name in {names}: importlib.import_module(name)\n"
        "print('\\n'.join({name.split('.')[0] for name in sys.modules}))"
    )
    loaded = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=False)
    assert loaded.returncode == 0, loaded.stderr
    brought = set(loaded.stdout.split())
    assert "numba" in brought
    assert not [name for name in brought if ROS_MODULES.match(name) or name in ("matplotlib", "rosbags", "mcap")]


def test_only_compiled_kernels_go_without_annotations() -> None:
    wrong = []
    for path in [*sources(), *sources(ROOT / "benchmarks")]:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not isinstance(node, ast.FunctionDef):
                continue
            if any(name in ast.unparse(d) for d in node.decorator_list for name in ("njit", "kernel")):
                continue
            if node.returns is None:
                wrong.append(f"{path.relative_to(ROOT)}:{node.lineno}: {node.name}")
    assert not wrong, "\n".join(wrong)


def test_no_two_classes_have_one_name() -> None:
    homes: dict[str, list[str]] = {}
    for path in sources():
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                homes.setdefault(node.name, []).append(module_of(path))
    assert not {name: modules for name, modules in homes.items() if len(modules) > 1}


def test_the_python_face_prints_nothing_and_parses_no_arguments() -> None:
    wrong = [
        f"{path.relative_to(ROOT)}:{node.lineno}: {ast.unparse(node.func)}"
        for path in sources(PACKAGE / "api")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Call) and ast.unparse(node.func) in ("print", "input", "sys.exit", "exit")
    ]
    wrong += [path.name for path in sources(PACKAGE / "api") for _, name in imports(path) if name == "argparse"]
    assert not wrong, "\n".join(wrong)


def test_mathematics_is_tested_without_what_is_above_it() -> None:
    above = tuple(f"shake_ros.{name}" for layer in LAYERS[RANKS["report"] :] for name in layer)
    wrong = [
        f"{path.relative_to(ROOT)}:{line}: {name}"
        for room in MATHEMATICS
        for path in sources(ROOT / "test" / room)
        for line, name in imports(path)
        if name.startswith(above)
    ]
    assert not wrong, "\n".join(wrong)


def test_benchmarks_import_neither_commands_nor_by_an_edited_path() -> None:
    files = sources(ROOT / "benchmarks")
    wrong = [
        f"{path.relative_to(ROOT)}:{line}: {name}"
        for path in files
        for line, name in imports(path)
        if name.startswith("shake_ros.cli")
    ]
    wrong += [str(path.relative_to(ROOT)) for path in files if "sys.path" in path.read_text(encoding="utf-8")]
    assert files
    assert not wrong, "\n".join(wrong)


def test_independent_simulators_import_nothing_of_the_package() -> None:
    files = [ROOT / "benchmarks" / f"{n}.py" for n in ("discovery/hidden_tables", "discovery/foreign_tables")]
    files.append(ROOT / "benchmarks" / "plant" / "reference_model.py")
    assert not [name for path in files for _, name in imports(path) if name.startswith("shake_ros")]


def test_no_drawers_for_odds_and_ends() -> None:
    names = {"utils", "util", "helpers", "helper", "misc", "common"}
    assert not [path for path in sources() if path.stem in names or path.parent.name in names]


def test_no_unfinished_places() -> None:
    marks = re.compile(r"\b(TODO|FIXME|XXX|NotImplementedError)\b")
    wrong = [
        f"{path.relative_to(ROOT)}:{number}: {line.strip()}"
        for path in sources()
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if marks.search(line)
    ]
    assert not wrong, "\n".join(wrong)


def repository_files() -> list[Path]:
    """The text files that git tracks, or (without git) all but what is built."""
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=False)
    if listed.returncode == 0 and listed.stdout:
        paths = [ROOT / name for name in listed.stdout.split("\0") if name]
    else:
        paths = [path for path in ROOT.rglob("*") if not BUILT & set(path.relative_to(ROOT).parts)]
    hidden = re.compile(r"^\.venv")
    return [
        path
        for path in paths
        if path.is_file() and path.suffix in TEXT and not hidden.match(path.relative_to(ROOT).parts[0])
    ]


def test_no_paths_of_a_machine_in_the_repository() -> None:
    places = re.compile(r"(?<![\w.])/(home|Users|root|work|tmp/w)/\w|file://|https?://[^\s/]*:\d+@")
    wrong = [
        f"{path.relative_to(ROOT)}:{number}: {line.strip()[:120]}"
        for path in repository_files()
        if path != Path(__file__).resolve()
        for number, line in enumerate(path.read_text(encoding="utf-8", errors="replace").splitlines(), 1)
        if places.search(line)
    ]
    assert not wrong, "\n".join(wrong)


def test_lock_files_hold_pinned_versions_and_no_address() -> None:
    for path in ROOT.glob("requirements*.lock"):
        for line in path.read_text(encoding="utf-8").splitlines():
            assert re.match(r"^[\w.-]+(\[[\w,]+\])?==[\w.]+( ; .+)?$", line), f"{path.name}: {line}"


@pytest.mark.parametrize(
    "path", sorted((ROOT / "config").rglob("*.yaml")), ids=lambda path: path.relative_to(ROOT / "config").as_posix()
)
def test_every_configuration_file_is_strict_yaml_with_content(path: Path) -> None:
    content = settings.read_yaml(path)
    assert isinstance(content, dict)
    assert content
