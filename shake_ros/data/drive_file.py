"""A drive as the reference that the node `reference_generator` plays: a record of accelerations and its YAML."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import yaml
from numpy.typing import NDArray

from shake_ros.core.reference.baseline import end_at_rest
from shake_ros.data.results import writing
from shake_ros.settings import find, read_yaml

NAME = "drive.yaml"


def write_drive(folder: Path, final: Path, drive: NDArray[np.float64], sample_time: float) -> Path:
    """drive.csv and drive.yaml, which names the file where it will lie, in `final`; the path of drive.yaml there.

    Parameters
    ----------
    drive : (n, 3) position, velocity, acceleration from rest to rest [m], [m/s], [m/s²]; what a recorded one has left
        at its end is taken out by a smooth course. sample_time : [s].
    """
    acceleration = end_at_rest(drive[:, 2], sample_time)
    time = np.arange(len(drive)) * sample_time
    reference = {**read_yaml(find("reference", "drive")), "record": str((final / "drive.csv").resolve())}
    text = "# A drive, played as it is.\n" + yaml.safe_dump(reference, sort_keys=False)
    with writing():
        np.savetxt(folder / "drive.csv", np.column_stack([time, acceleration]), fmt=("%.6f", "%.12e"), delimiter=",")
        (folder / NAME).write_text(text, encoding="utf-8")
    return final / NAME
