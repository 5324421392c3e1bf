"""iterate: the drive of the next run from the acceleration that the last one missed."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import numpy as np
import yaml
from numpy.typing import NDArray

from shake_ros.core.control import CONTROLLERS
from shake_ros.core.control.closed_loop import ClosedLoop
from shake_ros.core.control.runner import Controller
from shake_ros.core.identification.recordings import Record
from shake_ros.core.iteration.drive import Iteration, Run, error_in_band, iterate, next_drive
from shake_ros.core.iteration.model import iterate_model, refit
from shake_ros.core.loop.compiled import Loop, simulate
from shake_ros.core.loop.metrics import FREQUENCIES, HIGHEST, LOWEST, spectrum_of
from shake_ros.core.observer import OBSERVERS
from shake_ros.core.observer.runner import Observer
from shake_ros.core.plant.parameters import TableParameters
from shake_ros.core.quantities import ShakeError, unknown_name
from shake_ros.data.fit_records import read_fit_records
from shake_ros.data.recordings import read_table_recording
from shake_ros.data.reference_program import build_program
from shake_ros.data.results import write_folder, write_json
from shake_ros.declared import effect_candidates, free_parameters
from shake_ros.report import figures_iteration
from shake_ros.settings import find, load_table, load_variant, read_yaml, save_table

Array = NDArray[np.float64]
SAMPLE_TIME = 0.001
PADDED = 2  # samples of rest that an earthquake reference gets at either end; left out of the file for them
METHOD = """\
BAG… are runs of the same motion, oldest first, each recorded from the start of its reference, with imu and reference.
DIR gets drive.csv (time and acceleration) and drive.yaml, a reference: -p reference:=DIR/drive.yaml plays it.
With --simulate the runs are made on the closed loop of the core, and iteration.png shows the error against the run.
With --refit the motion stays as it is and the model of the feedforward is fitted to the last run, the parameters of
config/identification/full.yaml and those of the named effects; DIR gets model.yaml, which the controller's and the
observer's configurations name as their model for the next run."""


