"""Files as other people's loggers and networks write them, with the values that are right."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from shake_ros.api.import_csv import import_csv
from shake_ros.quantities import ShakeError
from shake_ros.recordings.accelerograms import read_accelerogram
from shake_ros.recordings.bags import TableRecording

G_PEAK = 0.2 * 9.80665


@pytest.fixture
def folder(shared: Path) -> Path:
    found = shared / "data" / "files_of_others"
    if not found.is_dir():
        pytest.skip("needs ../shared/data/files_of_others, which is not here")
    return found


def imported(file: Path, tmp_path: Path, **columns: object) -> TableRecording:
    return import_csv(file, tmp_path / "bag", **columns)  # type: ignore[arg-type]


@pytest.mark.parametrize("name", ["CE99999.V2", "as_of_1985.V2"])
@pytest.mark.parametrize(("channel", "peak"), [(1, 0.823), (2, 0.401), (3, 1.201)])
def test_volume_2_of_csmip_is_read_as_of_1985_and_as_of_today(folder, name, channel, peak):
    found = read_accelerogram(folder / "01-csmip-v2-in-cm-sec2" / name, channel=channel)
    assert found.peak == pytest.approx(peak, abs=5e-4)
    assert (found.time_step, found.unit, found.warnings) == (0.01, "cm/s2", ())


def test_three_components_ask_which(folder):
    with pytest.raises(ShakeError, match=r"3 components; choose one with --channel \(1: Chan 1: 90, 2: Chan 2: Up"):
        read_accelerogram(folder / "01-csmip-v2-in-cm-sec2" / "CE99999.V2")


@pytest.mark.parametrize(("name", "step"), [("ms.csv", 0.001), ("ms_half.csv", 0.0005)])
def test_a_time_in_milliseconds_is_one(folder, name, step):
    found = read_accelerogram(folder / "03-time-in-ms" / name)
    assert found.time_step == pytest.approx(step)
    assert found.peak == pytest.approx(1.929, abs=5e-4)


def test_a_count_of_samples_is_no_time(folder):
    with pytest.raises(ShakeError, match="column 'Sample' counts samples"):
        read_accelerogram(folder / "03-time-in-ms" / "index.csv")


@pytest.mark.parametrize("name", ["milli_g.csv", "inch.csv", "percent_g.csv"])
def test_every_unit_of_acceleration_is_understood(folder, name):
    found = read_accelerogram(folder / "04-two-columns-other-quantity" / name)
    assert found.peak == pytest.approx(1.957, abs=5e-4)
    assert found.warnings == ()


@pytest.mark.parametrize(("name", "what"), [("velocity.csv", "velocity"), ("displacement.csv", "position")])
def test_another_quantity_is_refused_as_an_acceleration(folder, name, what):
    with pytest.raises(ShakeError, match=f"holds {what}, not acceleration"):
        read_accelerogram(folder / "04-two-columns-other-quantity" / name)


def test_a_decimal_comma_in_two_columns_and_in_the_second_file(folder, tmp_path):
    here = folder / "05-decimal-comma-two-columns"
    also = [{"file": here / "imu.csv", "time": "ts", "acceleration": "a"}]
    found = imported(here / "run.csv", tmp_path, time="t", command="u", position="x*0.001", also=also)
    assert np.max(np.abs(found.position)) == pytest.approx(0.02)
    assert np.max(np.abs(found.valve_command)) == pytest.approx(0.5)
    assert found.sample_time == 0.005
    assert np.max(np.abs(found.acceleration)) == pytest.approx(3.955, abs=0.01)
    assert read_accelerogram(here / "imu.csv").peak == pytest.approx(3.95515)


TABLES = {
    "06-quoted-csv/heading.csv": ("Time, s", "Valve, V*0.1", "Disp, mm"),
    "06-quoted-csv/thousands.csv": ("Time", "Valve", "Disp_um"),
    "06-quoted-csv/comma.csv": ("Time", "Valve", "Disp*0.001"),
    "07-units-row-and-trailing-separator/units.csv": ("Time", "Valve", "Disp"),
    "07-units-row-and-trailing-separator/trailing.csv": ("Time", "Valve", "Disp*0.001"),
    "07-units-row-and-trailing-separator/mts.dat": ("Time", "Axial Force*0.001", "Axial Displacement"),
    "07-units-row-and-trailing-separator/bluehill.csv": ("Time", "Load", "Extension"),
    "07-units-row-and-trailing-separator/footer.csv": ("Time", "Valve", "Disp*0.001"),
    "08-encodings/utf16.txt": ("Time", "Valve*0.1", "Disp*1e-6"),
    "08-encodings/latin1.txt": ("Zeit", "Ventil*0.1", "Weg [µm]"),
    "08-encodings/gbk.txt": ("时间", "2*0.1", "位移"),
}


@pytest.mark.parametrize("name", TABLES)
def test_tables_of_loggers_are_read_whole(folder, tmp_path, name):
    time, command, position = TABLES[name]
    found = imported(folder / name, tmp_path, time=time, command=command, position=position)
    expected = np.sin(2.0 * np.pi * np.arange(2000) / 200.0)
    assert found.sample_time == 0.005
    assert found.segments == (slice(0, 2000),)
    assert np.allclose(found.valve_command, 0.3 * expected, atol=6e-5)
    assert np.allclose(found.position, 0.02 * expected, atol=6e-8)
