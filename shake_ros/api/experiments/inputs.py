"""The thesis's inputs, and free runs of a table under them as recordings without noise."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from shake_ros.core.identification.recordings import Record
from shake_ros.core.plant.parameters import TableParameters
from shake_ros.core.plant.simulation import run
from shake_ros.settings import find, read_yaml


def inputs() -> dict[str, dict[str, float]]:
    """u1, u2, … of config/reproduce/inputs.yaml."""
    content: dict[str, dict[str, float]] = read_yaml(find("reproduce", "inputs"))
    return content


def sine(wave: Mapping[str, Any], seconds: float, sample_time: float) -> np.ndarray:
    """amplitude · sin(2π frequency t), shape (n,) [-].

    >>> sine({"amplitude": 0.5, "frequency": 1.0}, 1.0, 0.25).round(6).tolist()
    [0.0, 0.5, 0.0, -0.5]
    """
    time = np.arange(round(seconds / sample_time)) * sample_time
    return np.asarray(wave["amplitude"] * np.sin(2.0 * np.pi * wave["frequency"] * time))


def recorded(name: str, table: TableParameters, commands: np.ndarray, sample_time: float) -> Record:
    """Position and acceleration of a table's free run from mid-stroke, without noise."""
    out = run(table, commands, sample_time)
    return Record(name, sample_time, commands, out[:, 0], out[:, 2])


def words(wave: Mapping[str, Any]) -> str:
    """An input in the thesis's notation.

    >>> words({"amplitude": 0.5, "frequency": 3.0})
    '0.5 sin(2π·3t)'
    """
    return f"{wave['amplitude']:g} sin(2π·{wave['frequency']:g}t)"
