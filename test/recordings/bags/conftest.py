"""A small table's arrays, and recordings made of them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shake_ros.recordings.bags import write_table_recording


def table_arrays(count: int = 3000, sample_time: float = 0.001) -> dict[str, np.ndarray]:
    """A sine of 2 Hz and 50 mm with its acceleration and a command that leads it by a quarter period."""
    time = np.arange(count) * sample_time
    angle = 4 * np.pi * time
    return {
        "time": time,
        "valve_command": 0.5 * np.cos(angle),
        "position": 0.05 * np.sin(angle),
        "acceleration": -0.05 * (4 * np.pi) ** 2 * np.sin(angle),
    }


@pytest.fixture
def arrays() -> dict[str, np.ndarray]:
    return table_arrays()


@pytest.fixture
def make(tmp_path: Path) -> Callable[..., Path]:
    """Write a recording `name` of the standard arrays, of which some may be replaced."""

    def write(name: str = "run", **changes: Any) -> Path:
        return write_table_recording(tmp_path / name, **(table_arrays() | changes))

    return write
