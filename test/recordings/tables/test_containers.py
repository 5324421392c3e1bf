"""Tables that are no text: .xlsx, .tdms, .mat of both kinds; and what is said where a library is not installed."""

from __future__ import annotations

import builtins
import importlib
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from shake_ros.quantities import ShakeError
from shake_ros.recordings.accelerograms import read_accelerogram
from shake_ros.recordings.tables.table import Column, read_table

TIME = np.arange(300) / 100.0
DRIVE = np.sin(TIME)
PLACE = 20.0 * np.cos(TIME)
WANTED = {"time": "time", "command": "command", "position": "position"}


def write_xlsx(file: Path) -> None:
    book = pytest.importorskip("openpyxl").Workbook()
    book.active.append(["About this file"])
    sheet = book.create_sheet("Data")
    sheet.append(["Rig 3"])
    sheet.append(["Time", "Valve", "Disp"])
    sheet.append(["s", "V", "mm"])
    for row in zip(TIME.tolist(), DRIVE.tolist(), PLACE.tolist(), strict=True):
        sheet.append(row)
    book.save(file)


def write_tdms(file: Path) -> None:
    nptdms = pytest.importorskip("nptdms")
    with nptdms.TdmsWriter(file) as writer:
        about = {"wf_increment": 0.01, "wf_start_offset": 0.0}
        writer.write_segment(
            [
                nptdms.ChannelObject("rig", "Valve", DRIVE, {**about, "unit_string": "V"}),
                nptdms.ChannelObject("rig", "Disp", PLACE, {**about, "unit_string": "mm"}),
            ]
        )


def write_mat(file: Path) -> None:
    savemat(file, {"Time": TIME[:, None], "Valve": DRIVE[None, :], "Disp_mm": PLACE, "k": 3.0, "text": "x"})


def write_hdf(file: Path) -> None:
    with pytest.importorskip("h5py").File(file, "w", userblock_size=512) as content:
        for name, values in (("Time", TIME), ("Valve", DRIVE), ("Disp_mm", PLACE)):
            content[name] = values[None, :]
    raw = bytearray(file.read_bytes())
    raw[:14] = b"MATLAB 7.3 MAT"
    file.write_bytes(bytes(raw))


WRITERS = {"run.xlsx": write_xlsx, "run.tdms": write_tdms, "run.mat": write_mat, "v73.mat": write_hdf}


@pytest.mark.parametrize("name", WRITERS)
def test_the_columns_come_in_si_units(tmp_path: Path, name: str) -> None:
    WRITERS[name](tmp_path / name)
    disp = "Disp_mm" if name.endswith(".mat") else "Disp"
    columns = {"time": Column("time"), "command": Column("Valve"), "position": Column(disp)}
    found = read_table(tmp_path / name).signals(columns, WANTED)
    assert np.allclose(found["time"].values, TIME, rtol=1e-14)
    assert np.allclose(found["command"].values, DRIVE, rtol=1e-14)
    assert np.allclose(found["position"].values, 1e-3 * PLACE, rtol=1e-14)


def test_an_accelerogram_may_stand_in_a_workbook(tmp_path: Path) -> None:
    book = pytest.importorskip("openpyxl").Workbook()
    book.active.append(["Time [ms]", "Acc [mg]"])
    for k, value in enumerate(DRIVE.tolist()):
        book.active.append([10 * k, 1000.0 * value])
    book.save(tmp_path / "record.xlsx")
    found = read_accelerogram(tmp_path / "record.xlsx")
    assert found.time_step == pytest.approx(0.01)
    assert np.allclose(found.acceleration, 9.80665 * DRIVE, rtol=1e-12)


@pytest.mark.parametrize(
    ("name", "package", "remedy"),
    [
        ("run.xlsx", "openpyxl", "is an Excel file .*: save it as CSV, or install openpyxl"),
        ("run.tdms", "nptdms", "is a National Instruments TDMS file: export it as text, or install npTDMS"),
        ("v73.mat", "h5py", "save it with -v7, or install h5py"),
    ],
)
def test_without_its_library_a_line_says_what_to_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, package: str, remedy: str
) -> None:
    WRITERS[name](tmp_path / name)
    real = importlib.import_module

    def absent(wanted: str, *rest: object) -> object:
        if wanted == package:
            raise builtins.ImportError(wanted)
        return real(wanted, *rest)  # type: ignore[arg-type]

    monkeypatch.setattr(importlib, "import_module", absent)
    with pytest.raises(ShakeError, match=remedy):
        read_table(tmp_path / name)


@pytest.mark.parametrize(
    ("place", "text"), [("k", "'k' of shape"), ("text", "'text' of shape"), ("tt", "unknown column")]
)
def test_a_wrong_variable_is_refused_with_its_name(tmp_path: Path, place: str, text: str) -> None:
    write_mat(tmp_path / "run.mat")
    table = read_table(tmp_path / "run.mat")
    with pytest.raises(ShakeError, match=text):
        table.read([table.place(place)])


def test_a_file_that_is_none_is_refused(tmp_path: Path) -> None:
    (tmp_path / "text.mat").write_text("nothing of the kind, but long enough to have a header " * 10)
    for name in ("text.mat", "absent.mat"):
        with pytest.raises(ShakeError, match=name):
            read_table(tmp_path / name)
    for name, kind in (("cut.xlsx", "Excel"), ("cut.tdms", "TDMS"), ("v73.mat", "HDF5")):
        WRITERS.get(name.replace("cut", "run"), write_hdf)(tmp_path / name)
        (tmp_path / name).write_bytes((tmp_path / name).read_bytes()[:60])
        with pytest.raises(ShakeError, match=f"{name}: (is not a readable {kind} file|holds no columns)"):
            read_table(tmp_path / name)
