"""Real files against what their distributors say of them."""

from __future__ import annotations

import random
from pathlib import Path

import numpy as np
import pytest

from shake_ros.control.reference.baseline import integrate
from shake_ros.quantities import ShakeError
from shake_ros.recordings.accelerograms import read_accelerogram

FILES = {
    "LomaPrieta1989_SFShafter_0111a.smc": ("usgs_smc", 6001, 0.005, 1.044),
    "Whittier1987_Alhambra_0165b_a.smc": ("usgs_smc", 6014, 0.005, 2.745),
    "Coalinga1983_ParkfieldFZ14_CE36456.V2": ("cdmg_v2", 3251, 0.020, 2.67957),
    "Anchorage2018_AKBMR_BNZ.V2c": ("cosmos_v2", 42000, 0.005, 0.06852),
}


@pytest.fixture
def folder(shared: Path) -> Path:
    found = shared / "data" / "strong_motion"
    if not found.is_dir():
        pytest.skip("needs ../shared/data/strong_motion, which is not here")
    return found


@pytest.mark.parametrize("name", FILES)
def test_count_step_and_peak_are_those_of_the_distributor(folder: Path, name: str) -> None:
    form, count, step, peak = FILES[name]
    found = read_accelerogram(folder / name, channel=1)
    assert (found.format, found.acceleration.size, found.unit) == (form, count, "cm/s2")
    assert found.time_step == pytest.approx(step)
    assert found.peak == pytest.approx(peak, rel=5e-4)
    assert found.warnings == ()


@pytest.mark.parametrize(("channel", "peak"), [(1, 2.67957), (2, 0.94805), (3, 2.56231)])
def test_each_channel_of_the_v2_file_can_be_chosen(folder: Path, channel: int, peak: float) -> None:
    found = read_accelerogram(folder / "Coalinga1983_ParkfieldFZ14_CE36456.V2", channel=channel)
    assert found.peak == pytest.approx(peak, rel=1e-4)
    assert f"CHAN {channel}" in found.name


def test_integrals_agree_with_the_velocity_and_displacement_that_the_agency_computed(folder: Path) -> None:
    found = read_accelerogram(folder / "Coalinga1983_ParkfieldFZ14_CE36456.V2", channel=1)
    velocity, displacement = integrate(found.acceleration, found.time_step)
    assert np.max(np.abs(velocity)) == pytest.approx(0.28253, rel=0.01)
    assert np.max(np.abs(displacement)) == pytest.approx(0.05449, rel=0.05)
    assert np.argmax(np.abs(velocity)) * found.time_step == pytest.approx(11.10, abs=0.021)


def test_a_channel_that_is_not_there_is_refused(folder: Path) -> None:
    with pytest.raises(ShakeError, match="channel 4 of a file that holds 3"):
        read_accelerogram(folder / "Coalinga1983_ParkfieldFZ14_CE36456.V2", channel=4)
    with pytest.raises(ShakeError, match="channel 2 of a file that holds 1"):
        read_accelerogram(folder / "LomaPrieta1989_SFShafter_0111a.smc", channel=2)


def test_another_unit_than_the_file_names_is_refused(folder: Path) -> None:
    with pytest.raises(ShakeError, match="the file is in cm/s2, not in g"):
        read_accelerogram(folder / "LomaPrieta1989_SFShafter_0111a.smc", unit="g")


@pytest.mark.parametrize("name", FILES)
def test_a_file_cut_anywhere_is_refused_with_its_name_and_line(folder: Path, tmp_path: Path, name: str) -> None:
    raw = (folder / name).read_bytes()
    path = tmp_path / "cut"
    first_channel = raw.find(b"POINTS OF VELOC") if name.endswith(".V2") else len(raw) - 40
    for share in (0.001, 0.02, 0.05, 0.3, 0.7, 0.99):
        path.write_bytes(raw[: int(share * first_channel)])
        with pytest.raises(ShakeError) as error:
            read_accelerogram(path)
        assert str(error.value).startswith(str(path))


@pytest.mark.parametrize("name", FILES)
def test_damage_never_escapes_as_anything_but_one_clear_line(folder: Path, tmp_path: Path, name: str) -> None:
    raw = (folder / name).read_bytes()
    chance = random.Random(name)
    path = tmp_path / "damaged"
    messages = []
    for _ in range(60):
        damaged = bytearray(raw)
        place = chance.randrange(5000)
        kind = chance.randrange(4)
        if kind == 0:
            damaged[place] = chance.randrange(256)
        elif kind == 1:
            del damaged[place : place + chance.randrange(1, 200)]
        elif kind == 2:
            damaged[place:place] = bytes(chance.randrange(32, 127) for _ in range(chance.randrange(1, 30)))
        else:
            damaged[place : place + 3] = b"nan"
        path.write_bytes(damaged)
        try:
            found = read_accelerogram(path)
            assert np.all(np.isfinite(found.acceleration))
        except ShakeError as error:
            messages.append(str(error))
    assert len(messages) > 5
    assert all(message.startswith(str(path)) and "\n" not in message for message in messages)
