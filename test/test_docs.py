"""README and the manual: every link leads somewhere, every command is one that the repository has, Python blocks run.

Commands are parsed by the program that they name: options, choices, configurations and parameters must exist.
Those that are cheap are run as well, in a folder with recordings.
"""

from __future__ import annotations

import argparse
import importlib
import re
import runpy
import shlex
import subprocess
import sys
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest
import yaml

import shake_ros as sr
from docs.generators import commands as commands_page
from shake_ros.__main__ import main
from shake_ros.entry_points import COMMANDS, ENTRY_POINTS, NODES
from shake_ros.settings import config_folder

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))  # benchmarks and docs are packages of the repository
GENERATED = "docs/reference/generated"
PAGES = sorted(
    path.relative_to(ROOT).as_posix()
    for path in [
        ROOT / "README.md",
        ROOT / "CONTRIBUTING.md",
        *(ROOT / "msg_docs").glob("*.md"),
        *ROOT.glob("docs/**/*.md"),
    ]
    if GENERATED not in path.as_posix()
)
FENCE = re.compile(r"^ *```([^\n`]*)\n(.*?)^ *```$", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"(?<!`)\[[^\]\n]*(?:\n[^\]\n]*)?\]\(([^)\s]+)\)")
INLINE = re.compile(r"`((?:\./shake|python -m|PYTHONPATH=)[^`]*)`")
PATHS = re.compile(r"`((?:shake_ros|config|test|benchmarks|docs|examples|msg_docs)/[\w./-]+)`")
PLACEHOLDERS = {"NAME", "DIR", "FILE", "BAG", "PATH", "PYTHON", "CONTROLLER", "REFERENCE"}
RUN = {"import_csv", "figures"}  # cheap enough to run, beside being parsed
RAN: list[list[str]] = []  # what was run already for another page
MADE = {
    "out/loop/table.yaml",
    "my_table.yaml",
    "drive.yaml",
    "out/loop/controller.yaml",
    "out/loop/observer.yaml",
}  # files of the reader's own
CONFIGURED = {"table", "reference", "observer", "controller", "bridge", "interlock", "model"}
OTHERS = {
    "pip",
    "pre-commit",
    "ss",
    "export",
    "echo",
    "colcon",
    "bash",
    "plotjuggler",
}  # programs of the system, taken as they are


def text(page: str) -> str:
    return (ROOT / page).read_text(encoding="utf-8")


def blocks(page: str, language: str) -> list[str]:
    return [body for kind, body in FENCE.findall(text(page)) if kind == language]


def prose(page: str) -> str:
    return FENCE.sub("", text(page))


class Parsed(Exception):
    """The command line was understood; carries what the parser made of it."""


def parse(module: str, arguments: list[str], function: str = "main") -> argparse.Namespace:
    """Let a program's own parser read the arguments, and go no further."""
    real = argparse.ArgumentParser.parse_args

    def stop(self: argparse.ArgumentParser, args: list[str] | None = None, namespace: object = None) -> None:
        raise Parsed(real(self, args, namespace))  # type: ignore[call-overload]

    program = getattr(importlib.import_module(module), function)
    with (
        patch.object(argparse.ArgumentParser, "parse_args", stop),
        patch.object(sys, "argv", [module, *arguments]),
        patch.object(argparse.ArgumentParser, "error", refuse),
    ):
        try:
            program(arguments) if program.__code__.co_argcount else program()
        except Parsed as parsed:
            namespace: argparse.Namespace = parsed.args[0]
            return namespace
    raise AssertionError(f"{module} parses no arguments")


def refuse(self: argparse.ArgumentParser, message: str) -> None:
    raise AssertionError(f"{self.prog}: {message}")


