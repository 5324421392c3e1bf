"""A simulated table in closed loop that plays a motion again and again, as `iterate_simulated` needs it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from shake_ros.api.own_loop import OWN, OwnLoop, own_loop
from shake_ros.api.progress import Progress, Told
from shake_ros.api.simulate import controller_of, observer_of
from shake_ros.core.control.closed_loop import ClosedLoop
from shake_ros.core.control.runner import Controller
from shake_ros.core.identification.recordings import Record
from shake_ros.core.iteration.drive import Iteration, error_in_band
from shake_ros.core.iteration.weighing import weigh
from shake_ros.core.loop.compiled import Loop, simulate
from shake_ros.core.loop.metrics import spectrum_of
from shake_ros.core.observer.runner import Observer
from shake_ros.core.plant.parameters import FULL_LAYOUT, TableParameters
from shake_ros.core.quantities import ShakeError
from shake_ros.settings import load_table

Array = NDArray[np.float64]
SPECIMEN = "body.specimen_mass"


@dataclass
class SimulatedTable:
    """A table with its loop, and the true figures of the runs made on it.

    Attributes
    ----------
    table : configuration of the table. changes : values to change in it, by dotted name or its last part, of which
    the model knows nothing. observer, controller : names of configurations, or `own`, both, for a loop made for the
    table as it is declared. delay : samples by which a command reaches the valve late. sample_time : of the loop [s].
    progress : told the figures of each run. errors : of the true acceleration, one a run [-]. spectra : response
    spectra of the runs, `aim` that of the wanted motion [m/s²]. records : the runs as a fit takes them. last : the
    last run.
    """

    table: str | TableParameters = "bergamo"
    observer: str = OWN
    controller: str = OWN
    delay: int = 0
    sample_time: float = 0.001
    progress: Told = True
    changes: Mapping[str, float] = field(default_factory=dict)
    wanted: Array = field(default_factory=lambda: np.zeros((0, 3)), init=False)
    aim: Array = field(default_factory=lambda: np.zeros(0), init=False)
    errors: list[float] = field(default_factory=list, init=False)
    spectra: list[Array] = field(default_factory=list, init=False)
    judged_by: Iteration | None = field(default=None, init=False)
    records: list[Record] = field(default_factory=list, init=False)
    last: ClosedLoop | None = field(default=None, init=False)

    @property
    def declared(self) -> TableParameters:
        """The table as its configuration declares it, the first model where none is given."""
        return load_table(self.table) if isinstance(self.table, str) else self.table

    @property
    def plant(self) -> TableParameters:
        """The table as it is, with its changes."""
        return self.declared.with_values(
            {FULL_LAYOUT.full_name(name, "set"): float(value) for name, value in self.changes.items()}
        )

    @cached_property
    def own(self) -> OwnLoop:
        """The loop made for the table as it is declared."""
        return own_loop(self.declared)

    def loop(self, model: TableParameters | None) -> tuple[Observer, Controller]:
        """Observer and controller that carry a model."""
        dt = self.sample_time
        if (self.observer == OWN) is not (self.controller == OWN):
            raise ShakeError(f"controller {self.controller} and observer {self.observer}: 'own' goes for both or none")
        if self.observer == OWN:
            return self.own.of(self.declared if model is None else model, dt, self.delay * dt)
        return observer_of(self.observer, dt, model), controller_of(self.controller, dt, model)

    def weighed(self, model: TableParameters) -> TableParameters:
        """The model with the specimen that the forces of the last run tell."""
        body, run = model.body, self.last
        if run is None or run.measured.shape[1] < 4:
            raise ShakeError("no run with pressures that could be weighed")
        force = body.piston_area * (run.measured[:, 2] - body.area_ratio * run.measured[:, 3])
        found = weigh(force, run.measured[:, 1], run.measured[:, 0], self.sample_time)
        return model.with_values({SPECIMEN: max(0.0, found.mass - (model.moved_mass - model.value(SPECIMEN)))})

    def begin(self, wanted: Array, judged_by: Iteration | None = None) -> None:
        """Forget earlier runs; `wanted` is the motion of the next ones, shape (n, 3), `judged_by` has their band."""
        self.judged_by = judged_by
        self.wanted, self.aim = wanted, spectrum_of(wanted[:, 2], self.sample_time)
        self.errors, self.spectra, self.records = [], [], []

    def run(self, model: TableParameters | None, reference: Array, number: int) -> ClosedLoop:
        """One run of a reference under a model.

        Raises
        ------
        ShakeError : the run left the finite numbers.
        """
        dt = self.sample_time
        observer, controller = self.loop(model)
        run, finite = simulate(Loop(self.plant, observer, controller, reference, seed=number, delay=self.delay))
        if finite < len(reference):
            raise ShakeError(f"run {number + 1} left the finite numbers after {finite * dt:.3f} s")
        self.last = run
        true, wanted = run.truth[:, 2], self.wanted[:, 2]
        measured = run.measured[:, :2].T
        self.records.append(Record(f"run {number + 1}", dt, run.command, *measured))
        self.errors.append(float(np.sqrt(np.mean((true - wanted) ** 2)) / np.std(wanted)))
        self.spectra.append(spectrum_of(true, dt))
        off = float(np.max(np.abs(self.spectra[-1] / self.aim - 1.0)))
        text = f"acceleration {100.0 * self.errors[-1]:.2f} %, response spectrum {100.0 * off:.2f} %"
        if self.judged_by is not None:
            missed = error_in_band(wanted, run.measured[:, 1], dt, self.judged_by)
            text = f"missed {100.0 * missed:.2f} % within the band (true {text})"
        text = f"run {number + 1}: {text}"
        with Progress("iterate", self.progress) as bar:
            bar(text, 1.0)
        return run

    def acceleration(self, model: TableParameters | None, reference: Array, number: int) -> Array:
        """The accelerometer's record of a run of a reference."""
        return self.run(model, reference, number).measured[:, 1]

    def record(self, model: TableParameters, number: int) -> Record:
        """The recording of a run of the wanted motion under a model."""
        self.run(model, self.wanted, number)
        return self.records[-1]
