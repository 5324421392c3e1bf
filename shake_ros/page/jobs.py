"""Work that takes minutes, one at a time, in a process of its own: the very command line that the page shows."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from shake_ros.core.quantities import ShakeError

NICENESS = 15  # the graph goes first
ROOT = Path(__file__).resolve().parents[2]


@dataclass
class Job:
    """One command. state : running, done, failed, cancelled."""

    number: int
    arguments: tuple[str, ...]
    out: Path
    started: float = field(default_factory=time.time)
    ended: float = 0.0
    state: str = "running"
    doing: str = "starting"
    part: float = 0.0
    lines: list[str] = field(default_factory=list)

    @property
    def command(self) -> str:
        """As one would type it."""
        return shlex.join(["./shake", *self.arguments])

    def left(self) -> float | None:
        """Time left [s], once it can be estimated."""
        elapsed = time.time() - self.started
        if self.state != "running" or self.part < 0.03 or elapsed < 3.0:
            return None
        return elapsed * (1.0 - self.part) / self.part

    def status(self) -> dict[str, Any]:
        """For the page."""
        return {
            "number": self.number, "command": self.command, "state": self.state, "doing": self.doing,
            "part": self.part, "left": self.left(), "seconds": (self.ended or time.time()) - self.started,
            "out": self.out.name, "lines": self.lines[-60:], "kind": self.arguments[0],
            "report": (self.out / "report.html").is_file(), "table": (self.out / "table.yaml").is_file(),
            "table_path": str(self.out / "table.yaml"),
        }  # fmt: skip


class Jobs:
    """The jobs of this start; results in `folder`."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.all: list[Job] = []
        self._process: subprocess.Popen[str] | None = None

    def start(self, kind: str, arguments: Sequence[str], name: str) -> Job:
        """Run `./shake KIND ARGUMENTS --out …`; ShakeError where one runs."""
        if self.all and self.all[-1].state == "running":
            raise ShakeError(f"{self.all[-1].arguments[0]} is running; cancel it first")
        self.folder.mkdir(parents=True, exist_ok=True)
        out = self.folder / name
        number = 2
        while out.exists():
            out, number = self.folder / f"{name}_{number}", number + 1
        job = Job(len(self.all) + 1, (kind, *arguments, "--out", str(out)), out)
        environment = {**os.environ, "SHAKE_ROS_PROGRESS": "parts"}
        environment["PYTHONPATH"] = os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH", ""))))
        self._process = subprocess.Popen(
            ["nice", "-n", str(NICENESS), sys.executable, "-m", "shake_ros", *job.arguments],
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace",
            env=environment,
        )  # fmt: skip
        self.all.append(job)
        threading.Thread(target=self._follow, args=(job, self._process), daemon=True).start()
        return job

    def _follow(self, job: Job, process: subprocess.Popen[str]) -> None:
        assert process.stdout is not None
        for line in process.stdout:
            part, found, text = line.strip().partition("\t")
            if found:
                job.part, job.doing = max(job.part, float(part)), text.partition(": ")[2] or text
            elif line.strip():
                job.lines.append(line.strip())
        code = process.wait()
        job.ended = time.time()
        if job.state == "running":
            job.state = "done" if code == 0 else "failed"
            job.part = 1.0 if code == 0 else job.part
            job.doing = "done" if code == 0 else (job.lines[-1] if job.lines else f"exit code {code}")

    def cancel(self) -> str:
        """End the running job; returns what was ended."""
        if not self.all or self.all[-1].state != "running" or self._process is None:
            raise ShakeError("nothing is running")
        job = self.all[-1]
        job.state, job.doing = "cancelled", "cancelled"
        self._process.terminate()
        return f"{job.arguments[0]} cancelled"

    def find(self, out: str) -> Job:
        """The job by the name of its result folder."""
        for job in self.all:
            if job.out.name == out:
                return job
        raise ShakeError(f"no result {out!r} of this start")

    def close(self) -> None:
        """Nothing outlives the page."""
        if self._process is not None and self._process.poll() is None:
            self._process.terminate()
            try:
                self._process.wait(5.0)
            except subprocess.TimeoutExpired:
                self._process.kill()
