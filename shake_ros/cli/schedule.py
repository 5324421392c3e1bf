"""`schedule`: the thesis's neural schedule of θ_1 … θ_7 (6.3.5) beside the physical effect, on the same recordings."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from shake_ros.api.fitted import fit_data
from shake_ros.cli import fitting
from shake_ros.cli.progress import Bar
from shake_ros.core.identification.fit import Fit, fit
from shake_ros.core.identification.free_parameters import FreeParameters
from shake_ros.core.identification.recordings import FULL, Record, RecordingProblem, low_pass, relative_error
from shake_ros.core.identification.schedule import WINDOW, Training, pieces, run_scheduled, train, window_fits
from shake_ros.core.plant.parameters import TableParameters
from shake_ros.core.plant.simulation import run
from shake_ros.core.quantities import ShakeError
from shake_ros.data.results import check_folder, write_folder, write_json
from shake_ros.declared import effect_candidates, free_parameters
from shake_ros.report.schedule_page import schedule_page
from shake_ros.settings import find, load_table, read_yaml

ENOUGH = 8  # windows on which one set of parameters and the effect are fitted, evenly spread
KEYS = {
    *("table", "truth", "effect", "parameters", "sample_time", "amplitudes", "frequencies", "doubling", "sum", "seed"),
}


@dataclass(frozen=True)
class Comparison:
    """One held-out recording: free runs by the name of the model, columns as plant/simulation.py:COLUMNS."""

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


def main(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    command = argparse.ArgumentParser(prog="schedule", description=__doc__)
    fitting.add_data(command)
    command.add_argument("--config", default="default", metavar="NAME", help="config/schedule/NAME.yaml or a file")
    given = command.parse_args(list(arguments))
    if bool(given.estimation) != bool(given.validation):
        raise ShakeError("--learn and --hold: both or neither (without them, data are simulated)")
    check_folder(given.out, given.force)
    settings = read_settings(given.config)
    table = load_table(settings["table"])
    if given.estimation:
        learn, hold = fit_data(*fitting.read_data(given), "valve_command")
        change = None
    else:
        learn, hold = simulated(settings, table)
        change = float(settings["doubling"]["at"])
    with Bar("schedule") as bar:
        training, compared = compare(settings, table, learn, hold, bar)
    content = summary(training, compared, change)
    page = schedule_page(training, [(c.record, c.runs) for c in compared], content, change)

    def fill(folder: Path) -> None:
        write_json(folder / "report.json", content)
        (folder / "report.html").write_text(page, encoding="utf-8")

    write_folder(given.out, fill, force=given.force)
    print("\n".join(lines(content)))
    print(f"report: {given.out / 'report.html'}")
    return 0


def read_settings(name: str) -> dict[str, Any]:
    """The content of a configuration; missing and unknown keys are errors."""
    path = find("schedule", name)
    content = read_yaml(path)
    if not isinstance(content, dict) or set(content) != KEYS:
        raise ShakeError(f"{path}: expected the keys {', '.join(sorted(KEYS))}")
    return content


def simulated(settings: dict[str, Any], table: TableParameters) -> tuple[list[Record], list[Record]]:
    """Sines to learn from; the doubled amplitude and a sum of sines held out."""
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


def with_effect(settings: dict[str, Any], declared: Fit, windows: list[Record]) -> TableParameters:
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
    settings: dict[str, Any], table: TableParameters, learn: list[Record], hold: list[Record], bar: Bar
) -> tuple[Training, list[Comparison]]:
    """Fit, train, and run all three models over the recordings held out."""
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
        compared.append(Comparison(record, runs))
    return training, compared


def summary(training: Training, compared: Sequence[Comparison], change: float | None) -> dict[str, Any]:
    """Content of report.json."""
    first = compared[0]
    content: dict[str, Any] = {
        "schema": "shake_ros.schedule/1",
        "training": {"learn": training.learn, "stop": training.stop, "test": training.test, "epochs": training.epochs},
        "error": {c.record.name: {name: c.error(name) for name in c.runs} for c in compared},
    }
    if change is not None:
        content["after_change"] = {
            "within_window": {name: first.error(name, change, change + WINDOW) for name in first.runs},
            "later": {name: first.error(name, change + WINDOW) for name in first.runs},
        }
    return content


def lines(content: dict[str, Any]) -> list[str]:
    """What is printed."""
    t = content["training"]
    parts = f"to learn {t['learn']:.2g}, to stop by {t['stop']:.2g}, to test {t['test']:.2g}"
    result = [
        f"network: {t['epochs']} epochs, mean square of the scaled error {parts}",
        f"{'free-run error on what was held out':<44}{'velocity':>12}{'acceleration':>14}",
    ]
    rows = dict(content["error"])
    for key, title in (("within_window", f"first {WINDOW:g} s after the change"), ("later", "later")):
        if "after_change" in content:
            rows[title] = content["after_change"][key]
    for title, models in rows.items():
        for name, e in models.items():
            felt = f"{100 * e['acceleration']:.2f} %" if "acceleration" in e else "–"
            result.append(f"{title + ': ' + name:<44}{100 * e['velocity']:>10.2f} %{felt:>14}")
    return result
