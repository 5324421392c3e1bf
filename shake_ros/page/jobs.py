"""Work that takes minutes, one at a time, in a process of its own: the very command line that the page shows."""

from __future__ import annotations

import json
import os
import shlex
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from shake_ros.quantities import ShakeError

NICENESS = 15  # the graph goes first
RELEASE = "release"  # begins a line in which a command asks whether the table may move
RECORDED = "recorded: "  # begins a line that names a recording that a command has made
ROOT = Path(__file__).resolve().parents[2]


@dataclass
class Job:
    """One command."""

    number: int
    arguments: tuple[str, ...]
    out: Path
    of: Mapping[str, Any]  # the page's request
    started: float = field(default_factory=time.time)
    ended: float = 0.0
    state: str = "running"  # or done, failed, cancelled
    work: str = ""  # what of it runs now
    doing: str = "starting"
    part: float = 0.0  # of that which is done
    begun: float = field(default_factory=time.time)  # when that began
    asks: str = ""  # what it wants released, empty for nothing
    open: bool = False  # whether models are left open
    lines: list[str] = field(default_factory=list)

    @property
    def command(self) -> str:
        """As one would type it."""
        return shlex.join(["./shake", *self.arguments])

    def left(self) -> float | None:
        """Time left [s], once it can be estimated."""
        elapsed = time.time() - self.begun
        if self.state != "running" or self.part < 0.03 or elapsed < 3.0:
            return None
        return elapsed * (1.0 - self.part) / self.part

    def progress(self, part: float, text: str) -> None:
        """Take a line of its progress; the bar begins again with each piece of work."""
        work, _, doing = text.partition(": ")
        if work != self.work:
            self.work, self.part, self.begun = work, 0.0, time.time()
        self.part, self.doing = max(self.part, part), doing

    @property
    def answer(self) -> Path:
        """Folder of the newest answer: that of the last further recording, where there is one."""
        decided = self.out / "decided"
        return decided if (decided / "table.yaml").is_file() else self.out

    def status(self) -> dict[str, Any]:
        """For the page."""
        answer = self.answer
        design = answer / "next" / "report.html"
        return {
            "number": self.number, "command": self.command, "state": self.state, "doing": self.doing,
            "work": self.work, "of": dict(self.of), "open": self.open, "part": self.part,
            "left": self.left(), "seconds": (self.ended or time.time()) - self.started,
            "lines": self.lines[-60:], "asks": self.asks,
            "report": self._shown(answer / "report.html"), "next": self._shown(design),
            "table": (answer / "table.yaml").is_file(), "table_path": str(answer / "table.yaml"),
        }  # fmt: skip

    def _shown(self, page: Path) -> str:
        """A page of its result as the server has it, empty where there is none."""
        return str(page.relative_to(self.out.parent)) if page.is_file() else ""


def _leaves_open(report: Path) -> bool:
    """Whether a search says that models are left open."""
    return report.is_file() and bool(json.loads(report.read_text(encoding="utf-8")).get("open"))


class Jobs:
    """The jobs of this start; results in `folder`. recorded : called with each recording that one of them makes."""

    def __init__(self, folder: Path, recorded: Callable[[Path], None] = lambda _: None) -> None:
        self.folder, self._recorded = folder, recorded
        self.all: list[Job] = []
        self._process: subprocess.Popen[str] | None = None

    def start(self, kind: str, arguments: Sequence[str], name: str, of: Mapping[str, Any]) -> Job:
        """Run `./shake KIND ARGUMENTS --out …` for a request; ShakeError where one runs."""
        if self.all and self.all[-1].state == "running":
            raise ShakeError(f"{self.all[-1].arguments[0]} is running; cancel it first")
        self.folder.mkdir(parents=True, exist_ok=True)
        out = self.folder / name
        number = 2
        while out.exists():
            out, number = self.folder / f"{name}_{number}", number + 1
        job = Job(len(self.all) + 1, (kind, *arguments, "--out", str(out)), out, of)
        environment = {**os.environ, "SHAKE_ROS_PROGRESS": "parts"}
        environment["PYTHONPATH"] = os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH", ""))))
        self._process = subprocess.Popen(
            ["nice", "-n", str(NICENESS), sys.executable, "-m", "shake_ros", *job.arguments],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace",
            env=environment,
        )  # fmt: skip
        self.all.append(job)
        threading.Thread(target=self._follow, args=(job, self._process), daemon=True).start()
        return job

    def _follow(self, job: Job, process: subprocess.Popen[str]) -> None:
        assert process.stdout is not None
        for line in process.stdout:
            part, found, text = line.strip().partition("\t")
            if part == RELEASE:
                job.asks = json.loads(text)
            elif found:
                job.progress(float(part), text)
            elif line.strip():
                job.lines.append(line.strip())
                if line.startswith(RECORDED):
                    self._recorded(Path(line.strip().removeprefix(RECORDED)))
        code = process.wait()
        job.ended, job.asks, job.open = time.time(), "", _leaves_open(job.answer / "report.json")
        if job.state == "running":
            job.state = "done" if code == 0 else "failed"
            job.part = 1.0 if code == 0 else job.part
            job.doing = "done" if code == 0 else (job.lines[-1] if job.lines else f"exit code {code}")

    def release(self, name: str) -> str:
        """Tell the running job who lets the table move as it asks, empty for nobody; returns what was answered."""
        job = self.all[-1] if self.all else None
        if job is None or not job.asks or self._process is None or self._process.stdin is None:
            raise ShakeError("nothing asks to be released")
        job.asks = ""
        try:
            self._process.stdin.write(f"{name}\n")
            self._process.stdin.flush()
        except OSError:
            raise ShakeError(f"{job.arguments[0]} has ended") from None
        return f"released by {name}" if name else "not released"

    def cancel(self) -> str:
        """End the running job; returns what was ended."""
        if not self.all or self.all[-1].state != "running" or self._process is None:
            raise ShakeError("nothing is running")
        job = self.all[-1]
        job.state, job.doing = "cancelled", "cancelled"
        self._process.terminate()
        return f"{job.arguments[0]} cancelled"

    def close(self) -> None:
        """Nothing outlives the page."""
        if self._process is not None and self._process.poll() is None:
            self._process.terminate()
            try:
                self._process.wait(5.0)
            except subprocess.TimeoutExpired:
                self._process.kill()
