"""Arrays → a recording on our topics, without ROS: for imported tables and for simulated data."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from shake_ros.quantities import ShakeError
from shake_ros.recordings.bags.cdr import Floats, Integers, filled, typestore
from shake_ros.recordings.bags.series import SIGNALS
from shake_ros.recordings.bags.writer import BagWriter

NAMESPACE = "/shake"
FIRST_STAMP = 1_000_000_000
BLOCK = 8192
MEASURED = ("joint_states", "imu", "pressure_a", "pressure_b", "pressure_load", "pressure_supply", "force", "truth")
ORDER = (*MEASURED, "reference", "estimate", "valve_command")


def write_table_recording(
    path: Path | str,
    time: npt.ArrayLike,
    valve_command: npt.ArrayLike | None,
    position: npt.ArrayLike | None,
    acceleration: npt.ArrayLike | None = None,
    *,
    pressure_a: npt.ArrayLike | None = None,
    pressure_b: npt.ArrayLike | None = None,
    pressure_load: npt.ArrayLike | None = None,
    pressure_supply: npt.ArrayLike | None = None,
    force: npt.ArrayLike | None = None,
    reference: npt.ArrayLike | None = None,
    estimate: npt.ArrayLike | None = None,
    truth: npt.ArrayLike | None = None,
    namespace: str = NAMESPACE,
    first_stamp: int = FIRST_STAMP,
    compression: str = "",
    overwrite: bool = False,
) -> Path:
    """Write a rosbag2 folder with one message per sample and signal.

    Parameters
    ----------
    path : folder to make.
    time : (n,) rising [s]; its first value is stamped `first_stamp`.
    valve_command : (n,) acting from each sample until the next [-].
    position : (n,) [m]. acceleration : (n,) [m/s²]. One of them may be None.
    pressure_a, pressure_b, pressure_supply : (n,) absolute [Pa]. pressure_load : (n,) of A less that of B [Pa].
    force : (n,) [N].
    reference, estimate, truth : (n, 3) position, velocity, acceleration in SI units.
    first_stamp : header.stamp of the first sample [ns].
    compression : "zstd" or "".

    Raises
    ------
    ShakeError
        where lengths differ, time does not rise, neither position nor acceleration is there, or the folder exists and
        `overwrite` is false.
    """
    given = {
        "valve_command": valve_command,
        "joint_states": position,
        "imu": acceleration,
        "pressure_a": pressure_a,
        "pressure_b": pressure_b,
        "pressure_load": pressure_load,
        "pressure_supply": pressure_supply,
        "force": force,
        "reference": reference,
        "estimate": estimate,
        "truth": truth,
    }
    if position is None and acceleration is None:
        raise ShakeError(f"{path}: neither a position nor an acceleration: nothing shows how the table moves")
    seconds = np.asarray(time, dtype=np.float64)
    signals = _checked(path, seconds, given)
    stamps = np.rint((seconds - seconds[0]) * 1e9).astype(np.int64) + first_stamp
    if (np.diff(stamps) <= 0).any():
        row = int(np.argmax(np.diff(stamps) <= 0)) + 1
        raise ShakeError(f"{path}: time does not rise at row {row} ({seconds[row]:.9g} s)")
    with BagWriter(path, compression, overwrite) as writer:
        numbers = {
            name: writer.add_topic(f"{namespace}/{name}", SIGNALS[name].type) for name in ORDER if name in signals
        }
        for begin in range(0, len(stamps), BLOCK):
            rows = slice(begin, begin + BLOCK)
            block = [(numbers[name], serialised(name, stamps[rows], signals[name][rows])) for name in numbers]
            for i, stamp in enumerate(stamps[rows].tolist()):
                for number, messages in block:
                    writer.write(number, stamp, messages[i])
    return Path(path)


def _checked(path: Path | str, seconds: Floats, given: dict[str, Any]) -> dict[str, Floats]:
    """The signals that are there as (n, width) arrays; raises ShakeError where a shape does not fit."""
    if seconds.ndim != 1 or len(seconds) < 1 or not np.isfinite(seconds).all():
        raise ShakeError(f"{path}: time must be a row of finite numbers")
    signals = {}
    for name, values in given.items():
        if values is None:
            continue
        width = len(SIGNALS[name].paths)
        array = np.asarray(values, dtype=np.float64)
        array = array[:, None] if array.ndim == 1 else array
        if array.shape != (len(seconds), width):
            raise ShakeError(f"{path}: '{name}' has shape {array.shape}, expected ({len(seconds)}, {width})")
        signals[name] = array
    return signals


def serialised(name: str, stamps: Integers, values: Floats) -> list[bytes]:
    """Messages of a signal of `SIGNALS`: one for each stamp [ns], with a row of `values` (n, width) in SI units."""
    signal = SIGNALS[name]
    paths = [path.replace("{joint}", "0") for path in signal.paths]
    return filled(template(name), signal.type, stamps, {path: values[:, i] for i, path in enumerate(paths)})


def template(name: str) -> bytes:
    """One serialised message of a signal, with everything but stamp and numbers as it should be."""
    kinds = typestore().types
    signal = SIGNALS[name]
    stamp = kinds["builtin_interfaces/msg/Time"](sec=0, nanosec=0)
    header = kinds["std_msgs/msg/Header"](stamp=stamp, frame_id=signal.joint or "table")
    none, one = np.zeros(0), np.zeros(1)
    kind = kinds[signal.type]
    if signal.type.endswith("JointState"):
        message = kind(header=header, name=[signal.joint], position=one, velocity=none, effort=none)
    elif signal.type.endswith("JointTrajectory"):
        duration = kinds["builtin_interfaces/msg/Duration"](sec=0, nanosec=0)
        point = kinds["trajectory_msgs/msg/JointTrajectoryPoint"](
            positions=one, velocities=one, accelerations=one, effort=none, time_from_start=duration
        )
        message = kind(header=header, joint_names=[signal.joint], points=[point])
    elif signal.type.endswith("Imu"):
        message = _imu(kinds, header)
    elif signal.type.endswith("FluidPressure"):
        message = kind(header=header, fluid_pressure=0.0, variance=0.0)
    else:
        vector = kinds["geometry_msgs/msg/Vector3"](x=0.0, y=0.0, z=0.0)
        message = kind(header=header, wrench=kinds["geometry_msgs/msg/Wrench"](force=vector, torque=vector))
    return bytes(typestore().serialize_cdr(message, signal.type))


def _imu(kinds: Any, header: Any) -> Any:
    vector = kinds["geometry_msgs/msg/Vector3"](x=0.0, y=0.0, z=0.0)
    unmeasured, unknown = np.array([-1.0] + [0.0] * 8), np.zeros(9)
    return kinds["sensor_msgs/msg/Imu"](
        header=header,
        orientation=kinds["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0),
        orientation_covariance=unmeasured,
        angular_velocity=vector,
        angular_velocity_covariance=unmeasured,
        linear_acceleration=vector,
        linear_acceleration_covariance=unknown,
    )
