"""What of a recording lies at the end stops is left out, and said."""

from __future__ import annotations

import numpy as np
import pytest

from shake_ros.fit.records import Record
from shake_ros.fit.start.data_checks import within_stroke
from shake_ros.quantities import ShakeError

STROKE = 0.26


def swinging(offset: float, name: str = "run") -> Record:
    """Ten seconds of a sine of 60 mm about an offset, ended by hard stops [m]."""
    time = np.arange(10000) / 1000.0
    position = np.clip(offset + 0.06 * np.sin(0.4 * np.pi * time), -0.5 * STROKE, 0.5 * STROKE)
    return Record(name, 1e-3, np.cos(0.4 * np.pi * time), position, -position, valid=time < 9.0)


def test_a_recording_within_the_stroke_is_left_as_it_is() -> None:
    record = swinging(0.0)
    found, lines = within_stroke([record], STROKE)
    assert found == [record] and not lines


def test_a_recording_is_parted_at_its_stops() -> None:
    record = swinging(0.1)
    found, lines = within_stroke([record, swinging(0.0, "other")], STROKE)
    assert [r.name for r in found] == ["run", "run", "other"]  # its first 0.8 s are too short
    at = np.abs(record.position) >= 0.498 * STROKE
    for part in found[:2]:
        first = round(part.begin / part.sample_time)
        span = slice(first, first + len(part.commands))
        assert not at[span].any() and np.array_equal(part.position, record.position[span])
        assert np.array_equal(part.whole, record.whole[span])
        assert part.command_before == (record.commands[first - 1] if first else 0.0)
    used = sum(len(p.commands) for p in found[:2])
    assert at.sum() + 400 <= 10000 - used <= at.sum() + 1000
    assert lines == (
        f"run: the position reaches 130.0 mm, the end stop of a stroke of 260 mm; split there; {used / 1000:.1f} of "
        "10.0 s are used",
    )


def test_a_stroke_that_leaves_nothing_is_refused() -> None:
    with pytest.raises(
        ShakeError, match=r"run: the position reaches 160\.0 mm.*0\.0 of 10\.0 s are used.*body\.stroke"
    ):
        within_stroke([Record("run", 1e-3, np.ones(10000), np.full(10000, 0.16))], STROKE)
