"""`lab`: one command starts all, a second one is refused, Ctrl-C ends in order; what its arguments become."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from shake_ros.core.quantities import ShakeError
from shake_ros.data.recordings import read_table_recording
from shake_ros.ros import lab

ROOT = Path(__file__).resolve().parents[2]
LAB = [sys.executable, "-m", "shake_ros", "lab"]


class Started:
    """A lab whose lines are read."""

    def __init__(self, *arguments: str) -> None:
        self.process = subprocess.Popen(
            [*LAB, *arguments], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL, text=True,
            cwd=ROOT,
        )  # fmt: skip
        self.lines: list[str] = []
        self._changed = threading.Condition()
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            with self._changed:
                self.lines.append(line.strip())
                self._changed.notify_all()

    def wait_for(self, text: str, timeout: float = 120.0) -> str:
        with self._changed:
            assert self._changed.wait_for(lambda: any(text in line for line in self.lines), timeout), self.lines
            return next(line for line in self.lines if text in line)

    def end(self) -> int:
        self.process.send_signal(signal.SIGINT)
        return self.process.wait(60)


def test_one_command_runs_the_table_refuses_a_second_and_ends_in_order(ros_domain, tmp_path) -> None:
    started = Started("--headless", "--lockstep", "--enabled", "--play", "--record", "run", "--folder", str(tmp_path))
    started.wait_for("running: recorder, plant")
    second = subprocess.run(
        [*LAB, "--headless", "--folder", str(tmp_path)], capture_output=True, text=True, cwd=ROOT, check=False
    )
    assert second.returncode == 2
    assert "topic /shake/joint_states is published already" in second.stderr
    assert started.end() == 0, started.lines
    assert started.lines[-3:] == [
        "lab: ending: hold, pressure off",
        f"lab: recording closed: {tmp_path}/recordings/run",
        "lab: ended",
    ]
    recording = read_table_recording(tmp_path / "recordings" / "run")
    assert recording.provenance.complete
    assert recording.pressure_supply is not None
    assert recording.pressure_supply.max() > 150e5
    assert recording.pressure_supply[-1] < 50e5


def test_node_that_dies_is_named_with_its_reason_and_the_rest_ends(ros_domain, tmp_path) -> None:
    started = Started("--headless", "--lockstep", "--set", "controller.limit=7.0", "--folder", str(tmp_path))
    line = started.wait_for("controller died")
    assert "limit = 7 is outside 0 … 1" in line or "limit = 7.0 is outside 0 … 1" in line
    assert started.end() == 1
    assert started.lines[-1] == "lab: ended, not without losses"


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["--set", "plant"], "expected NODE.PARAMETER=VALUE"),
        (["--set", "plan.seed=1"], "no such node here; there are plant"),
        (["--bridge", "emulator", "--lockstep"], "a real table keeps real time"),
        (["--address", "0.0.0.0"], "only with --certificate and --key"),
    ],
)
def test_arguments_that_cannot_work_are_refused_before_anything_starts(tmp_path, arguments, text) -> None:
    with pytest.raises(ShakeError, match=text):
        lab.main([*arguments, "--folder", str(tmp_path)])


def test_composed_loop_is_one_process_beside_page_and_recorder(tmp_path) -> None:
    given = lab.parser().parse_args(["--composed", "--record", "a", "--folder", str(tmp_path)])
    started = lab.nodes(given, tmp_path / "lab")
    assert [one.called for one in started] == ["page", "recorder", "loop"]
    assert "joint_states:2" in started[-1].program[-1]
