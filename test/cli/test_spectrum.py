"""spectrum from its command line: several dampings, a file of columns, refusals."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import shake_ros as sr
from shake_ros.__main__ import main
from shake_ros.recordings.bags import write_table_recording


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    """20 s of a sine of 2 Hz, 1 m/s², with an offset of the sensor."""
    time = np.arange(4000) / 200
    still = np.zeros(4000)
    write_table_recording(tmp_path / "bag", time, still, still, 0.3 + np.sin(2.0 * np.pi * 2.0 * time))
    return tmp_path / "bag"


def test_each_damping_has_its_column_and_resonance(bag: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = bag.with_name("spectrum.csv")
    given = ["spectrum", str(bag), "--damping", "0.02", "0.05", "--low", "0.5", "--high", "8", "--per-octave", "1"]
    given += ["--subtract-mean"]
    assert main([*given, "--out", str(out)]) == 0
    told = capsys.readouterr().out
    assert "2 % [m/s²]" in told
    assert "its mean of 0.3 m/s² subtracted" in told
    assert "5 % [m/s²]" in told
    columns = np.loadtxt(out, delimiter=",", skiprows=1)
    np.testing.assert_allclose(columns[:, 0], [0.5, 1.0, 2.0, 4.0, 8.0])
    for column, damping in ((1, 0.02), (2, 0.05)):
        resonance = np.sqrt(1.0 + 4.0 * damping**2) / (2.0 * damping)
        growth = 1.0 - np.exp(-damping * 2.0 * np.pi * 2.0 * 20.0)  # 20 s are 40 periods
        assert columns[2, column] == pytest.approx(resonance * growth, rel=0.01)
    assert main([*given, "--out", str(out)]) == 2
    assert "exists already" in capsys.readouterr().err


def test_a_mean_is_kept_unless_it_is_to_be_taken_off(bag: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """0.3 m/s² from rest overshoot to 0.3 (1 + e^(−πξ/√(1 − ξ²))) at a frequency that the sine does not reach."""
    assert main(["spectrum", str(bag), "--low", "40", "--high", "80", "--per-octave", "1"]) == 0
    assert "its mean of 0.3 m/s² kept (--subtract-mean removes it)" in capsys.readouterr().out
    run = sr.acceleration_spectra(bag, low=40.0, high=80.0, per_octave=1)
    bare = sr.acceleration_spectra(bag, low=40.0, high=80.0, per_octave=1, subtract_mean=True)
    assert run.acceleration[0, -1] == pytest.approx(bare.acceleration[0, -1] + 0.3, rel=0.02)


@pytest.mark.parametrize(
    ("name", "exact"),
    [
        ("half_sine.csv", {0.2: 0.2974, 0.5: 0.7377, 1.0: 1.4343, 2.0: 2.5570, 5.0: 3.2459, 10.0: 2.4235}),
        ("rectangular.csv", {5.0: 0.1056, 10.0: 0.2080, 20.0: 0.3915, 50.0: 0.6134}),
    ],
)
def test_spectra_of_short_pulses_are_exact_by_both_functions(
    shared: Path, name: str, exact: dict[float, float]
) -> None:
    """Values of reference.py beside the files, a matrix exponential with the free vibration behind the record."""
    pulse = shared / "data" / "files_of_others" / "09-spectrum-of-a-pulse" / name
    for f, value in exact.items():
        found = sr.acceleration_spectra(pulse, low=f, high=2.0 * f, per_octave=1).acceleration[0, 0]
        assert found == pytest.approx(value, rel=0.001)
        assert sr.response_spectrum(pulse, [1.0 / f]).acceleration[0] == pytest.approx(value, rel=0.001)


def test_accelerogram_at_100_khz_is_read(tmp_path: Path) -> None:
    """A short pulse on a slow oscillator: ω times its impulse, a quarter of a period and more behind it."""
    time = np.arange(30001) * 1e-5
    pulse = np.where(time < 0.02, 2.0 * np.sin(np.pi * time / 0.02), 0.0)
    file = tmp_path / "pulse.csv"
    np.savetxt(file, np.column_stack([time, pulse]), "%.6f", ",", header="time [s],acceleration [m/s2]", comments="")
    found = sr.response_spectrum(file, [2.0], damping=0.0)
    assert found.acceleration[0] == pytest.approx(np.pi * 2.0 * 0.02 * 2.0 / np.pi, rel=1e-3)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--damping", "1"], "damping = 1 is outside 0 … 1"),
        (["--high", "95", "--band-limited"], "0.45 of that, 90 Hz; asked for 95 Hz"),
        (["--low", "0"], "the band 0 …"),
        (["--per-octave", "0"], "0 frequencies of an octave"),
        (["--out", "spectrum.txt"], "a name that ends in .csv"),
    ],
)
def test_what_is_out_of_range_is_refused_with_one_line(
    bag: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], said: str
) -> None:
    assert main(["spectrum", str(bag), *arguments]) == 2
    err = capsys.readouterr().err
    assert said in err
    assert err.count("\n") == 1


def test_component_of_a_file_that_holds_several_is_chosen(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, time = tmp_path / "three.csv", np.arange(2000) / 200
    rows = [f"{t:.3f},{np.sin(12.0 * t):.6f},{3.0 * np.sin(12.0 * t):.6f}" for t in time]
    path.write_text("Time [s],North [m/s2],East [m/s2]\n" + "\n".join(rows) + "\n", encoding="utf-8")
    given = ["spectrum", str(path), "--low", "1", "--high", "4", "--per-octave", "1"]
    assert main(given) == 2
    assert "--channel" in capsys.readouterr().err
    assert main([*given, "--channel", "2"]) == 0
    assert "peak of the record 3 m/s²" in capsys.readouterr().out
