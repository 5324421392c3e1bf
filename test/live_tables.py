"""A `LiveTable` without ROS: the simulated table plays, between two rests, under the loop that was handed to it."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from shake_ros.api.live_table import InterlockHeldError
from shake_ros.api.simulate import Simulation, simulate
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.safety.causes import InterlockParameters
from shake_ros.settings import load_interlock

REST = 300  # samples before and after a drive


def acting(interlock: InterlockParameters, causes: Collection[str]) -> InterlockParameters:
    """An interlock of which some causes act beside `stop`."""
    kept = interlock.causes
    for name in set(interlock.limits) - {"stop", *causes}:
        kept = kept.replace(**{name: interlock.response(name).replace(action="none")})
    return interlock.replace(causes=kept)


class SimulatedLiveTable:
    """One table. held_at : part of each run after which the interlock holds; 0 for never."""

    def __init__(self, plant: TableParameters, folder: Path, held_at: float = 0.0) -> None:
        self.plant, self.held_at = plant, held_at
        self.words, self.loop, self.sample_time = "live, simulated, lock-step, interlock bergamo", "pid, linear", 0.001
        self.folder = folder / "live"
        self.folder.mkdir(parents=True)
        self.own = acting(load_interlock("bergamo"), ("position_hard", "position_soft", "velocity", "acceleration"))
        self.limited: list[dict[str, float]] = []
        self.carried: list[Path] = []
        self._loop = "linear_bergamo", "super_twisting_tuned"
        self._runs = 0

    def check(self) -> None:
        """Always ready."""

    def play(self, drive: NDArray[np.float64], name: str) -> Path:
        self._runs += 1
        rows = np.vstack([np.zeros((REST, 3)), drive, np.zeros((REST, 3))])
        observer, controller = self._loop
        run = simulate(self.plant, rows, self.sample_time, controller=controller, observer=observer, seed=self._runs)
        bag = self.folder / f"{self._runs}_{name}"
        if self.held_at:
            part = run.recording[slice(0, REST + round(self.held_at * len(drive)))]
            Simulation(part).write(bag)
            cause = "velocity 0.3 beyond 0.2 m/s"
            raise InterlockHeldError(f"{name}: the interlock held the table: {cause}", cause, bag)
        return run.write(bag)

    def carry(self, observer: Path, controller: Path) -> None:
        self.carried.append(observer)
        self._loop = str(observer), str(controller)

    def limit(self, thresholds: Mapping[str, float]) -> None:
        self.limited.append(dict(thresholds))

    def interlock(self) -> InterlockParameters:
        return self.own
