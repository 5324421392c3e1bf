"""Installation and the launcher, with stand-ins for Python and pip: no network and no environment is needed."""

from __future__ import annotations

import os
import re
import runpy
import shutil
import subprocess
import sys
import time
import xml.etree.ElementTree as ET
from configparser import ConfigParser
from pathlib import Path
from typing import Any

import pytest
import yaml

import shake_ros
from docs.generators import changelog
from shake_ros.entry_points import ENTRY_POINTS

ROOT = Path(__file__).resolve().parent.parent

# Stands for a system Python: makes "environments" whose python3 notes what it is asked to do.
PYTHON = """#!/bin/sh
case "$*" in
    *realpath*) [ -z "$OLD" ] || exit 1; echo "$0" ;;
    *find_spec*) [ -n "$HAS_RCLPY" ] ;;
    *ensurepip*) [ -z "$NO_VENV" ] ;;
    -V) echo "Python 3.${OLD:-12}.1" ;;
    "-m venv "*)
        for folder; do :; done
        mkdir -p "$folder/bin" "$folder/lib/python3.12/site-packages"
        echo "making $*" >> "$NOTES"
        cp "$INNER" "$folder/bin/python3" ;;
esac
"""
INNER = """#!/bin/sh
case "$*" in
    "-m pip "*)
        echo "pip $*" >> "$NOTES"
        [ -z "$KILLED" ] || { rm "$KILLED"; kill -9 "$PPID"; }
        [ -z "$NO_NETWORK" ] || { echo "NewConnectionError: x"; echo "ERROR: No matching distribution"; exit 1; } ;;
    -c*) ;;
    *) echo "run $(pwd): $*${PYTHONDONTWRITEBYTECODE:+ without bytecode}" ;;
esac
"""


class Launcher:
    """A copy of ./shake with its lock files in a folder of its own, and the stand-ins on its PATH."""

    def __init__(self, folder: Path) -> None:
        self.root = folder / "a folder"
        self.notes = folder / "notes"
        tools = folder / "bin"
        for path in (self.root, tools):
            path.mkdir()
        for name in ("shake", "requirements.lock", "requirements-ros.lock"):
            shutil.copy(ROOT / name, self.root)
        self.inner = folder / "inner"
        self.python = tools / "python3"
        for path, text in ((self.python, PYTHON), (self.inner, INNER)):
            path.write_text(text)
            path.chmod(0o755)
        uname = tools / "uname"
        uname.write_text('#!/bin/sh\ncase $1 in -s) echo Linux ;; *) echo "${MACHINE:-x86_64}" ;; esac\n')
        uname.chmod(0o755)
        for name in ("dirname", "readlink", "cat", "cksum", "rm", "tail", "ln", "sleep", "grep", "mv", "mkdir", "cp"):
            (tools / name).symlink_to(str(shutil.which(name)))
        self.environment = {"PATH": str(tools), "NOTES": str(self.notes), "INNER": str(self.inner)}

    def run(
        self, *arguments: str, start: Path | None = None, cwd: Path | None = None, **settings: str
    ) -> subprocess.CompletedProcess[str]:
        command = [str(start or self.root / "shake"), *arguments]
        environment = {**self.environment, **settings}
        return subprocess.run(
            command, cwd=cwd or "/", env=environment, capture_output=True, text=True, timeout=30, check=False
        )

    def set_ups(self) -> int:
        return self.notes.read_text().count("making ") if self.notes.is_file() else 0


@pytest.fixture
def launcher(tmp_path: Path) -> Launcher:
    return Launcher(tmp_path)


def only_line(result: subprocess.CompletedProcess[str]) -> str:
    lines = [line for line in result.stderr.splitlines() if "setting up" not in line]
    assert result.returncode != 0
    assert result.stdout == ""
    assert len(lines) == 1
    return lines[0]


