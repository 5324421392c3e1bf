"""A simulated table in closed loop that plays a motion again and again, and weighs what stands on it.

The moved mass follows from the forces of a run, what the chamber pressures push over the acceleration:

    A (P_A − α P_B) = M a + c tanh(v/v_c) + b v + F_0

is fitted by least squares to the samples at which the table slides, all signals below the same zero-phase filter; the
friction's form only has to take what is in phase with the velocity. A specimen that sways counts with what it moves on
average. Newton's law; not in the thesis.
Verified against: simulated tables of known loads.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from shake_ros.api.live_table import OWN, OwnLoop, own_loop
from shake_ros.api.loops import load_controller, load_observer
from shake_ros.api.progress import Progress, ProgressOption
from shake_ros.control.closed_loop import ClosedLoop, Loop, simulate
from shake_ros.control.laws.runner import Controller
from shake_ros.control.metrics import spectrum_of
from shake_ros.control.observer.runner import Observer
from shake_ros.fit.records import Record
from shake_ros.iteration.drive import Iteration, error_in_band
from shake_ros.physics.plant.parameters import FULL_LAYOUT, TableParameters
from shake_ros.quantities import ShakeError
from shake_ros.settings import load_table
from shake_ros.signals.velocity_filter import derivative, low_pass

Array = NDArray[np.float64]
SLIDING = 0.2  # of the velocity's rms, above which the table surely slides


def weigh(force: Array, acceleration: Array, position: Array, sample_time: float) -> float:
    """M [kg] of a run from the force of the pressures [N], acceleration [m/s²] and position [m], (n,) each.

    Raises
    ------
    ShakeError : a run that hardly moves.

    Examples
    --------
    >>> t = np.arange(4000) / 1000
    >>> a, x = -np.sin(9.0 * t), np.sin(9.0 * t) / 81.0
    >>> round(weigh(650.0 * a + 100.0 * np.tanh(20.0 * np.cos(9.0 * t)), a, x, 0.001))
    650
    """
    velocity = derivative(position, sample_time)
    usual = float(np.sqrt(np.mean(velocity**2)))
    sliding = np.abs(velocity) > SLIDING * usual
    if not usual > 0.0 or np.count_nonzero(sliding) < 100:
        raise ShakeError("weigh: the run hardly moves")
    pushed, felt = low_pass(force, sample_time)[sliding], low_pass(acceleration, sample_time)[sliding]
    v = velocity[sliding]
    columns = np.column_stack([felt, np.tanh(v / (SLIDING * usual)), v, np.ones_like(v)])
    return float(np.linalg.lstsq(columns, pushed, rcond=None)[0][0])


SPECIMEN = "body.specimen_mass"
OTHER_LOAD = 0.02  # of the moved mass, from which a weighed specimen is another


@dataclass
class SimulatedTable:
    """A table with its loop.

    Attributes
    ----------
    table : configuration of the table.
    observer, controller : names of configurations, or `own`, both, for a loop made for the table as it is declared.
    delay : samples by which a command reaches the valve late.
    sample_time : of the loop [s].
    progress : called with the figures of each run.
    changes : values to change in the table, by dotted name or its last part, of which the model knows nothing.
    """

    table: str | TableParameters = "bergamo"
    observer: str = OWN
    controller: str = OWN
    delay: int = 0
    sample_time: float = 0.001
    progress: ProgressOption = True
    changes: Mapping[str, float] = field(default_factory=dict)

    @property
    def declared(self) -> TableParameters:
        """The table as its configuration declares it, the first model where none is given."""
        return load_table(self.table)

    @property
    def plant(self) -> TableParameters:
        """The table as it is, with its changes."""
        return self.declared.with_values(FULL_LAYOUT.changes(self.changes))

    @cached_property
    def own(self) -> OwnLoop:
        """The loop made for the table as it is declared."""
        return own_loop(self.declared)

    def loop(self, model: TableParameters) -> tuple[Observer, Controller]:
        """Observer and controller that carry a model."""
        dt = self.sample_time
        if (self.observer == OWN) is not (self.controller == OWN):
            raise ShakeError(f"controller {self.controller} and observer {self.observer}: 'own' goes for both or none")
        if self.observer == OWN:
            return self.own.of(model, dt, self.delay * dt)
        return load_observer(self.observer, dt, model), load_controller(self.controller, dt, model)


class SimulatedRuns:
    """Runs of one motion on a simulated table, and their true figures.

    Parameters
    ----------
    table : the table.
    model : of the first run.
    wanted : the motion, shape (n, 3).
    judged_by : has the band of the error.

    Attributes
    ----------
    model : of the next drive. models : of the drives played so far.
    errors : of the true acceleration, one a run [-].
    spectra : response spectra of the runs, `aim` that of the wanted motion [m/s²].
    records : the runs as a fit takes them.
    last : the last run.
    """

    last: ClosedLoop

    def __init__(self, table: SimulatedTable, model: TableParameters, wanted: Array, judged_by: Iteration) -> None:
        self.table, self.model, self.wanted, self.judged_by = table, model, wanted, judged_by
        self.models = list[TableParameters]()
        self.aim = spectrum_of(wanted[:, 2], table.sample_time)
        self.errors, self.spectra, self.records = list[float](), list[Array](), list[Record]()

    def play(self, reference: Array, number: int) -> Array:
        """The accelerometer's record of a drive."""
        self.models.append(self.model)
        return self.run(self.model, reference, number).measured[:, 1]

    def weighed_anew(self) -> bool:
        """Whether the first run's forces indicate another specimen than the model has, which then has this one."""
        if len(self.models) > 1:
            return False
        model, body, measured = self.model, self.model.body, self.last.measured
        force = body.piston_area * (measured[:, 2] - body.area_ratio * measured[:, 3])
        moved = weigh(force, measured[:, 1], measured[:, 0], self.table.sample_time)
        weighed = model.with_values({SPECIMEN: max(0.0, moved - (model.moved_mass - model.value(SPECIMEN)))})
        changed = abs(weighed.moved_mass / model.moved_mass - 1.0) > OTHER_LOAD
        self.model = weighed if changed else model
        return changed

    def record(self, model: TableParameters, number: int) -> Record:
        """The recording of a run of the wanted motion under a model."""
        self.run(model, self.wanted, number)
        return self.records[-1]

    def run(self, model: TableParameters, reference: Array, number: int) -> ClosedLoop:
        """One run of a reference under a model.

        Raises
        ------
        ShakeError : the run diverged.
        """
        table, dt = self.table, self.table.sample_time
        observer, controller = table.loop(model)
        run, finite = simulate(Loop(table.plant, observer, controller, reference, seed=number, delay=table.delay))
        if finite < len(reference):
            raise ShakeError(f"run {number + 1} diverged after {finite * dt:.3f} s")
        self.last, true, wanted = run, run.truth[:, 2], self.wanted[:, 2]
        self.records.append(Record(f"run {number + 1}", dt, run.command, *run.measured[:, :2].T))
        self.errors.append(float(np.sqrt(np.mean((true - wanted) ** 2)) / np.std(wanted)))
        self.spectra.append(spectrum_of(true, dt))
        off = float(np.max(np.abs(self.spectra[-1] / self.aim - 1.0)))
        missed = error_in_band(wanted, run.measured[:, 1], dt, self.judged_by)
        with Progress("iterate", table.progress) as bar:
            bar(
                f"run {number + 1}: missed {100.0 * missed:.2f} % within the band (true acceleration "
                f"{100.0 * self.errors[-1]:.2f} %, response spectrum {100.0 * off:.2f} %)",
                1.0,
            )
        return run
