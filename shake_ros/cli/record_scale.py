"""record_scale: an accelerogram, baseline-corrected and scaled into a table's envelope."""

from __future__ import annotations

import argparse
import dataclasses
import importlib.util
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import yaml
from numpy.typing import NDArray

from shake_ros.core.quantities import Parameters, ShakeError, quantity
from shake_ros.core.reference.baseline import integrate
from shake_ros.core.reference.earthquake import EarthquakeParameters, Fitted, fit
from shake_ros.core.reference.envelope import envelope
from shake_ros.core.reference.motion import Record
from shake_ros.core.reference.shaping import Shaping
from shake_ros.data.accelerograms import read_accelerogram
from shake_ros.data.accelerograms.accelerogram import UNITS, Accelerogram
from shake_ros.data.reference_program import load_reference
from shake_ros.settings import find, load_table, read_yaml

METHOD = """\
Baseline: the mean is removed, the ends are tapered, a Butterworth filter of order 4 is run forwards and backwards
(--high-pass, --low-pass), the displacement is faded in and out over a pad before and after the record, and two smooth
polynomials take out what is left at the end, so that the table starts and stops at rest in its middle."""
FILL = 1e4
PERIODS = 80


@dataclass(frozen=True)
class ScaleParameters(Parameters):
    position_share: float = quantity("-", "usable share of half the stroke", low=0.01, high=1.0)
    velocity_share: float = quantity("-", "usable share of the largest velocity", low=0.01, high=1.0)
    acceleration_share: float = quantity("-", "usable share of the largest acceleration", low=0.01, high=1.0)
    spectrum_damping: float = quantity("-", "damping of the response spectrum", low=0.0, high=0.99)
    shortest_period: float = quantity("s", "shortest period of the spectrum", low=0.001, high=100.0)
    longest_period: float = quantity("s", "longest period of the spectrum", low=0.001, high=100.0)


class Scaled(NamedTuple):
    """One record on its way: what was read, how it was treated, what came out."""

    path: Path
    read: Accelerogram
    parameters: EarthquakeParameters
    fitted: Fitted


