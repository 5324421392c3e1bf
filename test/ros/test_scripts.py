"""The scripts that a person runs, run by the suite."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from machine_time import on_a_machine_that_keeps_time

from benchmarks.realtime.up_and_down import again_and_again

ROOT = Path(__file__).resolve().parents[2]
SCRIPTS = ROOT / "test" / "scripts"
TIMEOUT = 600.0


def run(script: str, *arguments: str) -> str:
    """Run a script as a person does; returns what it printed, fails with it where the exit status is not 0."""
    done = subprocess.run(
        [sys.executable, str(SCRIPTS / script), *arguments],
        capture_output=True,
        text=True,
        cwd=ROOT,
        timeout=TIMEOUT,
        check=False,
    )
    assert done.returncode == 0, f"{script} ended with {done.returncode}\n{done.stdout}\n{done.stderr}"
    return done.stdout


def test_closed_loop_in_lockstep_is_the_same_every_time(ros_domain) -> None:
    assert "the same in every run" in run("same_every_time.py", "--seconds", "0.8")


def test_every_controller_in_lockstep_has_the_numbers_of_the_compiled_loop(ros_domain) -> None:
    assert "every controller is the same" in run("every_controller.py", "--seconds", "0.15")


@pytest.mark.parametrize(
    "scheduling",
    [
        pytest.param((), id="usual scheduling"),
        pytest.param(("--fifo",), id="SCHED_FIFO", marks=pytest.mark.second_tier),
    ],
)
@on_a_machine_that_keeps_time
def test_closed_loop_in_real_time_keeps_its_books(ros_domain, scheduling) -> None:
    assert "missed deadlines counted" in run("real_time.py", "--seconds", "2.0", *scheduling)


@pytest.mark.second_tier
@on_a_machine_that_keeps_time
def test_table_answers_bad_commands(ros_domain) -> None:
    assert "every answer as it should be" in run("bad_commands.py")


@pytest.mark.second_tier
def test_real_ros2_program_does_what_a_user_does_with_it(ros_domain) -> None:
    if shutil.which("ros2") is None:
        pytest.skip("NOT TESTED: there is no `ros2` program here; source a ROS 2 installation")
    assert "the real programs did all of it" in run("ros2_program.py")


@pytest.mark.second_tier
@on_a_machine_that_keeps_time
def test_graph_comes_up_and_goes_down_again_and_again(ros_domain) -> None:
    """benchmarks.realtime.up_and_down does it 50 times; the fixture sees to it that no process is left."""
    said = again_and_again(3, ros_domain)
    assert len(said) == 3
