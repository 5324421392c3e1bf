"""`simulate`: any table under any command, or in closed loop behind a reference."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from shake_ros.api.loops import load_controller, load_observer
from shake_ros.api.model import Model
from shake_ros.api.read import Recordings
from shake_ros.api.response_spectrum import ResponseSpectrum, response_spectrum
from shake_ros.api.signals import Distortion, thd
from shake_ros.control.closed_loop import Loop, normalised_error
from shake_ros.control.closed_loop import simulate as run_loop
from shake_ros.control.laws.runner import Controller, refuse_another_instant
from shake_ros.control.observer.runner import Observer
from shake_ros.physics.plant import axis, reduced_simulation, simulation
from shake_ros.physics.plant.axis import AXIS_LAYOUT
from shake_ros.physics.plant.parameters import FULL_LAYOUT, TableParameters
from shake_ros.physics.plant.reduced import REDUCED_LAYOUT
from shake_ros.quantities import ShakeError
from shake_ros.recordings.bags import TableRecording, write_table_recording
from shake_ros.recordings.bags.table import ARRAYS, Provenance
from shake_ros.recordings.reference_file import build_program
from shake_ros.report.result_table import ResultTable, percent
from shake_ros.settings import find, read_yaml, table_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = npt.NDArray[np.float64]
LAYOUTS = {"dynamics": REDUCED_LAYOUT, "axis": AXIS_LAYOUT}  # by the section that no other table has


@dataclass(frozen=True, repr=False)
class Simulation:
    """A run of a table.

    Attributes
    ----------
    recording : what its sensors show, with the true motion, and reference and estimate in closed loop.
    """

    recording: TableRecording

    @property
    def recordings(self) -> Recordings:
        """It as recordings, for everything that takes those."""
        return Recordings([self.recording])

    @property
    def time(self) -> Array:
        """Shape (n,) [s]."""
        return self.recording.time

    @property
    def sample_time(self) -> float:
        """Distance of the samples [s]."""
        return self.recording.sample_time

    @property
    def command(self) -> Array:
        """Valve command [-], or the force of an axis [N], shape (n,)."""
        return self.recording.valve_command if self.recording.force is None else self.recording.force

    @property
    def position(self) -> Array:
        """True position, shape (n,) [m]."""
        return self._truth[:, 0]

    @property
    def velocity(self) -> Array:
        """True velocity, shape (n,) [m/s]."""
        return self._truth[:, 1]

    @property
    def acceleration(self) -> Array:
        """True acceleration, shape (n,) [m/s²]."""
        return self._truth[:, 2]

    @property
    def pressures(self) -> Array | None:
        """Both chambers' and the supply's, shape (n, 3) [Pa]; None of a table without hydraulics."""
        r = self.recording
        if r.pressure_a is None or r.pressure_b is None or r.pressure_supply is None:
            return None
        return np.column_stack([r.pressure_a, r.pressure_b, r.pressure_supply])

    @property
    def _truth(self) -> Array:
        assert self.recording.truth is not None
        return self.recording.truth

    @property
    def error(self) -> ResultTable:
        """Error of the motion behind its reference, rms(motion − reference)/rms(reference − mean)."""
        if self.recording.reference is None:
            raise ShakeError("a run without a reference has no tracking error")
        errors = normalised_error(self.recording.reference, self._truth).tolist()
        rows = zip(("position", "velocity", "acceleration"), errors, strict=True)
        return ResultTable(("motion", "error"), list(rows), {"error": percent})

    def thd(self, **options: Any) -> Distortion:
        """Harmonics of the acceleration; options as of `shake_ros.thd`."""
        return thd(self, **options)

    def spectrum(self, **options: Any) -> ResponseSpectrum:
        """Response spectrum of the acceleration; options as of `shake_ros.response_spectrum`."""
        return response_spectrum(self, **options)

    def plot(self) -> Figure:
        """Command, position and acceleration over time, and the reference where there is one."""
        from shake_ros.report.chart import recordings_figure

        return recordings_figure([self.recording])

    def write(self, path: str | Path, overwrite: bool = False) -> Path:
        """Write it as a recording that every command reads."""
        r = self.recording
        signals: dict[str, Any] = {name: getattr(r, name) for name in ARRAYS}
        valve = r.valve_command if r.force is None else None
        return write_table_recording(path, r.time, valve, r.position, r.acceleration, **signals, overwrite=overwrite)

    def __repr__(self) -> str:
        text = f"Simulation({self.recording.name}, {len(self.time)} samples of {self.sample_time:g} s)"
        return text if self.recording.reference is None else f"{text}\n{self.error!r}"


def simulate(
    table: str | Path | TableParameters | Model,
    command: npt.ArrayLike | str | Path,
    sample_time: float = 1e-3,
    *,
    controller: str | Path | Controller = "super_twisting_tuned",
    observer: str | Path | Observer | None = "linear_bergamo",
    model: TableParameters | None = None,
    delay: int = 0,
    seed: int = 0,
    start: float = 0.0,
) -> Simulation:
    """Simulate a table from rest.

    Parameters
    ----------
    table : a name of config/table, a YAML file, a table, or a model: full, reduced or axis.
    command : valve command [-], or force of an axis [N], shape (n,), held from each sample to the next. Or a reference
        that a closed loop follows: a name of config/reference, a YAML file, or shape (n, 3) [m], [m/s], [m/s²].
    sample_time : [s].
    controller, observer : of a closed loop, by name, file or object; without an observer it knows the true motion.
    model : table that controller and observer carry in place of the one that their configurations name.
    delay : samples by which a closed loop's command reaches the valve late.
    seed : of its sensors' noise.
    start : first position [m].

    Raises
    ------
    ShakeError
        Unknown names, values that are not finite, a closed loop that diverges, or one on a table without a valve.

    Examples
    --------
    >>> import shake_ros as sr
    >>> t = np.arange(2000) / 1000
    >>> run = sr.simulate("bergamo", 0.1 * np.sin(2 * np.pi * 2 * t))
    >>> round(float(np.ptp(run.velocity[1000:])), 2)
    0.13
    >>> sine = 0.005 * np.column_stack([1 - np.cos(6 * t), 6 * np.sin(6 * t), 36 * np.cos(6 * t)])
    >>> followed = sr.simulate("bergamo", sine, observer=None)
    >>> followed.error["error"][0] < 0.05
    True
    """
    plant = _table(table)
    if isinstance(command, str | Path):
        program = build_program(str(command), sample_time)
        name, given = Path(command).stem, program.samples(0, program.length)
    else:
        name, given = plant.layout.name, np.asarray(command, dtype=np.float64)
    if given.ndim == 1:
        return Simulation(_free_run(plant, given, sample_time, start))
    if plant.layout is not FULL_LAYOUT:
        raise ShakeError(
            f"a closed loop needs a table with a valve and hydraulics, not one of the model {plant.layout.name}"
        )
    law = controller if isinstance(controller, Controller) else load_controller(str(controller), sample_time, model)
    if observer is not None and not isinstance(observer, Observer):
        observer = load_observer(str(observer), sample_time, model)
    if observer is not None:
        refuse_another_instant(observer.lead, law)
    run, finite = run_loop(Loop(plant, observer, law, given, seed=seed, delay=delay, start=start))
    if finite < len(given):
        raise ShakeError(f"{name}: the closed loop diverged after {finite * sample_time:g} s")
    signals = {"reference": run.reference, "estimate": run.estimate, "truth": run.truth}
    return Simulation(_recording(name, sample_time, run.command, run.measured, signals))


def _table(given: str | Path | TableParameters | Model) -> TableParameters:
    """A table of any layout."""
    if isinstance(given, TableParameters):
        return given
    if isinstance(given, Model):
        if given.table is None:
            raise ShakeError(f"the model {given.kind} has no table before it is fitted")
        return given.table
    path = find("table", str(given))
    content = read_yaml(path)
    known = content if isinstance(content, Mapping) else {}
    layout = next((layout for section, layout in LAYOUTS.items() if section in known), FULL_LAYOUT)
    return table_of(content, str(path), layout)


def _free_run(plant: TableParameters, commands: Array, dt: float, start: float) -> TableRecording:
    """A run under a command that does not answer, on sensors without noise."""
    if plant.layout is AXIS_LAYOUT:
        first = axis.initial_state(start, 0.0)
        out = axis.run_batch(plant.vector(), first, commands, dt)[0]
        measured = out[:, [0, 2]]
        return _recording("axis", dt, np.full(len(out), np.nan), measured, {"truth": out[:, :3], "force": commands})
    if plant.layout is REDUCED_LAYOUT:
        out = reduced_simulation.run(plant, commands, dt, position=start)
        return _recording("reduced", dt, commands, out[:, [0, 2]], {"truth": out[:, :3]})
    out = simulation.run(plant, commands, dt, position=start)
    return _recording("full", dt, commands, out[:, [0, 2, 3, 4, 5]], {"truth": out[:, :3]})


def _recording(name: str, dt: float, command: Array, measured: Array, signals: dict[str, Array]) -> TableRecording:
    """Arrays as a recording; columns of `measured`: position, acceleration, and the pressures where there are any."""
    pressures = ("pressure_a", "pressure_b", "pressure_supply")
    shown = dict(zip(("position", "acceleration", *pressures), measured.T, strict=False))
    return TableRecording(
        name=name,
        time=np.asarray(np.arange(len(command)) * dt, dtype=np.float64),
        sample_time=dt,
        valve_command=command,
        segments=(slice(0, len(command)),),
        provenance=Provenance({}, 0, True),
        **shown,
        **signals,  # type: ignore[arg-type]
    )
