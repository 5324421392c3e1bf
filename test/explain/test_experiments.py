"""What recordings identify, against problems whose information is known in closed form, and candidate recordings."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from shake_ros.explain.experiments import (
    KINDS,
    Candidate,
    advice,
    benefits,
    catalogue,
    deviations_of,
    drive,
    identifiability,
)
from shake_ros.fit.free_parameters import FreeParameters, free_parameter
from shake_ros.fit.least_squares import Fit
from shake_ros.fit.recording_problem import RecordingProblem
from shake_ros.fit.records import Record
from shake_ros.physics.plant.simulation import run
from shake_ros.quantities import ShakeError
from shake_ros.search.unlisted_functions import NODE_NAMES
from shake_ros.settings import find, load_table, read_yaml

TABLE = load_table("bergamo")
NAMES = ("friction.viscous", "friction.coulomb_level", "leakage.internal")


def made(columns: np.ndarray, noise: float = 1.0) -> Fit:
    free = FreeParameters(TABLE, [free_parameter(n, {"scale": TABLE.value(n) / 2.0}, "here") for n in NAMES])
    residuals = noise * np.random.default_rng(1).standard_normal(len(columns))
    residuals -= columns @ np.linalg.lstsq(columns, residuals, rcond=None)[0]
    return Fit(free, free.start(), residuals, columns, 0.5 * float(residuals @ residuals), 1)


def columns(rows: int = 6000) -> np.ndarray:
    return np.random.default_rng(2).standard_normal((rows, 3))


def blocks(rows: int = 6000) -> np.ndarray:
    return np.arange(rows) // 60


def test_deviations_are_those_of_linear_regression_in_parts_of_the_parameters() -> None:
    c = columns()
    known = identifiability(made(c), blocks())
    closed = np.sqrt(np.diag(np.linalg.inv(c.T @ c))) / 2.0  # each value is two of its scales
    assert known.deviations == pytest.approx(closed, rel=0.15)
    assert known.left_open == ()
    assert "identify all 3 parameters" in known.text


def test_two_parameters_that_only_act_together_are_named_as_a_combination() -> None:
    c = columns()
    c[:, 1] = c[:, 0]
    known = identifiability(made(c), blocks())
    assert len(known.left_open) == 1
    weights = known.left_open[0].weights
    assert set(weights) == {NAMES[0], NAMES[1]}
    assert weights[NAMES[0]] == pytest.approx(-weights[NAMES[1]])
    assert f"do not identify {NAMES[0]} with {NAMES[1]}" in known.text or "do not identify" in known.text


def test_a_combination_of_many_small_weights_has_a_name() -> None:
    names = (*NODE_NAMES, "valve.flow_coefficient")  # a function's level and the gain that it multiplies
    scales = {name: abs(TABLE.value(name)) or 0.05 for name in names}
    free = FreeParameters(TABLE, [free_parameter(n, {"scale": scale}, "here") for n, scale in scales.items()])
    rng, even = np.random.default_rng(4), np.full((17, 17), 1.0 / 17.0)
    c = rng.standard_normal((6000, 17)) @ (np.eye(17) - even)
    known = identifiability(Fit(free, free.start(), rng.standard_normal(6000), c, 3000.0, 1), blocks())
    (left_open,) = known.left_open
    assert set(left_open.weights) == set(names)
    assert f"with {len(names) - 4} more" in known.text


def test_a_parameter_without_effect_is_not_identified() -> None:
    c = columns()
    c[:, 2] = 0.0
    known = identifiability(made(c), blocks())
    assert [set(o.weights) for o in known.left_open] == [{NAMES[2]}]
    assert known.weakest == 2


def test_pairs_above_the_limit_are_told_with_their_correlation() -> None:
    c = columns()
    c[:, 1] = c[:, 0] + 0.1 * c[:, 1]
    ((a, b, value),) = identifiability(made(c), blocks()).pairs
    assert {a, b} == {NAMES[0], NAMES[1]}
    assert value < -0.97


def test_residuals_above_the_noise_widen_the_deviations() -> None:
    quiet, loud = (identifiability(made(columns(), noise), blocks()) for noise in (1.0, 3.0))
    assert loud.deviations == pytest.approx(3.0 * quiet.deviations, rel=1e-6)


def test_deviations_of_a_diagonal_information_are_its_inverse_roots() -> None:
    assert deviations_of(np.diag([4.0, 25.0])) == pytest.approx([0.5, 0.2])


def test_catalogue_of_the_configuration_is_read_and_drives_within_its_amplitudes() -> None:
    path = find("experiment", "catalogue")
    found = catalogue(read_yaml(path), str(path))
    assert {c.kind for c in found} == set(KINDS)
    for candidate in found:
        wave = drive(candidate, 4000, 1e-3)
        assert np.max(np.abs(wave)) == pytest.approx(candidate.amplitude, abs=1e-12)


@pytest.mark.parametrize(
    ("content", "text"),
    [
        ({"kind": "sinus"}, "did you mean 'sine'"),
        ({"kind": "sine", "amplitud": 1.0}, "did you mean 'amplitude'"),
        ({"kind": "sine", "low": "fast"}, "expected numbers"),
    ],
)
def test_wrong_candidate_is_an_error_that_names_the_file(content: dict, text: str) -> None:
    with pytest.raises(ShakeError, match=r"list\.yaml: mine") as caught:
        catalogue({"mine": content}, "list.yaml")
    assert text in str(caught.value)


def test_a_fast_recording_is_advised_where_only_a_table_at_rest_was_recorded() -> None:
    names = ("bulk_modulus.modulus", "friction.viscous")
    free = FreeParameters(TABLE, [free_parameter(n, {"scale": TABLE.value(n)}, "here") for n in names])
    command = 0.01 * np.sin(2.0 * np.pi * 0.5 * np.arange(2000) * 1e-3)
    out = run(TABLE, command, 1e-3)
    rng = np.random.default_rng(3)
    noisy = [out[:, c] + s * rng.standard_normal(2000) for c, s in ((0, 8e-6), (2, 0.05))]
    record = Record("slow", 1e-3, command, noisy[0], noisy[1])
    problem = RecordingProblem([record])
    x = free.start()
    r = problem.residuals(free.vectors(x))[0]
    step = 0.01
    j = ((problem.residuals(free.vectors(x + step * np.eye(2))) - r) / step).T
    known = identifiability(Fit(free, x, r, j, 0.5 * float(r @ r), 3), problem.blocks())
    candidates = (Candidate("rest", "standstill", 0.0), Candidate("lively", "multisine", 0.5, 1.0, 12.0))
    found = benefits(Fit(free, x, r, j, 0.0, 3), known, [record], candidates)
    assert [b.candidate.name for b in found] == ["lively", "rest"]
    assert np.all(found[0].deviations < known.deviations)
    assert "lively" in advice(known, found)


def test_advice_names_what_gains_where_nothing_tells_what_is_known_least() -> None:
    known: Any = SimpleNamespace(weakest=0, names=("a", "b", "c"), deviations=np.array([1.0, 0.4, 0.2]))
    found: Any = [SimpleNamespace(candidate=SimpleNamespace(name="pulses"), deviations=np.array([1.0, 0.39, 0.05]))]
    assert advice(known, found) == "the most helpful further recording is pulses: c from ± 20 % to ± 5 %"
    found[0].deviations[0] = 0.5
    assert advice(known, found) == "the most helpful further recording is pulses: a from not known to ± 50 %"