def test_first_start_sets_up_and_the_second_starts_at_once(launcher: Launcher) -> None:
    first = launcher.run("plant", "--ros-args", "-p", "a:=b c")
    assert first.stdout == "run /: -m shake_ros plant --ros-args -p a:=b c\n"
    assert "requirements-ros.lock" in launcher.notes.read_text()
    begin = time.perf_counter()
    second = launcher.run("demo", PYTHONDONTWRITEBYTECODE="1")
    assert second.stdout == "run /: -m shake_ros demo\n"
    assert second.stderr == ""
    assert launcher.set_ups() == 1
    assert time.perf_counter() - begin < 2.0  # 0.02 s on a quiet machine


def test_a_changed_lock_file_renews_the_environment(launcher: Launcher) -> None:
    launcher.run()
    with (launcher.root / "requirements.lock").open("a") as lock:
        lock.write("wheel==0.45.0\n")
    assert launcher.run().returncode == 0
    assert launcher.set_ups() == 2


def test_an_interrupted_set_up_is_repaired_by_the_next_start(launcher: Launcher, tmp_path: Path) -> None:
    killed = tmp_path / "once"
    killed.touch()
    assert launcher.run("demo", KILLED=str(killed)).returncode == -9
    assert (launcher.root / ".venv.lock").is_symlink()
    assert launcher.run("demo").stdout == "run /: -m shake_ros demo\n"
    assert not (launcher.root / ".venv.lock").is_symlink()
    assert launcher.set_ups() == 2


def test_two_first_starts_at_once_set_up_once(launcher: Launcher) -> None:
    command = [str(launcher.root / "shake"), "demo"]
    both = [subprocess.Popen(command, env=launcher.environment, stdout=subprocess.PIPE, text=True) for _ in range(2)]
    assert [process.communicate(timeout=30)[0].count("run ") for process in both] == [1, 1]
    assert launcher.set_ups() == 1


def test_starts_through_a_link_from_anywhere(launcher: Launcher, tmp_path: Path) -> None:
    link = tmp_path / "link"
    link.symlink_to("a folder/shake")
    assert launcher.run("plant", start=link, cwd=tmp_path).stdout == f"run {tmp_path}: -m shake_ros plant\n"


def test_the_word_test_runs_the_suite_at_the_root(launcher: Launcher) -> None:
    assert launcher.run("test", "-k", "one two").stdout == f"run {launcher.root}: -m pytest -k one two\n"


@pytest.mark.parametrize("given", [[], ["--all"], ["--all", "-m", "second_tier"]])
def test_the_whole_suite_runs_in_one_worker_a_core(launcher: Launcher, given: list[str]) -> None:
    words = launcher.run("test", *given).stdout.split(" -m pytest ")[1].split()
    assert words[:2] == ["-n", "auto"]
    assert words[len(words) - len(given) :] == given


def test_no_python_is_one_line(launcher: Launcher) -> None:
    launcher.python.unlink()
    assert only_line(launcher.run()) == "shake: needs Python 3.10 to 3.14 as python3; found none"


def test_an_old_python_is_one_line(launcher: Launcher) -> None:
    assert only_line(launcher.run(OLD="9")) == "shake: needs Python 3.10 to 3.14 as python3; found Python 3.9.1"


def test_no_venv_module_is_one_line(launcher: Launcher) -> None:
    assert "has no venv module" in only_line(launcher.run(NO_VENV="1"))


def test_no_network_is_one_line_and_nothing_counts_as_ready(launcher: Launcher) -> None:
    assert "no network: the Python package index cannot be reached" in only_line(launcher.run(NO_NETWORK="1"))
    assert not (launcher.root / ".venv" / "ready").exists()
    assert launcher.run().returncode == 0


def test_another_kind_of_machine_without_ros_is_one_line(launcher: Launcher) -> None:
    assert "no ROS 2 wheels for Linux aarch64" in only_line(launcher.run(MACHINE="aarch64"))


def test_a_sourced_ros_is_used_instead_of_the_wheels_and_named(launcher: Launcher) -> None:
    ros = {"ROS_DISTRO": "jazzy", "AMENT_PREFIX_PATH": "/opt/ros/jazzy", "HAS_RCLPY": "1", "MACHINE": "aarch64"}
    result = launcher.run("plant", **ros)
    assert result.stdout == "run /: -m shake_ros plant\n"
    assert "using the rclpy of the sourced ROS 2 (jazzy)" in result.stderr
    notes = launcher.notes.read_text()
    assert "--system-site-packages" in notes
    assert "requirements-ros.lock" not in notes
    assert (launcher.root / ".venv-jazzy" / "ready").is_file()


