"""Describing functions and the oil spring as they are drawn."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("matplotlib")

from shake_ros.settings import load_table
from shake_ros.thesis.figures import describing_functions, oil_spring


def test_drawn_describing_functions_part_from_the_linear_table_only_where_it_is_none() -> None:
    gain, phase = describing_functions().axes
    linear, *sines = gain.lines
    at_low = [line.get_ydata()[0] for line in sines]
    assert at_low[1] == pytest.approx(linear.get_ydata()[0], rel=0.06)  # 10 %, 1 Hz: the velocity gain
    peaks = [float(np.max(line.get_ydata())) for line in sines]
    assert peaks[0] > 1.2 * peaks[-1]  # a larger amplitude damps the oil column more
    assert all(np.all(np.diff(line.get_ydata()) < 30.0) for line in phase.lines)


def test_oil_column_is_softest_in_mid_stroke_and_the_poles_agree() -> None:
    lines = oil_spring().axes[0].lines
    table = load_table("bergamo")
    for closed, poles in zip(lines[::2], lines[1::2], strict=True):
        frequency = closed.get_ydata()
        assert int(np.argmin(frequency)) == len(frequency) // 2
        np.testing.assert_allclose(poles.get_ydata(), frequency, rtol=0.03)  # a moving table opens its chambers
        assert poles.get_ydata()[len(frequency) // 2] == pytest.approx(min(frequency), rel=5e-3)
    b, modulus = table.body, table.value("bulk_modulus.modulus")
    middle = np.sqrt(4.0 * modulus * b.piston_area**2 / (b.cylinder_volume * 650.0)) / (2.0 * np.pi)
    assert lines[2].get_ydata()[len(lines[2].get_ydata()) // 2] == pytest.approx(middle, rel=1e-3)
