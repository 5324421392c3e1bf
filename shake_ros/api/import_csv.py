"""`import_csv`: a laboratory's table of columns becomes a recording on our topics."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from shake_ros.core.quantities import ShakeError
from shake_ros.data.columns import Column, read_columns
from shake_ros.data.mat_file import read_mat_columns
from shake_ros.data.recordings import TableRecording, read_table_recording, write_table_recording

SIGNALS = {
    "command": "valve command, −1 … 1",
    "position": "position [m]",
    "acceleration": "acceleration [m/s²]",
    "force": "external force on the table [N]",
}


def import_csv(
    file: str | Path,
    out: str | Path,
    *,
    command: str,
    position: str,
    time: str | None = None,
    rate: float | None = None,
    acceleration: str | None = None,
    force: str | None = None,
    skip: int | None = None,
    overwrite: bool = False,
) -> TableRecording:
    """Write the columns of a text table, or the variables of a .mat file, as a rosbag2 recording.

    Parameters
    ----------
    file : text table, or .mat file of version 7 and older.
    out : folder of the recording.
    command, position, acceleration, force : a column's name or its number from 1, with a factor to SI units where it
        needs one (`"CHANNEL0*0.01"`): valve command [-], position [m], acceleration [m/s²], force on the table [N].
    time : column of the time [s]. rate : sampling rate, where no column holds the time [Hz].
    skip : lines above the table, where they are not found right.
    overwrite : replace an existing recording.

    Returns
    -------
    TableRecording
        As read back from the folder; its `findings` say what was not as it should be.

    Raises
    ------
    ShakeError
        One line with file, line and column.

    Examples
    --------
    >>> import tempfile
    >>> import shake_ros as sr
    >>> folder = Path(tempfile.mkdtemp())
    >>> lines = [f"{k / 100:.2f};{0.1 * k:.1f};{k}" for k in range(5)]
    >>> _ = (folder / "run.csv").write_text("\\n".join(["t;u;x_mm", *lines]))
    >>> recording = sr.import_csv(folder / "run.csv", folder / "bag", time="t", command="u", position="x_mm*1e-3")
    >>> len(recording), recording.sample_time, recording.position[-1].item()
    (5, 0.01, 0.004)
    """
    path = Path(file)
    given = {"time": time, "command": command, "position": position, "acceleration": acceleration, "force": force}
    columns = {name: Column.parse(text) for name, text in given.items() if text is not None}
    if (time is None) == (rate is None):
        raise ShakeError(f"{path}: give either the column of the time or the sampling rate")
    if skip is not None and skip < 0:
        raise ShakeError(f"--skip {skip}: a number of lines is needed")
    is_mat = path.suffix.lower() == ".mat"
    values = read_mat_columns(path, columns) if is_mat else read_columns(path, columns, skip)
    values["time"] = values["time"] if rate is None else _steps(len(values["position"]), rate)
    _check_time(path, values["time"])
    write_table_recording(
        out,
        values["time"],
        values["command"],
        values["position"],
        values.get("acceleration"),
        force=values.get("force"),
        overwrite=overwrite,
    )
    return read_table_recording(out)


def _steps(count: int, rate: float) -> npt.NDArray[np.float64]:
    if not (np.isfinite(rate) and rate > 0):
        raise ShakeError(f"--rate {rate:g}: a positive number of hertz is needed")
    return np.arange(count) / rate


def _check_time(path: Path, time: npt.NDArray[np.float64]) -> None:
    """Time must be finite and rise from row to row, and there must be rows."""
    if len(time) < 2:
        raise ShakeError(f"{path}: {len(time)} rows of numbers, at least 2 are needed")
    if not np.isfinite(time).all():
        raise ShakeError(f"{path}: row {int(np.argmax(~np.isfinite(time))) + 1} of the table has no time")
    falls = np.diff(np.rint(time * 1e9)) <= 0
    if falls.any():
        row = int(np.argmax(falls)) + 2
        count = int(falls.sum())
        raise ShakeError(
            f"{path}: time does not rise at row {row} of the table ({time[row - 1]:.9g} s), {count} such rows"
        )
