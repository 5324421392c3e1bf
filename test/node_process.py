"""A node as a process of its own."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
TIMEOUT = 180.0  # a first start compiles


class NodeProcess:
    """A node as a process, and what it has said."""

    def __init__(self, domain: int, folder: Path, name: str, *arguments: str, **environment: str) -> None:
        self.log = folder / f"{name}.log"
        settings = {"ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "PYTHONPATH": str(ROOT)}
        with self.log.open("wb") as log:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "shake_ros", name, "--ros-args", *arguments],
                env={**os.environ, **settings, **environment},
                stdout=log,
                stderr=log,
            )

    def said(self) -> str:
        return self.log.read_text(errors="replace")

    def wait_for(self, text: str) -> None:
        deadline = time.monotonic() + TIMEOUT
        while text not in self.said():
            assert time.monotonic() < deadline and self.process.poll() is None, self.said()
            time.sleep(0.02)

    def end(self, *pauses: float, timeout: float = 20.0) -> int:
        """SIGINT, and another one after each pause [s]; the exit code."""
        for pause in (0.0, *pauses):
            time.sleep(pause)
            self.process.send_signal(signal.SIGINT)
        return self.process.wait(timeout)