@pytest.fixture(scope="session")
def generated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The pages that the build makes from the code."""
    folder = tmp_path_factory.mktemp("generated")
    subprocess.run([sys.executable, str(ROOT / "docs" / "generators"), str(folder)], check=True)
    return folder


@pytest.fixture(scope="session")
def parameters(generated: Path) -> dict[str, set[str]]:
    """Names of the parameters of every node, from the generated page."""
    page = (generated / "nodes.md").read_text(encoding="utf-8")
    sections = re.split(r"^## ", page, flags=re.MULTILINE)[1:]
    found = {
        part.split("\n")[0].strip("`"): set(re.findall(r"^\| `([\w.]+)`", part, re.MULTILINE)) for part in sections
    }
    shared = found.pop("Every node")
    return {name: own | shared for name, own in found.items()}


@pytest.fixture(scope="session")
def laboratory(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with what the pages take for granted: recordings, a CSV file, a table."""
    folder = tmp_path_factory.mktemp("laboratory")
    time = np.arange(0.0, 1.0, 0.002)
    for seed, name in enumerate(("run1", "run2", "run3", "my_bag")):
        run = sr.simulate("bergamo", 0.2 * np.sin(2 * np.pi * 4.0 * time + seed), 0.002, seed=seed)
        run.write(folder / name)
        columns = np.column_stack([time, run.command, 1e3 * run.position, run.acceleration])
        np.savetxt(folder / f"{name}.csv", columns, "%.9g", ",", header="t_s,u,x,a", comments="")
    time = np.arange(0.0, 12.0, 0.002)
    waves = 2.0 * np.pi * np.random.default_rng(1).uniform(2.0, 12.0, (20, 1))
    position, acceleration = (np.sum(w * np.sin(waves * time), axis=0) for w in (1e-3 / waves, -1e-3 * waves))
    for name, columns in (
        (
            "run7",
            {"t_ms": 1e3 * time, "mA": 12.0 + np.sin(time), "x_mm": 1e3 * position, "a_g": acceleration / 9.80665},
        ),
        ("run8", {"t": time, "u": np.sin(time), "x": position}),
        ("imu8", {"ts": 50.0 + time[500:5500], "a": acceleration[500:5500]}),
    ):
        cells = np.column_stack(list(columns.values()))
        np.savetxt(folder / f"{name}.csv", cells, "%.9g", ",", header=",".join(columns), comments="")
    (folder / "my_table.yaml").write_text((config_folder() / "table" / "bergamo.yaml").read_text(encoding="utf-8"))
    return folder


