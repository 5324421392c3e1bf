"""The three models that `schedule` compares, fitted to the same windows and run over the same validation data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from shake_ros.api.progress import Progress
from shake_ros.core.identification.fit import Fit, fit
from shake_ros.core.identification.free_parameters import FreeParameters
from shake_ros.core.identification.recordings import FULL, Record, RecordingProblem, low_pass, relative_error
from shake_ros.core.identification.schedule import WINDOW, Training, pieces, run_scheduled, train, window_fits
from shake_ros.core.plant.parameters import TableParameters
from shake_ros.core.plant.simulation import run
from shake_ros.core.quantities import ShakeError
from shake_ros.declared import effect_candidates, free_parameters

ENOUGH = 8  # windows on which one set of parameters and the effect are fitted, evenly spread


@dataclass(frozen=True)
class ValidationRuns:
    """Free runs over one recording by the name of the model, columns as plant/simulation.py:COLUMNS."""

    record: Record
    runs: dict[str, np.ndarray]

    def error(self, name: str, first: float = 0.0, last: float = np.inf) -> dict[str, float]:
        """Relative errors between two times [s]."""
        r, dt = self.record, self.record.sample_time
        span = slice(max(r.start, round(first / dt)), len(r.commands) if last == np.inf else round(last / dt))
        found = {"velocity": relative_error(r.velocity[span], low_pass(self.runs[name][:, 1], dt)[span])}
        if r.acceleration is not None:
            found["acceleration"] = relative_error(r.acceleration[span], self.runs[name][span, 2])
        return found


def simulated(settings: Mapping[str, Any], table: TableParameters) -> tuple[list[Record], list[Record]]:
    """Sines to learn from; the doubled amplitude and a sum of sines to validate."""
    truth, dt = table.with_values(settings["truth"]), float(settings["sample_time"])
    rng = np.random.default_rng(int(settings["seed"]))

    def recorded(name: str, command: np.ndarray) -> Record:
        out = run(truth, command, dt)
        noise = rng.standard_normal((2, len(command)))
        position = out[:, 0] + truth.sensors.position_noise * noise[0]
        return Record(name, dt, command, position, out[:, 2] + truth.sensors.acceleration_noise * noise[1])

    time = np.arange(round(WINDOW / dt)) * dt
    grid = [(float(a), float(f)) for a in settings["amplitudes"] for f in settings["frequencies"]]
    learn = [recorded(f"{a:g} at {f:g} Hz", a * np.cos(2.0 * np.pi * f * time)) for a, f in grid]
    step, several = settings["doubling"], settings["sum"]
    time = np.arange(round(step["seconds"] / dt)) * dt
    doubled = np.where(time < step["at"], 1.0, 2.0) * step["amplitude"] * np.sin(2.0 * np.pi * step["frequency"] * time)
    time = np.arange(round(several["seconds"] / dt)) * dt
    waves = zip(several["amplitudes"], several["frequencies"], strict=True)
    total = np.sum([a * np.cos(2.0 * np.pi * f * time) for a, f in waves], axis=0)
    return learn, [recorded("amplitude doubled", doubled), recorded("sum of sines", total)]


def with_effect(settings: Mapping[str, Any], declared: Fit, windows: list[Record]) -> TableParameters:
    """The table with the physical effect, fitted from the best of its trials."""
    candidate = next((c for c in effect_candidates() if c.effect == settings["effect"]), None)
    if candidate is None:
        raise ShakeError(f"config/schedule: unknown effect '{settings['effect']}'")
    free = declared.free.extended(candidate.free)
    problem = RecordingProblem(windows[:: max(len(windows) // ENOUGH, 1)])
    values = dict(zip(declared.free.names, (declared.x * declared.free.scale).tolist(), strict=True))
    starts = np.array([free.x_of({**values, **trial}) for trial in candidate.trials])
    costs = np.sum(np.nan_to_num(problem.residuals(free.vectors(starts)), nan=1e3) ** 2, axis=1)
    found = fit(problem, free, starts[int(np.argmin(costs))], evaluations=15, tolerance=1e-3)
    return free.table(found.x)


def compare(
    settings: Mapping[str, Any], table: TableParameters, learn: list[Record], hold: list[Record], bar: Progress
) -> tuple[Training, list[ValidationRuns]]:
    """Fit, train, and run all three models over the validation data."""
    windows = pieces(learn)
    if not windows:
        raise ShakeError(f"--learn: no stretch of {WINDOW:g} s")
    known = {f.name: f for f in free_parameters()}
    missing = [name for name in settings["parameters"] if name not in known]
    if missing:
        raise ShakeError(f"config/schedule: parameter '{missing[0]}' is not in config/identification/full.yaml")
    free = FreeParameters(table, [known[name] for name in settings["parameters"]])
    bar("one set of parameters", 0.0)
    spread = windows[:: max(len(windows) // ENOUGH, 1)]
    declared = fit(RecordingProblem(spread), free, free.start(), evaluations=15, tolerance=1e-3)
    bar("parameters of every window", 0.15)
    inputs, outputs = window_fits(windows, free, declared.x)
    bar("training of the network", 0.5)
    training = train(inputs, outputs, int(settings["seed"]))
    bar("the physical effect", 0.7)
    extended = with_effect(settings, declared, windows)
    bar("recordings held out", 0.9)
    fixed = free.table(declared.x)
    compared = []
    for record in hold:
        runs = {
            "one set": FULL.run(fixed, record),
            "schedule": run_scheduled(training.network, free, record),
            settings["effect"]: FULL.run(extended, record),
        }
        compared.append(ValidationRuns(record, runs))
    return training, compared
