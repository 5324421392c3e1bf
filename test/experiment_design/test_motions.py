"""Motions that a design chooses from: within the limits, from rest to rest, the second half a mirror of the first."""

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid
from scipy.signal import lfilter

from shake_ros.control.reference.motion import Envelope, peaks
from shake_ros.experiment_design.motions import SHAPES, library
from shake_ros.fit.nuisances.glitches import unseen_glitches
from shake_ros.fit.records import Record
from shake_ros.quantities import ShakeError

LIMITS = Envelope(0.05, 0.4, 6.0)
DT = 1e-3


@pytest.mark.parametrize("motion", library(), ids=lambda m: f"{m.name} {m.part}")
def test_a_motion_keeps_the_limits_and_begins_and_ends_at_rest(motion):
    samples = motion.samples(LIMITS, DT)
    used = [most / limit for most, limit in zip(peaks(samples), LIMITS, strict=True)]
    assert max(used) == pytest.approx(motion.part, rel=1e-9)
    assert len(samples) == round(motion.seconds / DT)
    for end in (samples[0], samples[-1]):
        assert np.all(np.abs(end) < 2e-3 * motion.part * np.array(LIMITS))


@pytest.mark.parametrize("motion", library()[::3], ids=lambda m: m.name)
def test_the_second_half_mirrors_the_first(motion):
    position = motion.samples(LIMITS, DT)[:, 0]
    half = len(position) // 2
    assert np.allclose(position[half:], -position[:half])


def test_velocity_and_acceleration_are_the_derivatives_of_the_position():
    for motion in library()[1::3]:
        samples = motion.samples(LIMITS, DT)
        moved = cumulative_trapezoid(samples[:, 1], dx=DT, initial=0.0)
        assert np.max(np.abs(moved - samples[:, 0])) < 0.02 * np.max(np.abs(samples[:, 0])), motion


@pytest.mark.parametrize("rate", [204.8, 500.0])
@pytest.mark.parametrize("overlap", [0.0, 0.02])
@pytest.mark.parametrize("motion", library(), ids=lambda m: f"{m.name} {m.part}")
def test_no_part_of_its_command_passes_for_a_glitch(motion, overlap, rate):
    command = motion.samples(LIMITS, 1.0 / rate)[:, 1] / 0.8
    opened = np.sign(command) * np.maximum(np.abs(command) - overlap, 0.0)
    late = np.exp(-100.0 / rate)
    position = np.cumsum(lfilter([0.8 * (1.0 - late)], [1.0, -late], opened)) / rate
    assert unseen_glitches([Record(motion.name, 1.0 / rate, command, position)]) == [[]]


def test_every_shape_is_in_the_library():
    assert {motion.kind for motion in library()} == set(SHAPES)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("{parts: [1], seconds: 8, motions: {a: {kind: sinus, low: 1}}}", "sinus"),
        ("{parts: [1], seconds: 8, motions: {a: {kind: sweep, low: 2, high: 1}}}", "a: high must be above low"),
        ("{parts: [2], seconds: 8, motions: {a: {kind: sine, low: 1}}}", "a: expected low above 0"),
        ("{parts: [1], motions: {}}", "needs parts, seconds"),
        ("{parts: [1], seconds: 8, motions: {a: {kind: sine, low: 1, phase: 2}}}", "phase"),
    ],
)
def test_a_wrong_library_names_what_is_wrong(tmp_path, text, said):
    path = tmp_path / "mine.yaml"
    path.write_text(text)
    with pytest.raises(ShakeError, match=said):
        library(str(path))
