"""The one table of entry points, and what it answers to wrong input."""

from __future__ import annotations

import importlib
import subprocess
import sys

import pytest

from shake_ros import __main__ as entry
from shake_ros.entry_points import ENTRY_POINTS, NODES
from shake_ros.quantities import ShakeError


def test_without_a_name_every_entry_is_listed_with_a_line(capsys) -> None:
    assert entry.main([]) == 0
    printed = capsys.readouterr().out
    for name, one in ENTRY_POINTS.items():
        assert f"  {name}" in printed and one.line in printed


@pytest.mark.parametrize("name", list(ENTRY_POINTS))
def test_every_entry_leads_to_something(name) -> None:
    module = importlib.import_module(ENTRY_POINTS[name].module)
    assert callable(getattr(module, "build" if name in NODES else ENTRY_POINTS[name].function))


def test_listing_imports_neither_ros_nor_compiled_code() -> None:
    code = (
        "import sys, shake_ros.__main__ as m; m.main([]); print(sorted({'rclpy', 'numba', 'scipy'} & set(sys.modules)))"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.splitlines()[-1] == "[]"


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["plnt"], "unknown name 'plnt' (did you mean 'plant'?)"),
        (["plant", "--ros-args", "-p", "foo:=1"], "unknown parameter 'foo'"),
        (["plant", "--ros-args", "-p", "supply.supply_pressure:=1.0"], "supply.supply_pressure = 1.0 is outside"),
        (["plant", "--ros-args", "-p", "table:=nope"], "unknown table 'nope'; known: bergamo"),
        (["plant", "--ros-args", "-p", "table:=/no/such.yaml"], "/no/such.yaml: cannot be read"),
        (["controller", "--ros-args", "-p", "limit:=2.0"], "limit = 2.0 is outside 0 … 1"),
        (["observer", "--ros-args", "-p", "rate:=fast"], "rate = 'fast' is not of type float"),
        (["observer", "--ros-args", "-p", "wait_for:=estimat:1"], "unknown topic 'estimat' (did you mean 'estimate'?)"),
        (["reference_generator", "--ros-args", "-p", "reference:=quake"], "unknown reference 'quake'"),
        (["plant", "--ros-args", "-p"], "ROS arguments --ros-args -p"),
        (["plant", "twice"], "'twice' is no ROS argument"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_wrong_input_is_one_line_and_exit_code_2(ros_domain, capfd, arguments, reason) -> None:
    assert entry.main(arguments) == 2
    lines = [line for line in capfd.readouterr().err.splitlines() if "compiling" not in line]
    assert len(lines) == 1
    assert reason in lines[0]


@pytest.mark.parametrize(
    ("name", "raised", "code"),
    [
        ("plant", ShakeError("file: reason"), 2),
        ("identify", KeyboardInterrupt(), 130),
        ("plant", KeyboardInterrupt(), 0),  # a node that is told to end while it starts, by a launcher say
    ],
)
def test_exit_codes_and_silence_on_interrupt(monkeypatch, capsys, name, raised, code) -> None:
    def call(*_: object) -> int:
        raise raised

    monkeypatch.setattr(entry, "call", call)
    assert entry.main([name]) == code
    assert capsys.readouterr().err == ("shake_ros plant: file: reason\n" if code == 2 else "")


def test_node_told_to_end_while_it_starts_ends_without_an_error() -> None:
    """An interruption within an import, which Python 3.11 turns into a RuntimeError where a class is being made."""
    program = """
import os, signal, sys
import shake_ros.__main__ as entry

class Interrupted:
    def __set_name__(self, *_):
        os.kill(os.getpid(), signal.SIGINT)
        for _ in range(1000): pass

entry.importlib.import_module = lambda _: type("Module", (), {"made": Interrupted()})
sys.argv = ["shake_ros", "plant"]
sys.exit(entry.program())
"""
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert (run.returncode, run.stderr) == (0, "")


def test_an_error_of_the_program_itself_is_not_hidden(monkeypatch) -> None:
    def call(*_: object) -> int:
        raise ZeroDivisionError

    monkeypatch.setattr(entry, "call", call)
    with pytest.raises(ZeroDivisionError):
        entry.main(["plant"])


@pytest.mark.parametrize(
    ("name", "package", "how"),
    [
        (
            "plant",
            "rclpy",
            "source a ROS 2 installation that has it, or install the wheels: pip install 'shake_ros[ros]'",
        ),
        ("observer", "sensor_msgs", "source a ROS 2 installation"),
        ("recorder", "mcap", "pip install mcap (rosdep: python3-rosbags-pip, mcap-ros2-support)"),
        ("controller", "numba", "pip install numba"),
    ],
)
def test_node_without_a_package_says_what_to_install(name, package, how) -> None:
    program = (
        f"import sys; sys.modules[{package!r}] = None; from shake_ros.__main__ import main; sys.exit(main([{name!r}]))"
    )
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert run.returncode == 2
    assert run.stderr.startswith(
        f"shake_ros {name}: {name} needs the Python package '{package}', which is not installed"
    )
    assert how in run.stderr and len(run.stderr.splitlines()) == 1
