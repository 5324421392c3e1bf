"""spectrum from its command line: several dampings, a file of columns, refusals."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from shake_ros.__main__ import main
from shake_ros.data.recordings import write_table_recording


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
    assert main([*given, "--out", str(out)]) == 0
    told = capsys.readouterr().out
    assert "2 % [m/s²]" in told
    assert "5 % [m/s²]" in told
    columns = np.loadtxt(out, delimiter=",", skiprows=1)
    np.testing.assert_allclose(columns[:, 0], [0.5, 1.0, 2.0, 4.0, 8.0])
    for column, damping in ((1, 0.02), (2, 0.05)):
        resonance = np.sqrt(1.0 + 4.0 * damping**2) / (2.0 * damping)
        growth = 1.0 - np.exp(-damping * 2.0 * np.pi * 2.0 * 20.0)  # 20 s are 40 periods
        assert columns[2, column] == pytest.approx(resonance * growth, rel=0.01)
    assert main([*given, "--out", str(out)]) == 2
    assert "exists already" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--damping", "0"], "damping = 0 is not between 0 and 1"),
        (["--high", "95"], "does not rise from above 0 to at most 90 Hz"),
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
