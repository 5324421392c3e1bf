"""A fit by prediction errors: the parameters of a table that the package did not simulate."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from hidden_table import SAMPLE_TIME, TRUE, Hidden, record

from shake_ros.declared import free_parameters
from shake_ros.fit.free_parameters import FreeParameter
from shake_ros.fit.likelihood import Levels, Likelihood
from shake_ros.fit.model import FreeModel, start_of
from shake_ros.fit.prediction import Predictor
from shake_ros.fit.records import Record
from shake_ros.fit.segment import Segment, pieces
from shake_ros.fit.solver import Budget, descend, fit
from shake_ros.physics.plant.parameters import FULL_LAYOUT
from shake_ros.settings import load_table

LEVELS = Levels(force=3.0, null_drift=1e-6, bias=1e-6, bias_drift=1e-7)


def run(seed: int, hidden: Hidden | None = None, seconds: float = 5.0) -> Record:
    made = record(seed, seconds, hidden)
    return Record(f"run{seed}", SAMPLE_TIME, made.commands, made.position, made.acceleration)


def declared() -> FreeModel:
    table = load_table("bergamo").with_values({"body.specimen_mass": 200.0})
    return start_of(table, (*free_parameters(), *free_parameters(late=True)))


def test_fit_from_the_catalogue_finds_the_table_and_that_nothing_but_noise_is_left() -> None:
    found = fit([Predictor([Segment.of(run(1))], LEVELS)], declared(), Budget())
    for name in ("bulk_modulus.modulus", "valve.flow_coefficient"):
        assert found.model.value(name) == pytest.approx(TRUE[name], rel=0.01)
    for name in ("friction.coulomb_level", "friction.stribeck_rise", "friction.viscous"):
        assert found.model.value(name) == pytest.approx(TRUE[name], rel=0.15)
    assert found.prediction.levels.force < 0.01
    assert found.prediction.levels.acceleration == pytest.approx(1.0, abs=0.1)


def test_force_that_no_parameter_explains_is_counted_as_process_noise() -> None:
    found = fit([Predictor([Segment.of(run(1, Hidden(flexible_mass=120.0)))], LEVELS)], declared(), Budget())
    assert found.prediction.levels.force > 0.02


def test_a_fit_finds_the_null_shift_of_each_segment_with_the_parameters() -> None:
    shifts = 4e-3, -6e-3
    segments = [Segment.of(run(seed)).shifted(-shift) for seed, shift in zip((1, 2), shifts, strict=True)]
    found = fit([Predictor(segments, replace(LEVELS, null=0.01))], declared(), Budget())
    assert isinstance(found.prediction, Predictor)
    moved = [f.commands[0] - s.commands[0] for f, s in zip(found.prediction.segments, segments, strict=True)]
    print("null shifts:", *(f"{m:.2e}" for m in moved))
    assert moved == pytest.approx(shifts, abs=2e-4)
    assert found.model.value("valve.flow_coefficient") == pytest.approx(TRUE["valve.flow_coefficient"], rel=0.01)
    assert found.prediction.levels.force < 0.01


class TwoValleys(Likelihood):
    """One parameter; under loose levels it is drawn to twice its first value, under tight ones to a likelier half."""

    own_levels = ()
    difference = 1e-6

    def __init__(self, begin: float, levels: Levels, at: float = math.nan) -> None:
        self.begin, self.levels, self.at = begin, levels, at
        self.loose = levels.force > 1.0

    def with_levels(self, levels: Levels) -> TwoValleys:
        return TwoValleys(self.begin, levels)

    def filtered(self, vector: np.ndarray) -> TwoValleys:
        return TwoValleys(self.begin, self.levels, vector[FULL_LAYOUT.index["body.stroke"]] / self.begin)

    def tuned(self, vector: np.ndarray, names: Sequence[str]) -> TwoValleys:
        return self.filtered(vector)

    def part(self, seconds: float) -> TwoValleys:
        return self

    def residuals(self, vectors: np.ndarray) -> np.ndarray:
        parts = vectors[:, [FULL_LAYOUT.index["body.stroke"]]] / self.begin
        return 10.0 * (parts - 2.0) if self.loose else 100.0 * (parts - 0.5)

    def log_likelihood(self) -> np.ndarray:
        return np.array([-50.0 - 10.0 * (self.at - 2.0) ** 2 if self.loose else -1e3 * (self.at - 0.5) ** 2])

    @property
    def count(self) -> int:
        return 1

    def run_sizes(self) -> list[int]:
        return [1]


def test_fit_goes_on_from_the_levels_that_lead_to_the_likelier_model_not_those_that_are_likelier_at_its_start() -> None:
    table = load_table("bergamo")
    begin = table.value("body.stroke")
    model = start_of(table, [FreeParameter("body.stroke", begin, 0.0, 10.0 * begin, "m")])
    starts = [TwoValleys(begin, Levels(force=force)) for force in (3.0, 0.03)]
    first = [float(s.filtered(model.vectors(model.x)[0]).log_likelihood()[0]) for s in starts]
    assert first[0] > first[1]
    found = fit(starts, model, Budget())
    assert found.model.value("body.stroke") == pytest.approx(0.5 * begin)
    assert found.prediction.levels.force == 0.03


def test_fit_whose_time_is_over_ends_at_once_with_a_model() -> None:
    model = declared()
    found = fit([Predictor([Segment.of(run(1))], LEVELS)], model, Budget(0.0))
    assert np.array_equal(found.model.x, model.x)
    assert np.isfinite(found.total)


def test_descent_under_held_gains_never_leaves_more_than_it_began_with() -> None:
    model = declared()
    prediction = Predictor([Segment.of(run(1, seconds=3.0))], LEVELS).filtered(model.vectors(model.x)[0])
    before = prediction.residuals(model.vectors(model.x))[0]
    found, taken = descend(prediction, model, 2, 1.0, Budget())
    after = prediction.residuals(found.vectors(found.x))[0]
    assert after @ after < before @ before
    assert taken <= 2
    assert np.all((found.x >= model.bounds[0]) & (found.x <= model.bounds[1]))


def test_prior_holds_a_parameter_that_the_recording_does_not_determine() -> None:
    model = declared()
    rows, targets = FreeModel(model.table, model.free, (), model.x, {"leakage.external": (2e-13, 1e-14)}).prior
    x = model.x.copy()
    x[model.names.index("leakage.external")] = 2e-13 / model.scale[model.names.index("leakage.external")]
    assert rows @ x == pytest.approx(targets)


def test_pieces_are_spread_over_every_recording_and_keep_their_place_in_time() -> None:
    runs = [run(1), run(2)]
    found = pieces(runs, 4.0, 1.0)
    assert {r.name for r in found} == {"run1", "run2"}
    assert sum(len(r.commands) for r in found) * SAMPLE_TIME == pytest.approx(4.0, abs=1.0)
    for piece in found:
        whole = next(r for r in runs if r.name == piece.name)
        first = round(piece.begin / SAMPLE_TIME)
        assert np.array_equal(piece.position, whole.position[first : first + len(piece.position)])
    assert pieces(runs, 20.0, 1.0) == runs


def test_delayed_accelerometer_is_read_where_it_was_later() -> None:
    whole = run(1, seconds=2.0)
    piece = Segment.of(whole)
    felt = piece.measured(0.003)[:, 1]
    assert felt[100:200] == pytest.approx(piece.acceleration[103:203], abs=1e-9)
    assert np.isnan(felt[-3:]).all()


def test_a_value_at_its_bound_stays_within_it_in_the_table_whatever_its_scale_rounds() -> None:
    table = load_table("bergamo")
    for scale in np.linspace(0.3, 0.7, 40):
        model = start_of(table, [FreeParameter("valve.damping", float(scale), 0.05, 5.0, "-")])
        assert model.at(np.zeros(1)).found_table().value("valve.damping") == pytest.approx(0.05)
