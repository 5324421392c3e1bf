"""Readers on small files written here: header styles, columns, line ends, units, and everything malformed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from shake_ros.quantities import ShakeError
from shake_ros.recordings.accelerograms import FORMATS, read_accelerogram

G = 9.80665
VALUES = np.round(0.3 * np.sin(np.arange(23) * 0.7), 7)
HEAD = (
    "PEER NGA STRONG MOTION DATABASE RECORD\nSOMEWHERE 01/01/00, STATION, 90\nACCELERATION TIME HISTORY IN UNITS OF G\n"
)
STYLES = ("NPTS=     23, DT=   .0050 SEC\n", "   23    0.0050    NPTS, DT\n", "NPTS, DT: 23 .0050\n")


def columns(count: int, values: np.ndarray = VALUES) -> str:
    rows = [values[i : i + count] for i in range(0, values.size, count)]
    return "".join("".join(f"{v:15.7E}" for v in row) + "\n" for row in rows)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "record.dat"


def write(path: Path, text: str) -> Path:
    path.write_bytes(text.encode("latin-1"))
    return path


def refused(path: Path, **options: object) -> str:
    """The message with which a file is refused, without its path."""
    with pytest.raises(ShakeError) as error:
        read_accelerogram(path, **options)  # type: ignore[arg-type]
    text = str(error.value)
    assert text.startswith(str(path))
    assert "\n" not in text
    return text[len(str(path)) :]


@pytest.mark.parametrize("style", STYLES)
@pytest.mark.parametrize("count", [5, 8])
@pytest.mark.parametrize("ending", ["\n", "\r\n", "\r\r\n", "\r"])
def test_peer_header_styles_columns_and_line_ends(file: Path, style: str, count: int, ending: str) -> None:
    text = (HEAD + style + columns(count)).replace("\n", ending)
    found = read_accelerogram(write(file, text))
    assert (found.format, found.unit, found.time_step) == ("peer_at2", "g", 0.005)
    assert np.allclose(found.acceleration, VALUES * G, atol=1e-9)
    assert found.name == "SOMEWHERE 01/01/00, STATION, 90"
    assert found.time[-1] == pytest.approx(22 * 0.005)


@pytest.mark.parametrize(
    "unit_line", ["ACCELERATION TIME HISTORY IN UNITS OF G. FILTER POINTS: HP=0.2 Hz LP=15.0 Hz", "UNITS OF CM/SEC/SEC"]
)
def test_peer_units_as_written(file: Path, unit_line: str) -> None:
    found = read_accelerogram(write(file, f"0.01\nPEER\nX\n{unit_line}\n{STYLES[0]}{columns(5)}"))
    assert found.peak == pytest.approx(np.max(np.abs(VALUES)) * (G if " G" in unit_line else 0.01))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (HEAD + STYLES[0] + columns(5, VALUES[:20]), ", line 8: 20 samples where the header declares 23"),
        (HEAD + STYLES[0] + columns(5) + "0.1\n", ", line 10: 24 samples where the header declares 23"),
        (
            HEAD + STYLES[0] + columns(5).replace(f"{VALUES[7]:15.7E}", "            NaN"),
            ", line 6: acceleration 'NaN'",
        ),
        (HEAD + STYLES[0].replace("23", "2 3") + columns(5), ", line 9: 23 samples where the header declares 2"),
        (HEAD + STYLES[0].replace(".0050", "0.0") + columns(5), ", line 4: time step 0 s is outside"),
        (HEAD + columns(5), ", line 8: no line with NPTS and DT"),
        (HEAD.replace("OF G", "OF BANANAS") + STYLES[0] + columns(5), ", line 3: unknown unit"),
        (HEAD.replace("ACCEL", "VELOCITY TIME HISTORY, ACCEL") + STYLES[0] + columns(5), ", line 1: holds velocity"),
        (HEAD + STYLES[0] + columns(5, VALUES * 1e4), "wrong unit?"),
        (HEAD + STYLES[0] + columns(5, VALUES * 0.0), "every sample is zero"),
    ],
)
def test_malformed_peer_files_are_refused_by_line(file: Path, text: str, message: str) -> None:
    assert message in refused(write(file, text))


def table(separator: str, heading: str = "", step: float = 0.01, values: np.ndarray = VALUES) -> str:
    return heading + "".join(f"{i * step:.3f}{separator}{v:.7f}\n" for i, v in enumerate(values))


@pytest.mark.parametrize("separator", [",", ";", "\t", "  ", " , "])
@pytest.mark.parametrize("heading", ["", "time,acceleration\n", "# made by hand\n\ntime [s],acc [m/s2]\n", "% 1\n"])
def test_two_columns_with_any_separator_and_heading(file: Path, separator: str, heading: str) -> None:
    found = read_accelerogram(write(file, table(separator, heading)), unit="m/s2")
    assert found.format == "two_columns"
    assert found.time_step == pytest.approx(0.01)
    assert np.allclose(found.acceleration, VALUES)


def test_unit_of_two_columns_comes_from_the_heading_or_the_caller(file: Path) -> None:
    assert read_accelerogram(write(file, table(","))).warnings
    assert read_accelerogram(file, unit="g").acceleration == pytest.approx(VALUES * G)
    assert read_accelerogram(write(file, table(",", "time [s],acc [g]\n"))).acceleration == pytest.approx(VALUES * G)
    assert read_accelerogram(write(file, table(",", "# gal\n"))).acceleration == pytest.approx(VALUES * 0.01)
    assert "the heading says g, not m/s2" in refused(write(file, table(",", "time,acc [g]\n")), unit="m/s2")


def test_more_columns_need_a_heading_that_names_the_two(file: Path) -> None:
    body = "".join(f"{v},{i * 0.01:.2f},7\n" for i, v in enumerate(VALUES))
    found = read_accelerogram(write(file, "acceleration [m/s2],time [s],temperature\n" + body))
    assert np.allclose(found.acceleration, VALUES)
    assert "3 columns without a heading" in refused(write(file, body))


def test_times_may_be_rounded_as_printed_and_start_anywhere(file: Path) -> None:
    text = "".join(f"{12.0 + i / 300:.4f} {v}\n" for i, v in enumerate(VALUES))
    assert read_accelerogram(write(file, text), unit="g").time_step == pytest.approx(1 / 300, rel=1e-3)


def test_times_may_have_just_the_digits_of_the_step(file: Path) -> None:
    text = "".join(f"{i * 0.02:.2f} {v}\n" for i, v in enumerate(VALUES))
    assert read_accelerogram(write(file, text), unit="g").time_step == pytest.approx(0.02)
    assert "time is not uniform" in refused(write(file, text.replace("0.10 ", "0.11 ")))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (table(",").replace("0.050,", "0.040,"), ", line 6: time does not advance: 0.04 s after 0.04 s"),
        (table(",").replace("0.050,", "0.055,"), ", line 6: time is not uniform"),
        ("\n".join(reversed(table(",").splitlines())), ", line 2: time does not advance"),
        (table(",").replace("0.050,", "nan,"), ", line 6: time 'nan' is not a finite number"),
        (table(",").replace("0.050,", "0.050,1,"), ": line 6 has 3 columns where 2 should be"),
        ("".join(f"{i**1.01 * 0.01:.6f},1\n" for i in range(400)), "time is not uniform"),
        (table(",", values=VALUES[:9]), ", line 1: 9 samples are fewer than 16"),
        (table(",", step=2.0), ": time step 2 without a unit"),
        ("0.0 1\n0.0 1\n", ", line 2: time does not advance"),
        ("0.0 1\n", ", line 1: one sample is not an accelerogram"),
        (table(",").replace("0.050,", "0.050,2x"), ": line 6, column '2' holds '2x-0.1052350', not a number"),
        ("0,1e99\n" * 20, ", line 2: time does not advance"),
    ],
)
def test_malformed_columns_are_refused_by_line(file: Path, text: str, message: str) -> None:
    assert message in refused(write(file, text))


def test_other_content_is_refused_with_the_known_formats(file: Path, tmp_path: Path) -> None:
    assert refused(write(file, "")) == ": is empty"
    assert refused(write(file, " \r\n\x1a\x1a")) == ": is empty"
    assert all(name in refused(write(file, "Dear reader,\nthis is a letter.\n")) for name in FORMATS)
    assert "format not recognised" in refused(write(file, "\xa0\x85\n"))
    file.write_bytes(bytes(range(256)) * 20)
    assert refused(file) == ", line 1: is not text (byte 0x00 at 0)"
    assert "cannot be read (No such file" in refused(tmp_path / "absent.AT2")
    assert "cannot be read (Is a directory)" in refused(tmp_path)


def test_unknown_unit_of_the_caller_lists_the_known(file: Path) -> None:
    with pytest.raises(ShakeError, match=r"unknown unit 'furlong'.*known: cm/s2, g, m/s2"):
        read_accelerogram(write(file, table(",")), unit="furlong")


def smc(count: int = 23, declared: float | None = None) -> str:
    """A small .smc file of VALUES in cm/s²."""
    integers = np.full(48, -32768)
    integers[15], integers[16] = 1, count
    reals = np.full(50, 1.7e38)
    reals[1] = 200.0
    reals[29] = np.max(np.abs(VALUES)) if declared is None else declared
    lines = ["2 CORRECTED ACCELEROGRAM", *["*"] * 4, "station = Here", *["*"] * 5]
    lines += ["".join(f"{v:10d}" for v in integers[i : i + 8]) for i in range(0, 48, 8)]
    lines += ["".join(f"{v:15.7E}" for v in reals[i : i + 5]) for i in range(0, 50, 5)]
    lines += ["|comment"]
    words = [f"{v:10.3E}".replace("E-0", "E-").replace("E+0", "E+") for v in VALUES]
    lines += ["".join(word.rjust(10) for word in words[i : i + 8]) for i in range(0, 23, 8)]
    return "\r\n".join(lines) + "\r\n"


def test_smc_is_read_by_columns_of_ten_characters(file: Path) -> None:
    found = read_accelerogram(write(file, smc()))
    assert (found.format, found.time_step, found.name) == ("usgs_smc", 0.005, "Here")
    assert np.allclose(found.acceleration, 0.01 * VALUES, atol=1e-5)
    assert found.warnings == ()


def test_a_declared_peak_that_is_not_there_is_a_warning(file: Path) -> None:
    (warning,) = read_accelerogram(write(file, smc(declared=7.0))).warnings
    assert "declares a peak of 0.07 m/s²" in warning


def test_smc_with_another_count_or_quantity_is_refused(file: Path) -> None:
    assert "columns of 10 characters where" in refused(write(file, smc(count=40)))
    assert "more than the 16 samples" in refused(write(file, smc(count=16)))
    assert "not acceleration" in refused(write(file, smc().replace("2 CORR", "4 CORR")))
