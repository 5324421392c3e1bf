"""The three models that `schedule` compares, fitted to the same windows and run over the same validation data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from shake_ros.api.progress import Progress
from shake_ros.core.identification.fit import Fit, fit
from shake_ros.core.identification.free_parameters import FreeParameters
from shake_ros.core.identification.network import Training, radial_basis, train
from shake_ros.core.identification.recording_problem import RecordingProblem
from shake_ros.core.identification.recordings import FULL, Record, relative_error
from shake_ros.core.identification.schedule import WINDOW, pieces, run_scheduled, window_fits
from shake_ros.core.identification.velocity_filter import filtered_velocity
from shake_ros.core.plant.parameters import TableParameters
from shake_ros.core.plant.simulation import run
from shake_ros.core.quantities import ShakeError
from shake_ros.declared import effect_candidates, free_parameters

ENOUGH = 8  # windows on which one set of parameters and the effect are fitted, evenly spread


@dataclass(frozen=True)
class SeedResult:
    """A network of one seed, on the windows that it has not seen.

    Attributes
    ----------
    seed : of split and weights. training : with its curves. radial_basis : mean square of the scaled error on the test
    part of a radial-basis network, beside `training.test`.
    errors : mean relative error of the free run over the windows to test on, of velocity and acceleration, by what
    gives the parameters: "one set", "network", "fit to the window", the least that any schedule could have.
    """

    seed: int
    training: Training
    radial_basis: float
    errors: Mapping[str, tuple[float, float]]


@dataclass(frozen=True)
class ValidationRuns:
    """Free runs over one recording by the name of the model, columns as plant/simulation.py:COLUMNS."""

    record: Record
    runs: dict[str, np.ndarray]

    def error(self, name: str, first: float = 0.0, last: float = np.inf) -> dict[str, float]:
        """Relative errors between two times [s]."""
        r, dt = self.record, self.record.sample_time
        span = slice(max(r.start, round(first / dt)), len(r.commands) if last == np.inf else round(last / dt))
        found = {"velocity": relative_error(r.velocity[span], filtered_velocity(self.runs[name][:, 1], dt)[span])}
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


def window_errors(windows: Sequence[Record], free: FreeParameters, rows: np.ndarray) -> tuple[float, float]:
    """Mean relative error of velocity and acceleration over windows, each with its row of parameters."""
    found = []
    for window, vector in zip(windows, free.vectors(np.clip(rows, free.low, free.high)), strict=True):
        error = RecordingProblem([window]).errors(vector)[window.name]
        found.append((error["velocity"], error.get("acceleration", np.nan)))
    velocity, acceleration = np.mean(found, axis=0)
    return float(velocity), float(acceleration)


def trained(
    seed: int, windows: Sequence[Record], free: FreeParameters, one: np.ndarray, data: tuple[np.ndarray, np.ndarray]
) -> SeedResult:
    """Train on the windows' features and parameters, and run the windows that were held out; one : the constant set."""
    training = train(*data, seed)
    test = training.split.test
    held = [windows[k] for k in test]
    rows = {
        "one set": np.tile(one, (len(test), 1)),
        "network": training.network(data[0][test]),
        "fit to the window": data[1][test],
    }
    errors = {name: window_errors(held, free, values) for name, values in rows.items()}
    return SeedResult(seed, training, radial_basis(*data, training.split), errors)


def compare(
    settings: Mapping[str, Any], table: TableParameters, learn: list[Record], hold: list[Record], bar: Progress
) -> tuple[list[SeedResult], list[ValidationRuns]]:
    """Fit, train once for each seed, and run all three models over the validation data.

    The network that runs over the validation data is that with the least error on the part to stop by.
    """
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
    bar("parameters of every window", 0.1)
    data = window_fits(windows, free, declared.x)
    seeds = []
    for k, seed in enumerate(settings["seeds"]):
        bar(f"training of the network, seed {seed}", 0.3 + 0.5 * k / len(settings["seeds"]))
        seeds.append(trained(int(seed), windows, free, declared.x, data))
    bar("the physical effect", 0.8)
    extended = with_effect(settings, declared, windows)
    bar("recordings held out", 0.9)
    fixed, network = free.table(declared.x), chosen(seeds).network
    compared = []
    for record in hold:
        runs = {
            "one set": FULL.run(fixed, record),
            "schedule": run_scheduled(network, free, record),
            settings["effect"]: FULL.run(extended, record),
        }
        compared.append(ValidationRuns(record, runs))
    return seeds, compared


def chosen(seeds: Sequence[SeedResult]) -> Training:
    """The training with the least error on the part to stop by, in spreads of the parameters."""
    return min((one.training for one in seeds), key=lambda t: t.stop)
