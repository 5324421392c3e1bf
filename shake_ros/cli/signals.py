"""Commands on recordings and accelerograms: thd, spectrum, frequency_response, multisine_split, record_scale."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from shake_ros.api.record_scale import YAML, ScaledRecord, accelerogram, band_of, record_scale, treatment
from shake_ros.api.response_spectrum import DAMPING, HIGH, LOW, PER_OCTAVE, acceleration_spectra
from shake_ros.api.signals import INPUTS, OUTPUTS, WINDOW, frequency_response, multisine_split, thd
from shake_ros.api.signals import UNITS as CHANNELS
from shake_ros.cli.arguments import CommandLine, Reporting, reporting, source
from shake_ros.core.quantities import ShakeError
from shake_ros.data.accelerograms.accelerogram import UNITS
from shake_ros.data.result_folder import refuse_existing, writing
from shake_ros.report.page import write_page

THD_METHOD = """\
The fundamental is fitted to the acceleration, within 1 % of that of the reference or, if there is none, of the valve
command, unless --frequency names it.
Without --start and --stop, the segment in which that signal keeps its amplitude is used; of it, whole periods.
Amplitudes come from a least-squares fit of all harmonics below half the sampling rate (or of --harmonics N)."""


def thd_command(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    p = CommandLine("thd", THD_METHOD)
    p.add_argument("bags", nargs="+", metavar="BAG", type=Path)
    p.add_take()
    p.add_argument("--frequency", type=float, help="fundamental [Hz] (default: found)")
    p.add_argument("--harmonics", type=int, metavar="N", help="orders to fit and to print (default: all, 15 printed)")
    p.add_argument("--start", type=float, metavar="T", help="start of the segment that is used [s]")
    p.add_argument("--stop", type=float, metavar="T", help="end of the segment that is used [s]")
    given = p.parse_args(arguments)
    found = [thd(source(bag, given), given.frequency, given.harmonics, given.start, given.stop) for bag in given.bags]
    print("\n\n".join(map(repr, found)))
    return 0


SPECTRUM_METHOD = """\
BAG is a recording of a table (its topic imu) or an accelerogram. Each oscillator starts at rest and is advanced exactly
for straight lines between the samples; the free vibration after the accelerogram is included."""


def spectrum_command(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    p = CommandLine("spectrum", SPECTRUM_METHOD)
    p.add_argument("bags", nargs="+", metavar="BAG", type=Path)
    p.add_take()
    p.add_argument("--channel", type=int, default=0, help="component of an accelerogram that has several, from 1")
    p.add_argument(
        "--damping", type=float, nargs="+", default=list(DAMPING), metavar="XI", help="damping ratios (default: 0.05)"
    )
    p.add_argument("--low", type=float, default=LOW, metavar="HZ", help=f"lowest frequency (default: {LOW:g})")
    p.add_argument(
        "--high", type=float, metavar="HZ", help=f"highest (default: {HIGH:g}, or 0.45 of the sampling rate if lower)"
    )
    p.add_argument(
        "--per-octave",
        type=int,
        default=PER_OCTAVE,
        metavar="N",
        help=f"frequencies in each octave (default: {PER_OCTAVE})",
    )
    p.add_argument("--subtract-mean", action="store_true", help="subtract the mean first (a sensor's offset)")
    p.add_argument(
        "--band-limited", action="store_true", help="band-limited instead of straight lines: exact to 0.45 of the rate"
    )
    p.add_argument("--out", type=Path, metavar="FILE.csv", help="write the columns of one recording")
    p.add_argument("--force", action="store_true", help="replace an existing file")
    given = p.parse_args(arguments)
    if given.out is not None:
        if len(given.bags) > 1 or given.out.suffix != ".csv":
            raise ShakeError(f"--out {given.out}: give one recording and a name that ends in .csv")
        refuse_existing(given.out, force=given.force)
    band, how = (given.damping, given.low, given.high, given.per_octave), (given.subtract_mean, given.band_limited)
    given_of = [source(bag, given) for bag in given.bags]
    read = [accelerogram(s, given.channel) if isinstance(s, Path) else s for s in given_of]
    found = [acceleration_spectra(each, *band, *how) for each in read]
    print("\n\n".join(map(repr, found)))
    if given.out is not None:
        found[0].write(given.out, given.force)
        print(f"written: {given.out}")
    return 0


def frequency_response_command(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    p = CommandLine("frequency_response")
    p.add_argument("bag", metavar="BAG", type=Path)
    p.add_take()
    p.add_argument("--input", choices=tuple(INPUTS), default="valve_command")
    p.add_argument("--output", choices=tuple(OUTPUTS), default="position")
    p.add_argument("--window", type=float, default=WINDOW, metavar="T", help=f"window [s] (default: {WINDOW:g})")
    p.add_argument("--at", type=float, nargs="+", metavar="HZ", help="frequencies of the table (default: 0.5 … 20 Hz)")
    p.add_argument("--out", type=Path, metavar="DIR", help="folder for report.json and report.html with the plot")
    p.add_argument("--force", action="store_true", help="replace an existing result folder")
    p.add_figures()
    given = p.parse_args(arguments)
    if given.out is not None:
        refuse_existing(given.out, force=given.force)
    found = frequency_response(source(given.bag, given), given.input, given.output, given.window, given.at)
    if given.out is not None:
        found.report(given.out, given.force, **reporting("frequency_response", given, arguments))
    print(found)
    if given.out is not None:
        print(f"report: {given.out / 'report.html'}")
    return 0


MULTISINE_SPLIT_METHOD = """\
The excitation is the valve command. Without --period it is found from the command. The first period is
left out where two remain (--skip changes that). Even and odd distortion are apart only where odd lines alone are
excited, and the odd part is known only where some odd lines are left out (grid: odd_random of the multisine)."""


def multisine_split_command(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    p = CommandLine("multisine_split", MULTISINE_SPLIT_METHOD)
    p.add_argument("bag", metavar="BAG", type=Path)
    p.add_take()
    p.add_argument("--period", type=float, metavar="T", help="length of a period [s] (default: found)")
    p.add_argument("--channel", choices=tuple(CHANNELS), default="acceleration")
    p.add_argument("--skip", type=int, metavar="N", help="periods left out at the start")
    p.add_argument("--plot", type=Path, metavar="PNG", help="also draw the lines")
    p.add_argument("--force", action="store_true", help="replace an existing figure")
    given = p.parse_args(arguments)
    if given.plot is not None:
        refuse_existing(given.plot, force=given.force)
    found = multisine_split(source(given.bag, given), given.period, given.channel, given.skip)
    if given.plot is not None:
        with writing():
            found.plot().savefig(given.plot, dpi=110, format="png")
    print(found)
    return 0


RECORD_SCALE_METHOD = """\
Reads .AT2, .V1, .V2, .V2c, .smc, K-NET, ESM, AFAD, GeoNet and tables.
Baseline: the mean is removed, the ends are tapered, a Butterworth filter of order 4 is run forwards and backwards
(--high-pass, --low-pass; {band} unless given: the rest is removed), the displacement is faded in and out
over a pad before and after the record, and two smooth polynomials take out what is left at the end, so that the table
starts and stops at rest in its middle."""


def record_scale_parser() -> CommandLine:
    """The command line."""
    usual, _ = treatment()
    p = CommandLine("record_scale", RECORD_SCALE_METHOD.format(band=band_of(usual)))
    p.add_argument("files", nargs="+", metavar="FILE", type=Path)
    p.add_argument("--table", default="bergamo", help="table whose envelope is used: a name or a YAML file")
    p.add_argument("--stroke", type=float, help="largest displacement from the middle [m] (default: from the table)")
    p.add_argument("--velocity", type=float, help="largest velocity [m/s] (default: from the table)")
    p.add_argument("--acceleration", type=float, help="largest acceleration [m/s²] (default: from the table)")
    p.add_argument("--channel", type=int, default=0, help="channel of a file that has several, from 1")
    p.add_argument("--unit", default="", choices=("", *UNITS), help="unit of a file that does not name one")
    p.add_argument("--scale", default="1", help="factor on the acceleration, or 'fill' = as large as the table allows")
    p.add_argument(
        "--fit",
        action="store_true",
        help="if --scale does not fit, the largest that fits (refused without this option)",
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
    p.add_argument("--force", action="store_true", help="replace existing files")
    p.add_figures()
    return p


def record_scale_command(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    given = record_scale_parser().parse_args(arguments)
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
            raise ShakeError(f"{path}: is one of the files to be read")
        refuse_existing(path, force=force)
    return paths
