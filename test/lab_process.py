"""A `lab` in a process of its own, whose lines are read."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LAB = [sys.executable, "-m", "shake_ros", "lab"]
QUICK = (  # in lock-step: low and high pressure are short, and a loop that is waited for takes no whole processor
    *("--set", "plant.interlock.low_pressure_time=1.0", "plant.interlock.high_pressure_time=0.2"),
    *("plant.interlock.span_time=0.2", "--pace", "1"),
)


class Started:
    """A running lab; in a `with` block nothing of it outlives the block."""

    def __init__(self, *arguments: str, **environment: str) -> None:
        self.process = subprocess.Popen(
            [*LAB, *arguments], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL, text=True,
            cwd=ROOT, env={**os.environ, **environment},
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
        """The first line that has `text` in it."""
        with self._changed:
            assert self._changed.wait_for(lambda: any(text in line for line in self.lines), timeout), self.lines
            return next(line for line in self.lines if text in line)

    def end(self) -> int:
        """Ctrl-C; returns the exit code."""
        self.process.send_signal(signal.SIGINT)
        try:
            return self.process.wait(60)
        except subprocess.TimeoutExpired:
            self.process.kill()
            raise AssertionError(f"not ended 60 s after Ctrl-C: {self.lines}") from None

    def __enter__(self) -> Started:
        return self

    def __exit__(self, *_: object) -> None:
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
            try:
                self.process.wait(40)
            except subprocess.TimeoutExpired:
                self.process.kill()


def children(parent: int) -> dict[str, int]:
    """Name of the node → process id, of the nodes that a lab has started."""
    found = {}
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            status = (folder / "stat").read_text().rpartition(")")[2].split()
            words = (folder / "cmdline").read_bytes().decode().split("\0")
        except OSError:
            continue
        if int(status[1]) == parent and "-m" in words:
            module, name, *_ = words[words.index("-m") + 1 :]
            found[name if module == "shake_ros" else module.rpartition(".")[2]] = int(folder.name)
    return found
