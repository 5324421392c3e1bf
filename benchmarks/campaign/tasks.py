"""Short tasks for tests and figures of the engines: cheap, or such that end their worker."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path
from typing import Any

import numpy as np


def sums(seed: int, size: int = 1000) -> dict[str, Any]:
    """A product of matrices and its sum, which differ in the last bits where sums are made in another order."""
    rng = np.random.default_rng(seed)
    a = rng.standard_normal((40, size))
    return {"trace": float(np.trace(a @ a.T)), "sum": float(np.sum(a)), "even": seed % 2 == 0}


def nothing(seed: int) -> dict[str, Any]:
    """As good as no work."""
    return {"seed": seed}


def busy(seed: int, seconds: float) -> dict[str, Any]:
    """Work for so many seconds of processor."""
    end = time.process_time() + seconds
    while time.process_time() < end:
        pass
    return {"seed": seed}


def deadly(seed: int, bad: int, folder: str, times: int) -> dict[str, Any]:
    """As `sums`; but the seed `bad` ends its worker the first `times` times, which a folder counts."""
    if seed == bad:
        deaths = len(list(Path(folder).iterdir()))
        if deaths < times:
            (Path(folder) / str(deaths)).touch()
            os.kill(os.getpid(), signal.SIGKILL)
    return sums(seed)


def failing(seed: int) -> dict[str, Any]:
    """Odd seeds cannot be done."""
    if seed % 2:
        raise ValueError(f"seed {seed} is odd")
    return {"seed": seed}


def labelled(seed: int, file: str) -> dict[str, Any]:
    """What a file holds."""
    return {"seed": seed, "text": Path(file).read_text(encoding="utf-8")}


def counted(seed: int, folder: str) -> dict[str, Any]:
    """Leaves a byte in a file of its own each time, and takes a moment."""
    with (Path(folder) / str(seed)).open("ab") as file:
        file.write(b"x")
    return busy(seed, 0.01)


def held(seed: int, first: int, folder: str) -> dict[str, Any]:
    """Some work; from the seed `first` on it waits until the folder holds a file `go`."""
    while seed >= first and not (Path(folder) / "go").exists():
        time.sleep(0.01)
    return busy(seed, 0.02)