def parser() -> argparse.ArgumentParser:
    """The command line."""
    p = argparse.ArgumentParser(
        prog="record_scale",
        description="Read accelerograms (.AT2, .smc, .V2, .V2c, two columns) and fit them into a table's envelope.",
        epilog=METHOD,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    p.add_argument("files", nargs="+", metavar="FILE", type=Path)
    p.add_argument("--table", default="bergamo", help="table whose envelope is used: a name or a YAML file")
    p.add_argument("--stroke", type=float, help="largest displacement from the middle [m] (default: from the table)")
    p.add_argument("--velocity", type=float, help="largest velocity [m/s] (default: from the table)")
    p.add_argument("--acceleration", type=float, help="largest acceleration [m/s²] (default: from the table)")
    p.add_argument("--channel", type=int, default=1, help="channel of a file that has several, from 1")
    p.add_argument("--unit", default="", choices=("", *UNITS), help="unit of a file that does not name its own")
    p.add_argument("--scale", default="1", help="factor on the acceleration, or 'fill' = as large as the table allows")
    p.add_argument("--time-scale", type=float, help="factor on the time, below 1 = faster")
    p.add_argument("--high-pass", type=float, help="lower end of the band [Hz], 0 = none")
    p.add_argument("--low-pass", type=float, help="upper end of the band [Hz], 0 = none")
    p.add_argument(
        "--out",
        type=Path,
        help="FILE.csv (time, acceleration, velocity, position) or FILE.yaml (for reference_generator); with several "
        "FILEs a folder of .csv",
    )
    p.add_argument("--force", action="store_true", help="overwrite")
    return p


def main(argv: list[str]) -> int:
    """Run the command; 0 done, 2 bad arguments or input."""
    try:
        arguments = parser().parse_args(argv)
    except SystemExit as stop:
        return int(stop.code or 0)
    try:
        run(arguments)
    except ShakeError as error:
        print(f"record_scale: {error}", file=sys.stderr)
        return 2
    except OSError as error:
        place = error.filename or "standard output"
        print(f"record_scale: {place}: cannot be written ({error.strerror})", file=sys.stderr)
        return 2
    return 0


def run(arguments: argparse.Namespace) -> None:
    """Read and scale every file, then print, then write."""
    path = find("record_scale", "default")
    scale = ScaleParameters.from_mapping(read_yaml(path), str(path))
    base, shaping = _base(arguments, scale)
    outputs = _outputs(arguments)
    done = [_scaled(file, base, arguments) for file in arguments.files]
    for item in done:
        print(describe(item))
    for item, out in zip(done if outputs else [], outputs, strict=True):
        out.parent.mkdir(parents=True, exist_ok=True)
        out.write_text(as_yaml(item, shaping) if out.suffix in (".yaml", ".yml") else as_csv(item), encoding="utf-8")
        print(f"written: {out}")
        if importlib.util.find_spec("matplotlib") is None:
            print("no figure: matplotlib is not installed")
            continue
        _draw(item, out.with_suffix(".png"), scale)
        print(f"written: {out.with_suffix('.png')}")


def _base(arguments: argparse.Namespace, scale: ScaleParameters) -> tuple[EarthquakeParameters, Shaping]:
    """Treatment of config/reference/earthquake.yaml with the limits of the table and what the arguments change."""
    reference = load_reference("earthquake")
    assert isinstance(reference.parameters, EarthquakeParameters)
    bounds = envelope(load_table(arguments.table))
    changes: dict[str, float | int | str] = {
        "position_limit": scale.position_share * bounds.position,
        "velocity_limit": scale.velocity_share * bounds.velocity,
        "acceleration_limit": scale.acceleration_share * bounds.acceleration,
        "scale": FILL if arguments.scale == "fill" else _number(arguments.scale),
        "channel": arguments.channel,
        "unit": arguments.unit,
    }
    for name, argument in (
        ("position_limit", "stroke"),
        ("velocity_limit", "velocity"),
        ("acceleration_limit", "acceleration"),
        ("time_scale", "time_scale"),
        ("high_pass", "high_pass"),
        ("low_pass", "low_pass"),
    ):
        if getattr(arguments, argument) is not None:
            changes[name] = getattr(arguments, argument)
    return reference.parameters.replace(**changes), reference.shaping


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise ShakeError(f"--scale '{text}' is neither a number nor 'fill'") from None


def _outputs(arguments: argparse.Namespace) -> list[Path]:
    """Where each file's result goes; an error where something is in the way."""
    if arguments.out is None:
        return []
    out: Path = arguments.out
    if len(arguments.files) == 1:
        if out.suffix not in (".csv", ".yaml", ".yml"):
            raise ShakeError(f"--out {out}: give a name that ends in .csv or .yaml")
        paths = [out]
    else:
        if out.suffix in (".csv", ".yaml", ".yml"):
            raise ShakeError(f"--out {out}: with several files give a folder")
        paths = [out / f"{file.stem}.csv" for file in arguments.files]
        if len(set(paths)) < len(paths):
            raise ShakeError(f"--out {out}: two files have the same name")
    for path in (p for result in paths for p in (result, result.with_suffix(".png"))):
        if path.is_dir():
            raise ShakeError(f"{path}: is a folder")
        if any(path.resolve() == file.resolve() for file in arguments.files):
            raise ShakeError(f"{path}: is one of the records to be read")
        if path.exists() and not arguments.force:
            raise ShakeError(f"{path}: exists (overwrite with --force)")
    return paths


def _scaled(path: Path, base: EarthquakeParameters, arguments: argparse.Namespace) -> Scaled:
    """Read one file and fit it."""
    read = read_accelerogram(path, channel=arguments.channel, unit=arguments.unit)
    parameters = base.replace(record=str(path))
    try:
        fitted = fit(parameters, Record(read.time, read.acceleration))
    except ShakeError as error:
        raise ShakeError(f"{path}: {error}") from None
    if arguments.scale == "fill" and not fitted.limited_by:
        raise ShakeError(f"{path}: no limit reached at a factor of {FILL:g}; is this a record?")
    return Scaled(path, read, parameters, fitted)


def _three(acceleration: NDArray[np.float64], step: float) -> list[tuple[float, float]]:
    """Peak and end value of acceleration, velocity and displacement."""
    signals = (acceleration, *integrate(acceleration, step))
    return [(float(np.max(np.abs(signal))), float(signal[-1])) for signal in signals]


def describe(item: Scaled) -> str:
    """The result as a table of text."""
    read, fitted, p = item.read, item.fitted, item.parameters
    before = _three(read.acceleration, read.time_step)
    corrected = _three(fitted.acceleration / fitted.factor if fitted.factor else fitted.acceleration, fitted.time_step)
    after = _three(fitted.acceleration, fitted.time_step)
    limits = (p.acceleration_limit, p.velocity_limit, p.position_limit)
    lines = [
        f"{item.path}: {read.name}",
        f"  {read.format}, {read.acceleration.size} samples of {read.time_step:g} s in {read.unit}"
        f"{f', channel {p.channel}' if p.channel > 1 else ''}",
        *(f"  warning: {warning}" for warning in read.warnings),
        f"  {'peak':<22}{'as recorded':>14}{'corrected':>14}{'for the table':>16}{'limit':>12}",
    ]
    names = ("acceleration [m/s²]", "velocity [m/s]", "displacement [m]")
    for name, b, c, a, limit in zip(names, before, corrected, after, limits, strict=True):
        lines.append(f"  {name:<22}{b[0]:>14.4g}{c[0]:>14.4g}{a[0]:>16.4g}{limit:>12.4g}")
    for name, b, c, a in zip(names[1:], before[1:], corrected[1:], after[1:], strict=True):
        lines.append(f"  {'at the end: ' + name.split()[0]:<22}{b[1]:>14.2e}{c[1]:>14.2e}{a[1]:>16.2e}")
    because = f" (limited by {fitted.limited_by.split('_')[0]})" if fitted.limited_by else ""
    band = f"{p.high_pass:g} … {p.low_pass:g} Hz" if p.low_pass else f"from {p.high_pass:g} Hz"
    lines.append(f"  factor {fitted.factor:.5g}{because}, time scale {p.time_scale:g}, band {band}")
    return "\n".join(lines)


def as_csv(item: Scaled) -> str:
    """Columns time, acceleration, velocity, position, with the treatment in comments."""
    fitted = item.fitted
    velocity, position = integrate(fitted.acceleration, fitted.time_step)
    time = np.arange(fitted.acceleration.size) * fitted.time_step
    head = [
        f"# {item.path.name}: {item.read.name}",
        f"# factor {fitted.factor:.9g}, time scale {item.parameters.time_scale:g}",
        "time [s],acceleration [m/s2],velocity [m/s],position [m]",
    ]
    rows = zip(time, fitted.acceleration, velocity, position, strict=True)
    return "\n".join([*head, *(f"{t:.9g},{a:.9e},{v:.9e},{x:.9e}" for t, a, v, x in rows)]) + "\n"


def as_yaml(item: Scaled, shaping: Shaping) -> str:
    """A configuration of reference_generator that plays the record in the same way."""
    final = item.parameters.replace(scale=item.fitted.factor)
    content = {"kind": "earthquake", **dataclasses.asdict(final), "shaping": dataclasses.asdict(shaping)}
    body: str = yaml.safe_dump(content, sort_keys=False, allow_unicode=True)
    return f"# {item.read.name}, fitted by record_scale. SI units.\n{body}"


def _draw(item: Scaled, path: Path, scale: ScaleParameters) -> None:
    from shake_ros.report.record_figure import Curve, draw

    fitted, read = item.fitted, item.read
    pad = (fitted.acceleration.size - read.acceleration.size) / 2 * fitted.time_step
    before = Curve("as recorded", pad, read.time_step, read.acceleration)
    after = Curve(f"for the table, factor {fitted.factor:.3g}", 0.0, fitted.time_step, fitted.acceleration)
    periods = np.geomspace(scale.shortest_period, scale.longest_period, PERIODS)
    draw(path, f"{item.path.name}: {read.name}", before, after, periods, scale.spectrum_damping)
