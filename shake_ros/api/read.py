"""`read`: recordings from bags or from a laboratory's tables; `recording`: one from arrays; signals of one, by name."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias, overload, runtime_checkable

import numpy.typing as npt

from shake_ros.api.import_csv import import_csv
from shake_ros.quantities import ShakeError, unknown_name
from shake_ros.recordings.bags import TableRecording, Take, read_table_recording, write_table_recording
from shake_ros.recordings.bags.bag import SUFFIXES, natural_order
from shake_ros.recordings.bags.table import ARRAYS
from shake_ros.report.result_table import ResultTable

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from shake_ros.fit.records import Record


TABLES = (".csv", ".txt", ".dat", ".tsv", ".mat")
SIGNALS = ("valve_command", "position", "acceleration", *ARRAYS)


class Recordings(Sequence[TableRecording]):
    """Recordings in the order given, by number or by name.

    Examples
    --------
    >>> import numpy as np
    >>> import shake_ros as sr
    >>> time = np.arange(2000) / 1000
    >>> runs = sr.recording("sine", time, command=np.sin(time), position=0.01 * np.cos(time))
    >>> runs
    name  samples  rate [Hz]  length [s]  signals                  findings
    sine     2000       1000           2  valve_command, position  –
    >>> runs["sine"].position.shape
    (2000,)
    >>> runs.between(0.5, 1.5)
    name           samples  rate [Hz]  length [s]  signals                  findings
    sine[0.5:1.5]     1000       1000           1  valve_command, position  –
    """

    def __init__(self, recordings: Iterable[TableRecording]) -> None:
        self._recordings = tuple(recordings)
        names = self.names
        for name in names:
            if names.count(name) > 1:
                raise ShakeError(f"a recording named '{name}' is given twice")

    @property
    def names(self) -> tuple[str, ...]:
        """The recordings' names."""
        return tuple(r.name for r in self._recordings)

    def __len__(self) -> int:
        return len(self._recordings)

    @overload
    def __getitem__(self, key: int | str) -> TableRecording: ...

    @overload
    def __getitem__(self, key: slice) -> Recordings: ...

    def __getitem__(self, key: int | str | slice) -> TableRecording | Recordings:
        if isinstance(key, slice):
            return Recordings(self._recordings[key])
        if isinstance(key, int):
            return self._recordings[key]
        if key not in self.names:
            raise unknown_name("recording", key, self.names)
        return self._recordings[self.names.index(key)]

    def __add__(self, others: Iterable[TableRecording]) -> Recordings:
        return Recordings((*self, *others))

    def __repr__(self) -> str:
        return repr(self._frame())

    def _repr_html_(self) -> str:
        return self._frame()._repr_html_()

    def _frame(self) -> ResultTable:
        rows = []
        for r in self:
            signals = ", ".join(
                n for n in SIGNALS if getattr(r, n) is not None and (n != "position" or r.position_measured)
            )
            kinds = ", ".join(dict.fromkeys(f.kind for f in r.findings)) or None
            rows.append((r.name, len(r), 1.0 / r.sample_time, len(r) * r.sample_time, signals, kinds))
        return ResultTable(("name", "samples", "rate [Hz]", "length [s]", "signals", "findings"), rows)

    @property
    def findings(self) -> list[str]:
        """What reading met, a line each: gaps, stamps, values that are not numbers, leaps of the position."""
        from shake_ros.recordings.fit_records import finding_lines

        return [line for r in self for line in finding_lines(r)]

    @property
    def data_checks(self) -> list[str]:
        """Findings of the data checks, a line each: units, signs, swapped signals, two tables, too little motion.

        Recordings without a valve command are not checked, nor those that no fit would take.
        """
        from shake_ros.fit.start.data_checks import data_checks
        from shake_ros.recordings.fit_records import fit_records

        found = []
        for recording in self:
            try:
                found += fit_records(recording)
            except ShakeError:
                continue
        return data_checks(found) if found else []

    def between(self, start: float, stop: float) -> Recordings:
        """The samples from `start` to before `stop` [s] of each recording; segments stay apart."""
        return Recordings(r.between(start, stop) for r in self)

    def records(self, driven_by: str = "valve_command") -> list[Record]:
        """The gapless parts as a fit takes them; driven_by : `valve_command` or `force`."""
        from shake_ros.recordings.fit_records import fit_records

        return [record for r in self for record in fit_records(r, driven_by)]

    def plot(self) -> Figure:
        """Command, position and acceleration over time, a column for each recording."""
        from shake_ros.report.chart import recordings_figure

        return recordings_figure(self._recordings)


