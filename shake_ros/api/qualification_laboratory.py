"""Where a qualification is played: the simulated table with its loop, each run recorded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from shake_ros.api.own_loop import FUSED, OwnLoop
from shake_ros.api.qualification_files import QualificationSettings
from shake_ros.api.simulate import Simulation, simulate
from shake_ros.core.control.runner import Controller
from shake_ros.core.observer.runner import Observer
from shake_ros.core.plant.parameters import TableParameters
from shake_ros.core.quantities import ShakeError
from shake_ros.data.recordings import TableRecording

Array = NDArray[np.float64]


class Laboratory(Protocol):
    """What plays and records a drive."""

    @property
    def words(self) -> str:
        """Its loop, for the certificate."""

    @property
    def remarks(self) -> dict[str, str]:
        """What the certificate says of it beyond that, by name."""

    @property
    def recordings(self) -> Sequence[TableRecording]:
        """Of all runs so far."""

    def play(self, model: TableParameters, drive: Array, name: str, number: int, /) -> TableRecording:
        """One recorded run of a drive (n, 3) under a model; `number` tells its noise from that of others."""


@dataclass
class SimulatedLaboratory:
    """The simulated table of a test, the loop made for its model where it has one, and the recordings made on it."""

    plant: TableParameters
    settings: QualificationSettings
    delay: int
    seed: int
    own: OwnLoop | None
    recordings: list[TableRecording]

    def loop(self, model: TableParameters) -> tuple[str | Observer, str | Controller]:
        """Observer and controller with a model, or the names of those that take one."""
        loop = self.settings.loop
        if self.own is None:
            return loop.observer, loop.controller
        return self.own.of(model, loop.sample_time, self.delay * loop.sample_time)

    @property
    def words(self) -> str:
        """Controller and observer, for the certificate."""
        loop = self.settings.loop
        if self.own is None:
            return f"{loop.controller}, {loop.observer}"
        told = "" if self.own.sound else ", which ring on a neighbour of it"
        return f"{self.own.kind}, {FUSED}, gains made for the model{told}"

    @property
    def remarks(self) -> dict[str, str]:
        """None."""
        return {}

    def play(self, model: TableParameters, drive: Array, name: str, number: int) -> TableRecording:
        """One recorded run."""
        observer, controller = self.loop(model)
        try:
            run: Simulation = simulate(
                self.plant,
                drive,
                self.settings.loop.sample_time,
                controller=controller,
                observer=observer,
                model=model,
                delay=self.delay,
                seed=1000 * self.seed + number,
            )
        except ShakeError as error:
            raise ShakeError(f"{name}: {error}") from None
        self.recordings.append(replace(run.recording, name=name))
        return self.recordings[-1]
