"""A predictor on a table that the package did not simulate: where a segment begins, and the levels of noise."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hidden_table import SAMPLE_TIME, TRUE, record

from shake_ros.declared import free_parameters
from shake_ros.fit import prediction
from shake_ros.fit.likelihood import Levels
from shake_ros.fit.model import start_of
from shake_ros.fit.prediction import Predictor, between
from shake_ros.fit.records import Record
from shake_ros.fit.segment import Segment
from shake_ros.physics.plant.simulation import run
from shake_ros.settings import load_table

TABLE = load_table("bergamo").with_values({"body.specimen_mass": 200.0, **TRUE})
VECTOR = start_of(TABLE, free_parameters()).vectors(start_of(TABLE, free_parameters()).x)[0]
LOOSE = Levels(force=0.3)


@pytest.fixture(scope="module")
def within() -> Segment:
    """A segment that begins in full motion."""
    made = record(1, 4.0)
    whole = Record("run", SAMPLE_TIME, made.commands, made.position, made.acceleration)
    begin = 500 + int(np.argmax(np.abs(whole.acceleration[500:2000])))  # type: ignore[index]
    return Segment.of(whole.part(slice(begin, begin + 2000)))


def test_a_segment_that_begins_in_full_motion_is_followed_from_its_first_samples(within: Segment) -> None:
    (filtered,) = Predictor([within], LOOSE).filtered(VECTOR).runs
    white = np.sum(filtered.whitening[:, 1] * filtered.innovations, axis=1)
    first = float(np.sqrt(np.mean(white[:100] ** 2)))
    later = float(np.sqrt(np.mean(white[1000:] ** 2)))
    print(
        f"whitened innovations of the acceleration: {first:.2f} in the first 0.1 s, {later:.2f} after the first second"
    )
    assert first < 5.0 * later


def test_a_likelihood_does_not_depend_on_the_tolerance_of_its_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(3)
    commands = record(1, 2.0).commands
    commands = commands + 0.1 * rng.standard_normal(len(commands))  # as from a controller that acts on noise
    table = load_table("bergamo")
    made = run(table, commands, SAMPLE_TIME)
    noise = rng.standard_normal((2, len(made)))
    measured = made[:, 0] + 1e-5 * noise[0], made[:, 2] + 0.05 * noise[1]
    segment = Segment.of(Record("run", SAMPLE_TIME, commands, *measured))
    start = start_of(table, free_parameters())

    def likelihood() -> float:
        found = Predictor([segment], Levels(force=1e-3)).filtered(start.vectors(start.x)[0])
        return float(np.sum(found.log_likelihood()))

    found = likelihood()
    monkeypatch.setattr(prediction, "TOLERANCE", 1e-10)
    exact = likelihood()
    print(f"log likelihood: {found:.2f}, {exact:.2f} from runs of tolerance 1e-10")
    assert abs(found - exact) < 1.0


class Misleading:
    """A predictor whose path foresees the best force at 0.01, where in truth its runs are lost below 0.05."""

    def __init__(self, levels: Levels) -> None:
        self.levels = levels

    def filtered(self, _vector: np.ndarray) -> Misleading:
        return self

    def centred(self, _vector: np.ndarray) -> Misleading:
        return self

    def with_levels(self, levels: Levels) -> Misleading:
        return Misleading(levels)

    def relevelled(self, _vector: np.ndarray, levels: Levels) -> float:
        return -100.0 * math.log(levels.force / 0.01) ** 2

    def log_likelihood(self) -> np.ndarray:
        force = self.levels.force
        return np.array([-100.0 * math.log(force / 0.08) ** 2 if force > 0.05 else -1e9])


def test_levels_of_noise_go_only_so_far_as_the_filter_follows() -> None:
    predictor: Any = Misleading(LOOSE)
    found = Predictor.tuned(predictor, VECTOR, ("force",))
    assert 0.05 < found.levels.force < 0.15


def test_levels_between_two_are_so_on_a_logarithmic_scale() -> None:
    half = between(Levels(force=1.0), Levels(force=0.01), 0.5)
    assert half.force == pytest.approx(0.1)
    assert half.memory == Levels().memory