class Checker:
    """Judges one command line of a page; raises AssertionError with what is wrong."""

    def __init__(self, parameters: dict[str, set[str]], laboratory: Path) -> None:
        self.parameters = parameters
        self.laboratory = laboratory

    def line(self, line: str) -> None:
        words = shlex.split(line, comments=True)
        while words and re.fullmatch(r"[A-Z_]+=\S*", words[0]):  # the environment
            words.pop(0)
        if "|" in words:
            for part in line.split("|"):
                self.line(part)
            return
        if not words or set(words) & {"…"} or any(word.strip("[].") in PLACEHOLDERS for word in words[1:2]):
            self.placeholder(words)
            return
        words = [word for word in words if word not in ("…", "[…]")]
        program, *arguments = words
        if program == "./shake":
            self.shake(arguments)
        elif program in ("python", ".venv/bin/python"):
            self.python(arguments)
        elif program == "ros2":
            self.ros2(arguments)
        elif program == "bash":
            assert (ROOT / arguments[0]).is_file(), line
        else:
            assert program in OTHERS, f"unknown program: {line}"

    def placeholder(self, words: list[str]) -> None:
        if words and words[0] == "./shake" and len(words) > 1 and words[1] not in PLACEHOLDERS:
            assert words[1] in ENTRY_POINTS or words[1] in ("test", "docs", "…"), words

    def python(self, arguments: list[str]) -> None:
        if arguments[0] != "-m":
            assert (ROOT / arguments[0]).exists(), arguments
            return
        module, *rest = arguments[1:]
        if module == "shake_ros":
            self.shake(rest)
        elif any(word in PLACEHOLDERS for word in module.split(".")):
            return
        else:
            assert module.startswith("benchmarks."), module
            parse(module, [("run1" if word in PLACEHOLDERS else word) for word in rest])

    def shake(self, arguments: list[str]) -> None:
        if not arguments or arguments[0] == "docs":
            return
        name, *rest = arguments
        if name == "test":
            for word in rest:
                assert not word.startswith(("test/", "shake_ros/")) or (ROOT / word).exists(), word
        elif name in NODES and rest[:1] == ["--ros-args"]:
            self.node(name, rest[1:])
        elif name in NODES:
            assert not rest or rest == ["--help"] or (name == "recorder" and rest[0] == "--recover"), arguments
        else:
            assert name in COMMANDS, f"no entry point {name}"
            self.command(name, rest)

    def command(self, name: str, rest: list[str]) -> None:
        if rest == ["--help"] or name == "ros2":
            return
        filled = [re.sub(r"^(" + "|".join(PLACEHOLDERS) + r")\b", "run1", word) for word in rest]
        found = parse(COMMANDS[name].module, filled, COMMANDS[name].function)
        for key in CONFIGURED & set(vars(found)):
            self.configuration(key, getattr(found, key))
        if name in RUN and filled == rest and rest not in RAN:
            RAN.append(rest)
            with pytest.MonkeyPatch.context() as here:
                here.chdir(self.laboratory)
                assert main([name, *rest, "--overwrite" if name == "import_csv" else "--force"]) == 0

    def configuration(self, kind: str, name: object) -> None:
        if not isinstance(name, str) or (
            kind == "model" and name in ("full", "reduced", "axis", "load", "fixed", "none")
        ):
            return
        kind = "table" if kind == "model" else kind
        known = {path.stem for path in (config_folder() / kind).glob("*.yaml")}
        own = name == "own" and kind in ("observer", "controller")  # made for the table
        assert own or name in known or name in MADE or (self.laboratory / name).exists(), f"no {kind} {name}"

    def node(self, node: str, words: list[str]) -> None:
        for flag, word in zip(words[::2], words[1::2], strict=True):
            if flag == "-p":
                name, separator, value = word.partition(":=")
                assert separator, word
                self.parameter(node, name)
                if name in CONFIGURED:
                    self.configuration(name, value)
            else:
                assert flag in ("-r", "--params-file") or flag == "--enclave", flag

    def parameter(self, node: str, name: str) -> None:
        assert node in self.parameters, f"no node {node}"
        assert name in self.parameters[node], f"{node} has no parameter {name}"

    def ros2(self, arguments: list[str]) -> None:
        verb, *rest = arguments
        if verb == "run":
            assert rest[0] == "shake_ros" and (rest[1] in ENTRY_POINTS or rest[1] in PLACEHOLDERS), arguments
        elif verb == "param":
            assert rest[0] in ("set", "get") and rest[1].startswith("/shake/"), arguments
            self.parameter(rest[1].removeprefix("/shake/"), rest[2])
        else:
            assert verb in ("security", "bag", "launch", "topic", "service"), arguments


@pytest.fixture
def check(parameters: dict[str, set[str]], laboratory: Path) -> Checker:
    return Checker(parameters, laboratory)


def commands(page: str) -> Iterator[str]:
    for block in blocks(page, "sh"):
        for line in block.replace("\\\n", " ").splitlines():
            if line.split("#")[0].strip():
                yield line.strip()
    yield from (match.replace("\n", " ") for match in INLINE.findall(prose(page)))


@pytest.mark.parametrize("page", PAGES)
def test_every_command_is_understood(page: str, check: Checker) -> None:
    for line in commands(page):
        try:
            check.line(line)
        except AssertionError as error:
            raise AssertionError(f"{page}: {line}: {error}") from None


WRONG = (
    "./shake identfy --learn run1 --out out",
    "./shake identify --lern run1 --out out",
    "./shake close_loop --learn run1 --hold run2 --model fully --out out",
    "./shake plant --ros-args -p tabel:=bergamo",
    "./shake plant --ros-args -p table:=pisa",
    "./shake controller --ros-args -p controller:=superb",
    "./shake test test/physics/frictions",
    "./shake import_csv run9.csv --time t_s --command u --position x --out run9",
    "python -m benchmarks.control.comparisons",
    "python -m benchmarks.realtime.timing --second 3 --nothing",
    "ros2 param set /shake/plant supply.pressure 1.8e7",
    "ros2 run shake_ros plants",
    "shakes plant",
)


