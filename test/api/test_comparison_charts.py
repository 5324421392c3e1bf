"""Charts of controllers side by side show what can be read."""

from __future__ import annotations

import numpy as np

from shake_ros.api.compare import LEAST_SHOWN, amplitudes, spectrum_chart
from shake_ros.control.closed_loop import ClosedLoop

DT = 1e-3


def test_spectra_end_where_the_reference_has_nothing_and_keep_every_line_above() -> None:
    t = np.arange(8000) * DT
    wanted = np.column_stack([np.sin(12.0 * t), 12.0 * np.cos(12.0 * t), 0.0 * t]) * np.exp(-((t - 4.0) ** 2))[:, None]
    found = wanted + 0.01 * np.sin(2.0 * np.pi * 17.0 * t)[:, None]
    chart = spectrum_chart({"law": ClosedLoop(DT, wanted, wanted, found, 0.0 * t, wanted)})
    for column, panel in enumerate(chart.panels):
        reference, law = (series.values for series in panel.series)
        frequency, lines = amplitudes(1e3 * wanted[:, column], DT)
        kept = np.isfinite(reference)
        np.testing.assert_array_equal(kept, lines >= LEAST_SHOWN * lines.max())
        np.testing.assert_array_equal(reference[kept], lines[kept])
        assert not kept[frequency > 10.0].any()
        assert law[np.argmin(np.abs(frequency - 17.0))] > 9.0  # mm, mm/s
