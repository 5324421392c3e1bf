"""What kind of thing a force is, on forces that are of one kind by construction."""

from __future__ import annotations

import numpy as np
import pytest

from shake_ros.explain.force_kinds import ForceKinds, degrees_of_freedom, judged_kinds, near_reversal
from shake_ros.settings import load_search

DT = 1e-3
SETTINGS = load_search()
TIME = np.arange(8000) * DT
RNG = np.random.default_rng(1)
WAVES = [(f, RNG.uniform(0.0, 2.0 * np.pi)) for f in np.arange(0.5, 6.0, 0.4)]
POSITION = sum(np.sin(2.0 * np.pi * f * TIME + phase) for f, phase in WAVES) * 0.003
VELOCITY = np.gradient(POSITION, DT)
DEVIATION = np.full(len(TIME), 20.0)


def kinds_of(force: np.ndarray, left: float = 1.0) -> ForceKinds:
    known = {
        "position": POSITION,
        "velocity": VELOCITY,
        "direction": np.sign(VELOCITY),
        "time": TIME,
    }
    smooth = np.convolve(RNG.standard_normal(len(TIME) + 20), np.full(21, 20.0 / np.sqrt(21.0)), "valid")
    return judged_kinds(force + 0.5 * smooth, DEVIATION, left, known, DT, SETTINGS)


def behind_backlash(position: np.ndarray, width: float) -> np.ndarray:
    """What follows a position through backlash."""
    result, held = np.empty_like(position), position[0]
    for k, x in enumerate(position):
        held = min(max(held, x - width), x + width)
        result[k] = held
    return result


NEAR = near_reversal(VELOCITY, DT, 0.02)
KINDS = {
    "constant": np.full(len(TIME), 300.0),
    "slow": 300.0 * np.sin(2.0 * np.pi * 0.2 * TIME),
    "line": 300.0 * np.sin(2.0 * np.pi * 14.0 * TIME),
    "at reversals": 900.0 * NEAR * np.sign(VELOCITY),
    "impulsive": 900.0 * ((TIME % 2.6) < 0.08),
    "memory": 3e4 * behind_backlash(POSITION, 0.004),
}


@pytest.mark.parametrize("kind", KINDS)
def test_force_of_one_kind_is_told_as_that_kind(kind: str) -> None:
    found = kinds_of(KINDS[kind])
    assert not found.zero
    assert kind in found.kinds
    others = set(found.kinds) - {kind}
    assert others <= ({"impulsive"} if kind == "at reversals" else set())


@pytest.mark.parametrize(
    ("name", "force"),
    [
        ("position", -3e4 * POSITION),
        ("velocity", -2e3 * VELOCITY * np.abs(VELOCITY)),
        ("direction", -300.0 * np.sign(VELOCITY)),
    ],
)
def test_force_follows_the_quantity_that_rules_it(name: str, force: np.ndarray) -> None:
    found = kinds_of(force)
    assert next(iter(found.depends_on)) == name
    assert found.depends_on[name] > 0.6
    assert "memory" not in found.kinds


def test_what_noise_leaves_is_zero_and_of_no_kind() -> None:
    found = kinds_of(np.zeros(len(TIME)))
    assert found.zero
    assert found.kinds == ()
    assert found.depends_on == {}
    assert found.text == "is zero within its band"


def test_force_within_its_band_is_not_zero_where_the_run_is_far_above_its_noise() -> None:
    found = kinds_of(20.0 * NEAR * np.sign(VELOCITY), left=7.0)
    assert found.outside < 1.0 - SETTINGS.force_band
    assert not found.zero


def test_force_that_follows_nothing_depends_on_nothing() -> None:
    chance = sum(
        200.0 * np.sin(2.0 * np.pi * f * TIME + phase)
        for f, phase in zip(np.arange(0.7, 9.0, 0.5), np.random.default_rng(5).uniform(0.0, 6.3, 17), strict=True)
    )
    found = kinds_of(chance)
    assert not found.zero
    assert found.depends_on == {}
    assert "has no simple cause" in found.text


def test_line_that_the_table_follows_itself_is_not_the_forces_own() -> None:
    wave = np.sin(2.0 * np.pi * 2.0 * TIME)
    known = {"position": -wave, "velocity": np.cos(2.0 * np.pi * 2.0 * TIME), "direction": np.sign(wave), "time": TIME}
    found = judged_kinds(300.0 * wave, DEVIATION, 5.0, known, DT, SETTINGS)
    assert "line" not in found.kinds


def test_white_noise_has_as_many_degrees_of_freedom_as_samples_to_its_scatter() -> None:
    """A periodogram scatters as its mean: (Σ S)²/Σ S² is half of its lines, each worth two samples."""
    assert degrees_of_freedom(np.random.default_rng(2).standard_normal(8000)) == pytest.approx(4000.0, rel=0.1)
