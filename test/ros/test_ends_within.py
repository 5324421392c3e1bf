"""The end of a process that the middleware does not give back."""

from __future__ import annotations

import subprocess
import sys

import pytest

STUCK = """
import ctypes, sys
from shake_ros.ros.loop import ends_within
with ends_within(float(sys.argv[1]), int(sys.argv[2])):
    ctypes.PyDLL(None).usleep(int(1e6 * float(sys.argv[3])))  # holds the interpreter's lock
print("went on")
"""


def stuck(*arguments: str) -> tuple[int, str]:
    done = subprocess.run([sys.executable, "-c", STUCK, *arguments], capture_output=True, text=True, check=False)
    return done.returncode, done.stdout + done.stderr


@pytest.mark.parametrize("code", [0, 1])
def test_process_ends_though_no_python_code_runs_any_more(code: int) -> None:
    assert stuck("0.05", str(code), "30") == (code, "")


def test_process_that_is_in_time_goes_on() -> None:
    assert stuck("0.2", "1", "0.01") == (0, "went on\n")
