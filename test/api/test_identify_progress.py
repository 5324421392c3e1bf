"""Whoever asks to be told of the progress of a fit is told."""

from __future__ import annotations

import numpy as np

import shake_ros as sr


def test_a_function_is_called_with_a_fit_by_free_runs() -> None:
    time, told = np.arange(1500) / 1000, list[str]()
    rng = np.random.default_rng(0)
    force, position = 100 * np.sin(9 * time), -np.sin(9 * time) / 8.1 + 1e-6 * rng.standard_normal(len(time))
    runs = sr.recording("push", time, 0 * time, position, force=force)
    sr.identify(sr.model("axis"), runs, progress=lambda text, part: told.append(text))
    assert "fitting the declared model" in told
    assert told[-1] == "residuals and what would help"