def parser() -> argparse.ArgumentParser:
    """The command line."""
    p = argparse.ArgumentParser(
        prog="iterate",
        description="Correct the drive of a shaking table by what the last run missed.",
        epilog=METHOD,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    p.add_argument("bags", nargs="*", metavar="BAG", type=Path)
    p.add_argument("--wanted", required=True, metavar="REFERENCE", help="the motion that the table should make")
    p.add_argument("--out", required=True, metavar="DIR", type=Path)
    p.add_argument("--config", default="default", help="config/iteration/NAME.yaml or a file (default: default)")
    p.add_argument("--simulate", type=int, metavar="N", help="make at most N runs on the simulated table")
    p.add_argument("--table", default="bergamo", help="with --simulate: the table (default: bergamo)")
    p.add_argument("--observer", default="linear_bergamo", help="with --simulate (default: linear_bergamo)")
    p.add_argument("--controller", default="super_twisting_tuned", help="with --simulate")
    p.add_argument("--model", help="table of the model feedforward and of an observer that has a model")
    p.add_argument("--delay", type=int, default=0, help="with --simulate: samples a command is late (default: 0)")
    p.add_argument(
        "--refit", nargs="*", metavar="EFFECT", help="fit --model, with these effects, instead of correcting the drive"
    )
    p.add_argument("--force", action="store_true", help="replace an existing DIR")
    return p


def main(argv: list[str]) -> int:
    """Run the command; 0 done, 2 bad arguments or input."""
    try:
        arguments = parser().parse_args(argv)
    except SystemExit as stop:
        return int(stop.code or 0)
    try:
        if bool(arguments.bags) == (arguments.simulate is not None):
            raise ShakeError("give either recordings or --simulate N")
        path = find("iteration", arguments.config)
        parameters = Iteration.from_mapping(read_yaml(path), str(path))
        if arguments.refit is not None and not arguments.model:
            raise ShakeError("--refit: needs --model, the table that is fitted")
        if arguments.simulate is None and arguments.refit is not None:
            _model_from_recordings(arguments, parameters)
        elif arguments.simulate is None:
            _from_recordings(arguments, parameters)
        else:
            _simulated(arguments, parameters.replace(runs=arguments.simulate))
    except ShakeError as error:
        print(f"iterate: {error}", file=sys.stderr)
        return 2
    return 0


def _run(path: Path, samples: int, sample_time: float | None) -> tuple[Run, float]:
    """The played and the measured acceleration of a recording from the first sample of its reference on."""
    recording = read_table_recording(path)
    part = recording.longest
    for name, content in (("imu", part.acceleration), ("reference", part.reference)):
        if content is None:
            raise ShakeError(f"{path}: no topic {name}")
    assert part.acceleration is not None and part.reference is not None
    known = np.flatnonzero(np.isfinite(part.reference).all(axis=1))
    first = int(known[0]) if known.size else len(part.time)
    played = part.reference[first : first + samples, 2]
    if len(played) < samples or not np.isfinite(played).all():
        raise ShakeError(f"{path}: {known.size} unbroken samples of the reference, the wanted motion has {samples}")
    if sample_time is not None and abs(part.sample_time - sample_time) > 1e-3 * sample_time:
        raise ShakeError(
            f"{path}: a sample every {part.sample_time:g} s, the recordings before every {sample_time:g} s"
        )
    return Run(played, part.acceleration[first : first + samples]), part.sample_time


def _from_recordings(arguments: argparse.Namespace, parameters: Iteration) -> None:
    sample_time = round(read_table_recording(arguments.bags[0]).sample_time, 7)
    wanted = build_program(arguments.wanted, sample_time).states[:, 2]
    runs = [_run(path, len(wanted), sample_time)[0] for path in arguments.bags]
    drive, factor = next_drive(wanted, runs, sample_time, parameters)
    errors = [error_in_band(wanted, run.achieved, sample_time, parameters) for run in runs]
    write_folder(
        arguments.out, lambda folder: _write(folder, arguments.out, drive, sample_time, errors), force=arguments.force
    )
    for path, error in zip(arguments.bags, errors, strict=True):
        print(f"{path}: acceleration missed by {100.0 * error:.2f} % within the band")
    if factor < 1.0:
        print(f"the next drive was scaled by {factor:.3f} to stay within its limits")
    print(f"next drive: {arguments.out / 'drive.yaml'}")


def _learning(effects: Sequence[str]) -> Callable[[TableParameters, Sequence[Record]], TableParameters]:
    """`refit` of the declared parameters and those of named effects, to the records of a run."""
    free, known = free_parameters(), {c.effect: c for c in effect_candidates()}
    for effect in effects:
        if effect not in known:
            raise unknown_name("effect", effect, known, "--refit")
    chosen = [known[effect] for effect in effects]
    return lambda model, records: refit(model, free, chosen, records)


def _model_from_recordings(arguments: argparse.Namespace, parameters: Iteration) -> None:
    """The model of the next run from the last recording."""
    learn, model = _learning(arguments.refit), load_table(arguments.model)
    sample_time = round(read_table_recording(arguments.bags[0]).sample_time, 7)
    wanted = build_program(arguments.wanted, sample_time).states[:, 2]
    errors = []
    for path in arguments.bags:
        achieved = _run(path, len(wanted), sample_time)[0].achieved
        errors.append(error_in_band(wanted, achieved, sample_time, parameters))
    records, findings = read_fit_records(arguments.bags[-1:])
    for finding in findings:
        print(finding, file=sys.stderr)
    model = learn(model, records)
    write_folder(arguments.out, lambda folder: _write_model(folder, model, errors), force=arguments.force)
    for path, error in zip(arguments.bags, errors, strict=True):
        print(f"{path}: acceleration missed by {100.0 * error:.2f} % within the band")
    print(f"model of the next run: {arguments.out / 'model.yaml'}")


def _write_model(folder: Path, model: TableParameters, errors: list[float]) -> None:
    """model.yaml and iteration.json."""
    save_table(folder / "model.yaml", model, "Fitted to the last run by iterate.")
    write_json(folder / "iteration.json", {"schema": "shake_ros.iterate/1", "error_in_band": errors})


def _write(folder: Path, out: Path, drive: Array, sample_time: float, errors: list[float]) -> None:
    """drive.csv, drive.yaml (naming the file where it will lie) and iteration.json."""
    played = drive[PADDED:-PADDED, 2]
    time = np.arange(len(played)) * sample_time
    np.savetxt(folder / "drive.csv", np.column_stack([time, played]), fmt=("%.6f", "%.12e"), delimiter=",")
    reference = read_yaml(find("reference", "earthquake"))
    limits = {"position_limit": 10.0, "velocity_limit": 100.0, "acceleration_limit": 1000.0}
    whole = {"high_pass": 0.0, "low_pass": 0.0, "pad_time": 0.0, "scale": 1.0, "unit": "m/s2"}
    reference |= {"record": str((out / "drive.csv").resolve()), **whole, **limits}
    text = "# The next drive of an iteration, played as it is.\n" + yaml.safe_dump(reference, sort_keys=False)
    (folder / "drive.yaml").write_text(text, encoding="utf-8")
    write_json(folder / "iteration.json", {"schema": "shake_ros.iterate/1", "error_in_band": errors})


def _simulated(arguments: argparse.Namespace, parameters: Iteration) -> None:
    model = load_table(arguments.model) if arguments.model else None
    first = np.array(build_program(arguments.wanted, SAMPLE_TIME).states)
    table = Simulated(load_table(arguments.table), arguments, first)
    if arguments.refit is not None:
        assert model is not None
        models, measured, reason = iterate_model(
            first[:, 2], model, table.record, _learning(arguments.refit), parameters
        )
    else:
        play = partial(table.acceleration, model)
        references, measured, reason = iterate(first[:, 2], first, play, SAMPLE_TIME, parameters)
    best = int(np.argmin(measured))
    print(f"{reason}; the best run is {best + 1}")

    def fill(folder: Path) -> None:
        if arguments.refit is not None:
            _write_model(folder, models[best], measured)
        else:
            _write(folder, arguments.out, references[best], SAMPLE_TIME, measured)
        largest = [float(np.max(np.abs(found / table.aim - 1.0))) for found in table.spectra]
        frequencies = np.geomspace(LOWEST, HIGHEST, FREQUENCIES)
        figures_iteration.draw(
            folder / "iteration.png", table.errors, largest, frequencies, table.aim, table.spectra[best]
        )

    write_folder(arguments.out, fill, force=arguments.force)


class Simulated:
    """The simulated table that `--simulate` plays on; it prints each run's true figures and keeps them."""

    def __init__(self, table: TableParameters, arguments: argparse.Namespace, wanted: Array) -> None:
        self.table = table
        self.arguments = arguments
        self.wanted = wanted
        self.aim = spectrum_of(wanted[:, 2], SAMPLE_TIME)
        self.errors: list[float] = []
        self.spectra: list[Array] = []

    def run(self, model: TableParameters | None, reference: Array, number: int) -> ClosedLoop:
        """One run of a reference under a model.

        Raises
        ------
        ShakeError : the run left the finite numbers.
        """
        given = self.arguments
        observer = Observer(*load_variant("observer", given.observer, OBSERVERS), SAMPLE_TIME, model)
        controller = Controller(*load_variant("controller", given.controller, CONTROLLERS), SAMPLE_TIME, model)
        run, finite = simulate(Loop(self.table, observer, controller, reference, seed=number, delay=given.delay))
        if finite < len(reference):
            raise ShakeError(f"run {number + 1} left the finite numbers after {finite * SAMPLE_TIME:.3f} s")
        true, wanted = run.truth[:, 2], self.wanted[:, 2]
        self.errors.append(float(np.sqrt(np.mean((true - wanted) ** 2)) / np.std(wanted)))
        self.spectra.append(spectrum_of(true, SAMPLE_TIME))
        off = float(np.max(np.abs(self.spectra[-1] / self.aim - 1.0)))
        print(f"run {number + 1}: acceleration {100.0 * self.errors[-1]:.2f} %, response spectrum {100.0 * off:.2f} %")
        return run

    def acceleration(self, model: TableParameters | None, reference: Array, number: int) -> Array:
        """The accelerometer's record of a run of a reference."""
        return self.run(model, reference, number).measured[:, 1]

    def record(self, model: TableParameters, number: int) -> Record:
        """The recording of a run of the wanted motion under a model."""
        run = self.run(model, self.wanted, number)
        return Record(f"run {number + 1}", SAMPLE_TIME, run.command, run.measured[:, 0], run.measured[:, 1])
