"""Commands on recordings and accelerograms: thd, spectrum, frequency_response, multisine_split, record_scale."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from shake_ros.api.record_scale import YAML, accelerogram, band_of, record_scale, treatment
from shake_ros.api.response_spectrum import acceleration_spectra
from shake_ros.api.signals import frequency_response, multisine_split, thd
from shake_ros.cli.arguments import CommandLine, reported, source
from shake_ros.quantities import ShakeError
from shake_ros.report.page import write_page
from shake_ros.result_folder import refuse_existing, writing

THD_METHOD = """\
The fundamental is fitted to the acceleration, within 1 % of that of the reference or, if there is none, of the valve
command, unless --frequency names it.
Without --start and --stop, the segment in which that signal keeps its amplitude is used; of it, whole periods.
Amplitudes come from a least-squares fit of all harmonics below half the sampling rate (or of --harmonics N)."""


def thd_command(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    p = CommandLine("thd", THD_METHOD)
    p.add_recordings(nargs="+")
    p.add_verb(thd)
    given = p.read(arguments)
    print("\n\n".join(repr(thd(source(bag, given), **p.options(given))) for bag in given.bags))
    return 0


SPECTRUM_METHOD = """\
BAG is a recording of a table (its topic imu) or an accelerogram. Each oscillator starts at rest and is advanced exactly
for straight lines between the samples; the free vibration after the accelerogram is included."""


def spectrum_command(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    p = CommandLine("spectrum", SPECTRUM_METHOD)
    p.add_recordings(nargs="+")
    p.add_argument("--channel", type=int, default=0, help="component of an accelerogram that has several, from 1")
    p.add_verb(acceleration_spectra)
    p.add_argument("--out", type=Path, metavar="FILE.csv", help="write the columns of one recording")
    p.add_argument("--force", action="store_true", help="replace an existing file")
    given = p.read(arguments)
    if given.out is not None:
        if len(given.bags) > 1 or given.out.suffix != ".csv":
            raise ShakeError(f"--out {given.out}: give one recording and a name that ends in .csv")
        refuse_existing(given.out, force=given.force)
    sources = [source(bag, given) for bag in given.bags]
    read = [accelerogram(s, given.channel) if isinstance(s, Path) else s for s in sources]
    found = [acceleration_spectra(each, **p.options(given)) for each in read]
    print("\n\n".join(map(repr, found)))
    if given.out is not None:
        found[0].write(given.out, given.force)
        print(f"written: {given.out}")
    return 0


def frequency_response_command(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    p = CommandLine("frequency_response")
    p.add_recordings()
    p.add_verb(frequency_response)
    p.add_argument("--out", type=Path, metavar="DIR", help="folder for report.json and report.html with the plot")
    p.add_argument("--force", action="store_true", help="replace an existing result folder")
    p.add_figures()
    given = p.read(arguments)
    if given.out is not None:
        refuse_existing(given.out, force=given.force)
    found = frequency_response(source(given.bags, given), **p.options(given))
    if given.out is not None:
        return reported(found, given)
    print(found)
    return 0


MULTISINE_SPLIT_METHOD = """\
The excitation is the valve command. Without --period it is found from the command. The first period is
left out where two remain (--skip changes that). Even and odd distortion are apart only where odd lines alone are
excited, and the odd part is known only where some odd lines are left out (grid: odd_random of the multisine)."""


def multisine_split_command(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    p = CommandLine("multisine_split", MULTISINE_SPLIT_METHOD)
    p.add_recordings()
    p.add_verb(multisine_split)
    p.add_argument("--plot", type=Path, metavar="PNG", help="also draw the lines")
    p.add_argument("--force", action="store_true", help="replace an existing figure")
    given = p.read(arguments)
    if given.plot is not None:
        refuse_existing(given.plot, force=given.force)
    found = multisine_split(source(given.bags, given), **p.options(given))
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


def record_scale_command(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    p = CommandLine("record_scale", RECORD_SCALE_METHOD.format(band=band_of(treatment()[0])))
    p.add_argument("files", nargs="+", metavar="FILE", type=Path)
    p.add_verb(record_scale)
    p.add_argument(
        "--out",
        type=Path,
        help="FILE.csv (time, acceleration, velocity, position) or FILE.yaml (for reference_generator); with several "
        "FILEs a folder of .csv",
    )
    p.add_argument("--force", action="store_true", help="replace existing files")
    p.add_figures()
    given = p.read(arguments)
    outputs = targets(given.files, given.out, given.force) if given.out else []
    done = [record_scale(file, **p.options(given)) for file in given.files]
    for item in done:
        print(item)
    for item, path in zip(done if outputs else [], outputs, strict=True):
        item.write(path)
        print(f"written: {path}")
        with writing():
            write_page(item.page(), path.parent, given.figures, path.stem, given.line)
        print(f"report: {path.with_suffix('.html')}")
    return 0


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
