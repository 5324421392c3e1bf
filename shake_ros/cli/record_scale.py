"""record_scale: an accelerogram, baseline-corrected and scaled into a table's envelope."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from shake_ros.api.record_scale import YAML, ScaledRecord, band_of, record_scale, treatment
from shake_ros.cli.reporting import Reporting, add_figures, reporting
from shake_ros.core.quantities import ShakeError
from shake_ros.data.accelerograms.accelerogram import UNITS
from shake_ros.data.results import refuse_existing, writing
from shake_ros.report.written import write_page

METHOD = """\
Baseline: the mean is removed, the ends are tapered, a Butterworth filter of order 4 is run forwards and backwards
(--high-pass, --low-pass; {band} unless given: what lies outside is not played), the displacement is faded in and out
over a pad before and after the record, and two smooth polynomials take out what is left at the end, so that the table
starts and stops at rest in its middle."""


def parser() -> argparse.ArgumentParser:
    """The command line."""
    usual, _ = treatment()
    p = argparse.ArgumentParser(
        prog="record_scale",
        description="Read accelerograms (.AT2, .V1, .V2, .V2c, .smc, K-NET, ESM, AFAD, GeoNet, tables) and fit them "
        "into a table's envelope.",
        epilog=METHOD.format(band=band_of(usual)),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    p.add_argument("files", nargs="+", metavar="FILE", type=Path)
    p.add_argument("--table", default="bergamo", help="table whose envelope is used: a name or a YAML file")
    p.add_argument("--stroke", type=float, help="largest displacement from the middle [m] (default: from the table)")
    p.add_argument("--velocity", type=float, help="largest velocity [m/s] (default: from the table)")
    p.add_argument("--acceleration", type=float, help="largest acceleration [m/s²] (default: from the table)")
    p.add_argument("--channel", type=int, default=0, help="channel of a file that has several, from 1")
    p.add_argument("--unit", default="", choices=("", *UNITS), help="unit of a file that does not name its own")
    p.add_argument("--scale", default="1", help="factor on the acceleration, or 'fill' = as large as the table allows")
    p.add_argument(
        "--fit", action="store_true", help="where --scale does not fit, as large as it fits (refused without)"
    )
    p.add_argument("--time-scale", type=float, help="factor on the time, below 1 = faster")
    for option, end, value in (("--high-pass", "lower", usual.high_pass), ("--low-pass", "upper", usual.low_pass)):
        p.add_argument(option, type=float, help=f"{end} end of the band [Hz], 0 = none (default: {value:g})")
    p.add_argument(
        "--out",
        type=Path,
        help="FILE.csv (time, acceleration, velocity, position) or FILE.yaml (for reference_generator); with several "
        "FILEs a folder of .csv",
    )
    p.add_argument("--force", action="store_true", help="overwrite")
    add_figures(p)
    return p


def main(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    given = parser().parse_args(list(arguments))
    how = reporting("record_scale", given, arguments)
    options = vars(given).copy()
    del options["figures"]
    files, out, force = options.pop("files"), options.pop("out"), options.pop("force")
    outputs = targets(files, out, force) if out else []
    done = [record_scale(file, **options) for file in files]
    for item in done:
        print(item)
    for item, path in zip(done if outputs else [], outputs, strict=True):
        write(item, path, how)
    return 0


def write(item: ScaledRecord, path: Path, how: Reporting) -> None:
    """Write a result and its page."""
    item.write(path)
    print(f"written: {path}")
    with writing():
        write_page(item.page(how["command"]), path.parent, how["figures"], path.stem)
    print(f"report: {path.with_suffix('.html')}")


def targets(files: Sequence[Path], out: Path, force: bool) -> list[Path]:
    """Where each file's result goes; an error where something is in the way."""
    single = out.suffix in (".csv", *YAML)
    if len(files) == 1 and not single:
        raise ShakeError(f"--out {out}: give a name that ends in .csv or .yaml")
    if len(files) > 1 and single:
        raise ShakeError(f"--out {out}: with several files give a folder")
    paths = [out] if single else [out / f"{file.stem}.csv" for file in files]
    if len(set(paths)) < len(paths):
        raise ShakeError(f"--out {out}: two files have the same name")
    for path in (p for result in paths for p in (result, result.with_suffix(".html"))):
        if path.is_dir():
            raise ShakeError(f"{path}: is a folder")
        if any(path.resolve() == file.resolve() for file in files):
            raise ShakeError(f"{path}: is one of the records to be read")
        refuse_existing(path, force=force)
    return paths
