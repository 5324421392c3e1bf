"""References as files: config/reference/*.yaml and the record it names, and a drive written as such a pair."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import yaml
from numpy.typing import NDArray

from shake_ros.core.quantities import Parameters, ShakeError, member_from
from shake_ros.core.reference import REFERENCES
from shake_ros.core.reference.baseline import end_at_rest
from shake_ros.core.reference.drive import DriveParameters
from shake_ros.core.reference.earthquake import EarthquakeParameters
from shake_ros.core.reference.motion import EarthquakeRecord
from shake_ros.core.reference.program import Program
from shake_ros.core.reference.shaping import Shaping
from shake_ros.data.accelerograms import read_accelerogram
from shake_ros.data.result_folder import writing
from shake_ros.settings import find, read_yaml


class Reference(NamedTuple):
    """A reference as configured: its kind, its parameters and the shaping."""

    kind: str
    parameters: Parameters
    shaping: Shaping


def load_reference(name: str) -> Reference:
    """Read config/reference/<name>.yaml, or a path that ends in .yaml.

    Raises ShakeError, naming the file, for an unknown name, an unknown or missing key, or a value out of bounds.
    """
    path = find("reference", name)
    content = read_yaml(path)
    shaping = content.pop("shaping", None) if isinstance(content, dict) and "kind" in content else {}
    if shaping is None:
        raise ShakeError(f"{path}: missing key 'shaping'")
    kind, parameters = member_from(content, REFERENCES, str(path), kind="reference")
    return Reference(kind, parameters, Shaping.from_mapping(shaping, f"{path}: shaping"))


def read_record(parameters: Parameters) -> EarthquakeRecord | None:
    """The accelerogram that the parameters name; None where they name none."""
    if not isinstance(parameters, EarthquakeParameters | DriveParameters) or not parameters.record:
        return None
    found = read_accelerogram(Path(parameters.record).expanduser(), channel=parameters.channel, unit=parameters.unit)
    return EarthquakeRecord(found.time, found.acceleration)


def make_program(reference: Reference, sample_time: float) -> Program:
    """The program of a configured reference; reads the record it names, relative to the working directory."""
    record = read_record(reference.parameters)
    return Program(reference.kind, reference.parameters, reference.shaping, sample_time, record)


def build_program(name_or_path: str, sample_time: float) -> Program:
    """The program of config/reference/<name>.yaml or of a YAML file, `sample_time` in [s]."""
    return make_program(load_reference(name_or_path), sample_time)


NAME = "drive.yaml"


def write_drive(folder: Path, final: Path, drive: NDArray[np.float64], sample_time: float) -> Path:
    """drive.csv and drive.yaml, which names the file where it will lie, in `final`; the path of drive.yaml there.

    Parameters
    ----------
    drive : (n, 3) position, velocity, acceleration from rest to rest [m], [m/s], [m/s²]; what a recorded one has left
        at its end is taken out by a smooth course.
    sample_time : [s].
    """
    acceleration = end_at_rest(drive[:, 2], sample_time)
    time = np.arange(len(drive)) * sample_time
    reference = {**read_yaml(find("reference", "drive")), "record": str((final / "drive.csv").resolve())}
    text = "# A drive, played as it is.\n" + yaml.safe_dump(reference, sort_keys=False)
    with writing():
        np.savetxt(folder / "drive.csv", np.column_stack([time, acceleration]), fmt=("%.6f", "%.12e"), delimiter=",")
        (folder / NAME).write_text(text, encoding="utf-8")
    return final / NAME
