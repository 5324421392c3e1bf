"""iterate: the drive of the next run from the acceleration that the last one missed."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np
import yaml
from numpy.typing import NDArray

from shake_ros.core.control import CONTROLLERS
from shake_ros.core.control.iteration import Iteration, Run, error_in_band, iterate, next_drive
from shake_ros.core.control.runner import Controller
from shake_ros.core.loop.compiled import Loop, simulate
from shake_ros.core.loop.metrics import FREQUENCIES, HIGHEST, LOWEST, spectrum_of
from shake_ros.core.observer import OBSERVERS
from shake_ros.core.observer.runner import Observer
from shake_ros.core.quantities import ShakeError
from shake_ros.data.recordings import read_table_recording
from shake_ros.data.reference_program import build_program
from shake_ros.data.results import write_folder, write_json
from shake_ros.report import figures_iteration
from shake_ros.settings import find, load_table, load_variant, read_yaml

Array = NDArray[np.float64]
SAMPLE_TIME = 0.001
PADDED = 2  # samples of rest that an earthquake reference gets at either end; left out of the file for them
METHOD = """\
BAG… are runs of the same motion, oldest first, each recorded from the start of its reference, with imu and reference.
DIR gets drive.csv (time and acceleration) and drive.yaml, a reference: -p reference:=DIR/drive.yaml plays it.
With --simulate the runs are made on the closed loop of the core, and iteration.png shows the error against the run."""


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
    p.add_argument(
        "--model", help="with --simulate: table of the model feedforward and of an observer that has a model"
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
        if arguments.simulate is None:
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
    table = load_table(arguments.table)
    model = load_table(arguments.model) if arguments.model else None
    observer = Observer(*load_variant("observer", arguments.observer, OBSERVERS), SAMPLE_TIME, model)
    controller = Controller(*load_variant("controller", arguments.controller, CONTROLLERS), SAMPLE_TIME, model)
    first = np.array(build_program(arguments.wanted, SAMPLE_TIME).states)
    wanted = first[:, 2]
    aim = spectrum_of(wanted, SAMPLE_TIME)
    errors: list[float] = []
    spectra: list[Array] = []

    def play(reference: Array, number: int) -> Array:
        run, finite = simulate(Loop(table, observer, controller, reference, seed=number))
        if finite < len(reference):
            raise ShakeError(f"run {number + 1} left the finite numbers after {finite * SAMPLE_TIME:.3f} s")
        true = run.truth[:, 2]
        errors.append(float(np.sqrt(np.mean((true - wanted) ** 2)) / np.std(wanted)))
        spectra.append(spectrum_of(true, SAMPLE_TIME))
        off = float(np.max(np.abs(spectra[-1] / aim - 1.0)))
        print(f"run {number + 1}: acceleration {100.0 * errors[-1]:.2f} %, response spectrum {100.0 * off:.2f} %")
        return run.measured[:, 1]

    references, measured, reason = iterate(wanted, first, play, SAMPLE_TIME, parameters)
    best = int(np.argmin(measured))
    print(f"{reason}; the best run is {best + 1}")

    def fill(folder: Path) -> None:
        _write(folder, arguments.out, references[best], SAMPLE_TIME, measured)
        largest = [float(np.max(np.abs(found / aim - 1.0))) for found in spectra]
        frequencies = np.geomspace(LOWEST, HIGHEST, FREQUENCIES)
        figures_iteration.draw(folder / "iteration.png", errors, largest, frequencies, aim, spectra[best])

    write_folder(arguments.out, fill, force=arguments.force)
