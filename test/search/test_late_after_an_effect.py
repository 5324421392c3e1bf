"""Once a specimen is added, friction near rest explains the residual, and no further effect is tried."""

from __future__ import annotations

import numpy as np
from hidden_table import SAMPLE_TIME, Hidden, record

import shake_ros as sr


def recorded(name: str, seed: int, seconds: float) -> sr.Recordings:
    made = record(seed, seconds, Hidden(flexible_mass=150.0, flexible_damping=0.05))
    time = SAMPLE_TIME * np.arange(len(made.commands))
    return sr.recording(name, time, made.commands, made.position, acceleration=made.acceleration)


def test_search_ends_with_the_specimen_and_the_late_parameter() -> None:
    lines = list[str]()
    found = sr.close_loop(
        sr.model("full"),
        recorded("estimation", 1, 6.0),
        recorded("validation", 2, 4.0),
        progress=lambda text, part: lines.append(text),
    )
    assert found.effects.names == ("specimen_resonance",)
    assert "friction.transition_velocity" in {p.name for p in found.final.parameters}
    assert not found.remaining.above_noise
    assert "screening" not in lines
