"""The target emulator as a process on a port of its own, for the tests and benchmarks of the bridge."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from benchmarks import ROOT
from shake_ros.settings import config_folder


@contextmanager
def emulated_target(folder: Path, *options: str) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """The process, with pipes to and from it, and the path of the bridge's configuration for it in `folder`.

    It is terminated at the end of the block, where its user has not done so.
    """
    command = [sys.executable, "-m", "shake_ros", "target_emulator", "--port", "0", *options]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=ROOT) as process:
        assert process.stdout is not None
        port = process.stdout.readline().strip().rpartition(":")[2]
        path = folder / "bridge.yaml"
        path.write_text((config_folder() / "bridge" / "emulator.yaml").read_text().replace("47800", port))
        try:
            yield process, str(path)
        finally:
            process.terminate()