@pytest.mark.parametrize("line", WRONG)
def test_a_wrong_name_option_or_file_is_noticed(line: str, check: Checker) -> None:
    with pytest.raises((AssertionError, ModuleNotFoundError, SystemExit)):
        check.line(line)


def anchors(page: Path) -> set[str]:
    """Anchors of a page's headings, as GitHub and MyST make them."""
    headings = re.findall(r"^#+ (.+)$", FENCE.sub("", page.read_text(encoding="utf-8")), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).strip().replace(" ", "-") for heading in headings}


def target_of(page: str, link: str, generated: Path) -> Path:
    """The file that a relative link of a page leads to; pages made by the build stand in `generated`."""
    path = ((ROOT / page).parent / link).resolve()
    made = ROOT / GENERATED
    return generated / path.relative_to(made) if path.is_relative_to(made) else path


@pytest.mark.parametrize("page", PAGES)
def test_every_link_leads_somewhere(page: str, generated: Path) -> None:
    for link in LINK.findall(prose(page)):
        if re.match(r"https?://", link):
            continue
        file, _, anchor = link.partition("#")
        target = target_of(page, file, generated) if file else ROOT / page
        if target.parent == generated / "figures":
            assert re.sub("^figure_", "", target.stem) in figure_names(), f"{page}: no figure {link}"
            continue
        assert target.exists(), f"{page}: {link}"
        assert not anchor or anchor in anchors(target), f"{page}: {link}"


@lru_cache
def figure_names() -> frozenset[str]:
    """Names that `./shake figures` knows, as its files have them."""
    page = commands_page.help_of("figures")
    return frozenset(name.replace(".", "_") for name in re.findall(r"^  (\S+) ", page, re.MULTILINE))


@pytest.mark.parametrize("page", [page for page in PAGES if page.startswith("docs/") and page != "docs/index.md"])
def test_every_page_of_the_manual_stands_in_a_table_of_contents(page: str) -> None:
    """As `./shake docs` demands it."""
    listed = {
        (contents.parent / entry).relative_to(ROOT).as_posix()
        for contents in ROOT.glob("docs/**/*.md")
        for kind, body in FENCE.findall(contents.read_text(encoding="utf-8"))
        if kind == "{toctree}"
        for entry in body.split()
        if not entry.startswith(":")
    }
    assert page.removesuffix(".md") in listed


@pytest.mark.parametrize("page", PAGES)
def test_every_path_that_is_named_exists(page: str) -> None:
    for path in PATHS.findall(prose(page)):
        if not any(word in path for word in PLACEHOLDERS):
            assert (ROOT / path).exists(), f"{page}: {path}"


@pytest.mark.parametrize("page", [page for page in PAGES if blocks(page, "python")])
def test_python_blocks_run(page: str, laboratory: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(laboratory)
    for block in blocks(page, "python"):
        # examples/close_the_loop.py is one, which test_examples.py runs; the others need minutes, or a running graph
        if any(name in block for name in ("close_loop", "sr.commission", "live_table")):
            compile(block, page, "exec")
            continue
        path = laboratory / "block.py"
        path.write_text(block, encoding="utf-8")
        runpy.run_path(str(path))


@pytest.mark.parametrize("page", [page for page in PAGES if blocks(page, "yaml")])
def test_yaml_blocks_can_be_read(page: str) -> None:
    for block in blocks(page, "yaml"):
        assert isinstance(yaml.safe_load(block), dict)


def test_every_effect_tells_what_it_looks_like() -> None:
    from shake_ros.physics.effects import EFFECTS

    told = set(re.findall(r"^### `(\w+)`", text("docs/explanation/effects.md"), re.MULTILINE))
    assert told == set(EFFECTS) - {"unlisted"}


def test_readme_is_short_and_its_picture_small() -> None:
    lines = text("README.md").splitlines()
    assert len(lines) <= 150
    assert max(map(len, lines)) <= 120
    assert (ROOT / "docs" / "images" / "report.png").stat().st_size < 300_000


def test_one_version() -> None:
    assert yaml.safe_load(text("CITATION.cff"))["version"] == sr.__version__
    assert f"## {sr.__version__} " in text("CHANGELOG.md")
    assert f"<version>{sr.__version__}</version>" in text("package.xml")