def test_a_sourced_workspace_without_rclpy_gets_the_wheels(launcher: Launcher) -> None:
    assert launcher.run("plant", AMENT_PREFIX_PATH="/somewhere/install").returncode == 0
    assert "requirements-ros.lock" in launcher.notes.read_text()


@pytest.fixture
def installation(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> dict[str, Any]:
    """What setup.py hands to setuptools, from a copy of the files it reads."""
    setuptools = pytest.importorskip("setuptools")
    (tmp_path / "shake_ros").mkdir()
    shutil.copy(ROOT / "shake_ros" / "entry_points.py", tmp_path / "shake_ros")
    shutil.copy(ROOT / "setup.py", tmp_path)
    shutil.copytree(ROOT / "config", tmp_path / "config")
    given: dict[str, Any] = {}
    monkeypatch.setattr(setuptools, "setup", given.update)
    runpy.run_path(str(tmp_path / "setup.py"))
    return {"root": tmp_path, **given}


def test_an_executable_is_installed_for_every_entry_point(installation: dict[str, Any]) -> None:
    paths = dict(installation["data_files"])["lib/shake_ros"]
    assert [Path(path).name for path in paths] == list(ENTRY_POINTS)
    for path in paths:
        executable = installation["root"] / path
        assert os.access(executable, os.X_OK)
        assert f'-m shake_ros {Path(path).name} "$@"' in executable.read_text()


def test_an_installed_executable_runs_its_entry_point_with_the_python_beside_it(
    installation: dict[str, Any], tmp_path: Path
) -> None:
    installed = tmp_path / "prefix" / "lib" / "shake_ros" / "plant"
    installed.parent.mkdir(parents=True)
    shutil.copy(installation["root"] / "build" / "executables" / "plant", installed)
    python = tmp_path / "prefix" / "bin" / "python3"
    python.parent.mkdir()
    python.write_text('#!/bin/sh\necho "$@"\n')
    python.chmod(0o755)
    printed = subprocess.run([installed, "-p", "x y"], capture_output=True, text=True, check=True)
    assert printed.stdout == "-m shake_ros plant -p x y\n"


def test_every_configuration_file_and_the_ament_marker_are_installed(installation: dict[str, Any]) -> None:
    files = dict(installation["data_files"])
    assert files["share/ament_index/resource_index/packages"] == ["resource/shake_ros"]
    assert files["share/shake_ros"] == ["package.xml"]
    installed = {
        path for folder, paths in files.items() if folder.startswith("share/shake_ros/config") for path in paths
    }
    assert installed == {str(path.relative_to(ROOT)) for path in (ROOT / "config").rglob("*") if path.is_file()}


def test_package_xml_agrees_with_the_package() -> None:
    package = ET.parse(ROOT / "package.xml").getroot()
    assert package.attrib["format"] == "3"
    assert package.findtext("name") == "shake_ros"
    assert package.findtext("version") == shake_ros.__version__
    assert package.findtext("export/build_type") == "ament_python"
    maintainer = package.find("maintainer")
    assert maintainer is not None  # an invalid address makes colcon treat the package as plain Python
    assert re.fullmatch(r"[\w.+-]+@[\w-]+(\.[\w-]+)*\.[A-Za-z]{2,}", maintainer.attrib["email"])


def test_package_xml_names_every_dependency_by_a_key_that_rosdep_has() -> None:
    """The keys of rosdep's python.yaml; mcap, zstandard and lz4 have none and come with those that need them."""
    keys = {"pyyaml": "python3-yaml", "rosbags": "python3-rosbags-pip", "mcap": "mcap-ros2-support"}
    brought = {"zstandard", "lz4"}
    setup = ConfigParser()
    setup.read(ROOT / "setup.cfg")
    named = {one.text for one in ET.parse(ROOT / "package.xml").getroot().iter("exec_depend")}
    for dependency in set(setup["options"]["install_requires"].split()) - brought:
        assert keys.get(dependency, f"python3-{dependency}") in named, dependency
    imported = set()
    for path in (ROOT / "shake_ros" / "ros").glob("*.py"):
        text = path.read_text(encoding="utf-8")
        imported |= set(
            re.findall(r"^from (rclpy|\w+_msgs|builtin_interfaces|rcl_interfaces|std_srvs)", text, re.MULTILINE)
        )
    assert len(imported) > 6
    assert imported <= named


def test_the_launch_file_is_installed_and_names_nodes_and_arguments_that_there_are(
    installation: dict[str, Any],
) -> None:
    assert dict(installation["data_files"])["share/shake_ros/launch"] == ["launch/table.launch.py"]
    text = (ROOT / "launch" / "table.launch.py").read_text(encoding="utf-8")
    started = re.findall(r'node\("(\w+)", \{(?:"(\w+)": "(\w+)")?', text)
    assert len(started) == 7
    for executable, parameter, argument in started:
        assert executable in ENTRY_POINTS
        if parameter:
            given = ROOT / "config" / "node" / f"{executable}.yaml"
            assert re.search(rf"^{parameter}:", given.read_text(encoding="utf-8"), re.MULTILINE)
            assert f'"{argument}": (' in text


def test_citation_names_the_version_of_the_package() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert str(citation["version"]) == shake_ros.__version__


def test_the_lock_files_hold_every_direct_dependency() -> None:
    setup = ConfigParser()
    setup.read(ROOT / "setup.cfg")
    extras = setup["options.extras_require"]
    wanted = {
        "requirements.lock": setup["options"]["install_requires"] + extras["test"],
        "requirements-ros.lock": extras["ros"],
        "requirements-lint.lock": extras["lint"],
    }
    for name, dependencies in wanted.items():
        pinned = set(re.findall(r"^([\w.-]+)", (ROOT / name).read_text(), re.MULTILINE))
        for dependency in dependencies.split():
            assert re.sub(r"\[.*\]", "", dependency).lower() in pinned, f"{dependency} is not in {name}: run .ci/lock"


def test_the_entry_points_are_listed_by_the_bare_command() -> None:
    listed = subprocess.run([sys.executable, "-m", "shake_ros"], cwd=ROOT, capture_output=True, text=True, check=True)
    for name in ENTRY_POINTS:
        assert re.search(rf"^  {name}\b", listed.stdout, re.MULTILINE)


def test_the_description_has_the_joint_and_the_frames_of_the_messages() -> None:
    robot = ET.parse(ROOT / "config" / "description" / "shaking_table.urdf").getroot()
    joints = {joint.get("name"): joint for joint in robot.findall("joint")}
    table = joints["table"]
    parent, child, axis, limit = (table.find(name) for name in ("parent", "child", "axis", "limit"))
    assert parent is not None and child is not None and axis is not None and limit is not None
    assert (parent.get("link"), child.get("link")) == ("ground", "table")
    assert (table.get("type"), axis.get("xyz")) == ("prismatic", "1 0 0")
    assert [name for name, joint in joints.items() if joint.get("type") != "fixed"] == ["table"]
    links = {link.get("name") for link in robot.findall("link")}
    assert links == {"ground", "table", "specimen"}
    bergamo = yaml.safe_load((ROOT / "config" / "table" / "bergamo.yaml").read_text())
    assert float(limit.get("upper", "")) == -float(limit.get("lower", "")) == bergamo["body"]["stroke"] / 2
    force = float(bergamo["supply"]["supply_pressure"]) * float(bergamo["body"]["piston_area"])
    assert float(limit.get("effort", "")) == pytest.approx(force, rel=1e-4)


def test_the_changelog_of_bloom_is_made_of_the_released_versions() -> None:
    assert (ROOT / "CHANGELOG.rst").read_text() == changelog.text(), "python -m docs.generators.changelog"
    assert f"\n{shake_ros.__version__} (" in changelog.text()