def read(
    *paths: str | Path,
    command: str | None = None,
    position: str | None = None,
    take: Take | None = None,
    **columns: Any,
) -> Recordings:
    """Read recordings: rosbag2 folders, .mcap and .db3 files; or text tables and .mat files with their columns.

    Parameters
    ----------
    paths : recordings of different names, or folders of recordings: all of them, in the order of their names.
    take : what to read of a signal of which a recording holds several, as {"joint_states": "x_axis"}: the full name of
        a topic, the name of a joint, the number of a publisher as a refusal lists them, or several of these.
    command, position, columns : columns of text tables and .mat files with factors to SI units, as `import_csv` takes
        them: `time` or `rate`, `command`, `position` or `acceleration` or both, `force` if there is any; `skip`.

    Returns
    -------
    Recordings
        A sequence of named recordings in SI units on one time base each; nothing is filled in.

    Raises
    ------
    ShakeError
        One line naming file, topic or column and reason, where a recording cannot be used.

    Examples
    --------
    >>> import tempfile
    >>> import shake_ros as sr
    >>> file = Path(tempfile.mkdtemp()) / "run.csv"
    >>> _ = file.write_text("t_s,u,x\\n" + "".join(f"{k / 200},{k % 7 / 10},{k % 5}\\n" for k in range(400)))
    >>> sr.read(file, time="t_s", command="u", position="x*0.001")
    name  samples  rate [Hz]  length [s]  signals                  findings
    run       400        200           2  valve_command, position  –
    """
    if command is None and position is None and not columns:
        tables = [path for path in paths if Path(path).suffix.lower() in TABLES]
        if tables:
            raise ShakeError(f'{tables[0]}: a table needs its columns, as in time="t", command="u", position="x*0.001"')
        return Recordings(read_table_recording(path, take) for given in paths for path in _within(Path(given)))
    if command is None:
        raise ShakeError("a table needs the column of the command")
    found = []
    with tempfile.TemporaryDirectory(prefix="shake_ros-read-") as folder:
        for number, path in enumerate(paths):
            recording = import_csv(path, Path(folder) / str(number), command=command, position=position, **columns)
            found.append(replace(recording, name=Path(path).stem))
    return Recordings(found)


def _within(path: Path) -> list[Path]:
    """The recordings of a folder of recordings; a recording as it is."""
    within = sorted(path.iterdir(), key=natural_order) if path.is_dir() else []
    if not any(one.is_dir() for one in within):
        return [path]
    return [one for one in within if one.is_dir() or one.name.endswith(SUFFIXES)]


def recording(
    name: str,
    time: npt.ArrayLike,
    command: npt.ArrayLike,
    position: npt.ArrayLike | None = None,
    **signals: npt.ArrayLike,
) -> Recordings:
    """A recording from arrays.

    Parameters
    ----------
    name : of the recording.
    time : shape (n,), rising [s].
    command : valve command, shape (n,) [-].
    position : shape (n,) [m]; None where the acceleration alone was measured.
    signals : acceleration [m/s²], pressure_a, pressure_b, pressure_load, pressure_supply [Pa], force [N], (n,) each;
        reference, estimate, truth, shape (n, 3) in SI units.

    Raises
    ------
    ShakeError
        Lengths differ, the time does not rise, or there is neither position nor acceleration.

    Examples
    --------
    >>> import shake_ros as sr
    >>> sr.recording("rest", [0.0, 0.1, 0.2], [0.0, 0.0, 0.0], [0.01, 0.01, 0.01])[0].position.tolist()
    [0.01, 0.01, 0.01]
    """
    with tempfile.TemporaryDirectory(prefix="shake_ros-recording-") as folder:
        bag = Path(folder) / "bag"
        try:
            write_table_recording(bag, time, command, position, **signals)  # type: ignore[arg-type]
            return Recordings([replace(read_table_recording(bag), name=name)])
        except ShakeError as error:
            raise ShakeError(str(error).replace(str(bag), name)) from None


@runtime_checkable
class Recorded(Protocol):
    """A result that can be looked at as a recording, such as a simulation's."""

    @property
    def recordings(self) -> Recordings:
        """It as recordings."""


Source: TypeAlias = str | Path | TableRecording | Recordings | Recorded
Data: TypeAlias = Source | Iterable[Source]


def recordings(data: Data | None) -> Recordings:
    """All recordings of paths, recordings and simulations; none of None.

    Raises
    ------
    ShakeError : one cannot be read, is not a recording, or has the name of another.
    """

    def each(source: Data) -> Iterator[TableRecording]:
        if isinstance(source, TableRecording):
            yield source
        elif isinstance(source, str | Path):
            yield from read(source)
        elif isinstance(source, Recorded):
            yield from source.recordings
        elif isinstance(source, Iterable):
            for one in source:
                yield from each(one)
        else:
            raise ShakeError(f"{source!r} is not a recording")

    return data if isinstance(data, Recordings) else Recordings(each(() if data is None else data))


def one_recording(source: Source) -> TableRecording:
    """The one recording of a path, recordings or a simulation.

    Raises
    ------
    ShakeError : it cannot be read, or there are several.
    """
    if isinstance(source, str | Path):
        return read_table_recording(source)
    found = source.recordings if isinstance(source, Recorded) else source
    if isinstance(found, TableRecording):
        return found
    if len(found) != 1:
        raise ShakeError(f"one recording is needed, {len(found)} are given: {', '.join(found.names)}")
    return found[0]


@contextmanager
def naming(source: Source) -> Iterator[None]:
    """Errors in the block begin with the recording's path, or its name where it was not read here."""
    try:
        yield
    except ShakeError as error:
        where = source if isinstance(source, str | Path) else one_recording(source).name
        raise ShakeError(f"{where}: {error}") from None
