"""Process noise shows in equal commands of tables of another simulator, and nowhere else; predictor runs know more."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.discovery import hidden_tables as hidden
from shake_ros.declared import MODELS, model_structure
from shake_ros.fit.nuisances.equal_commands import FreeAndPredictor, process_noise
from shake_ros.fit.recording_problem import RecordingProblem
from shake_ros.fit.records import Record
from shake_ros.settings import load_search, load_table

LEAST = load_search().near_noise ** 2
STRUCTURE = model_structure(load_table("bergamo"))


def problem(
    seed: int, excitation: str = "learn_multisine", **hidden_effect: float
) -> tuple[RecordingProblem, np.ndarray]:
    """A recording of a table, and the parameters of the declared model that are true of it."""
    truth = hidden.declared_truth(seed)._replace(**hidden_effect)
    made = hidden.record(truth, hidden.excitations(seed)[excitation], 1.0, np.random.default_rng(seed))
    record = Record(excitation, hidden.SAMPLE, made["command"], made["position"], made["acceleration"])
    values = {name: getattr(truth, field) for name, field in hidden.DECLARED.items()}
    return RecordingProblem([record]), STRUCTURE.table.with_values(values).vector()


@pytest.mark.parametrize("effect", [{}, {"spool_deadband": 0.02}, {"specimen_resonance": 200.0}])
def test_neither_sensor_noise_nor_a_missing_effect_is_process_noise(effect: dict[str, float]) -> None:
    p, true = problem(1, **effect)
    assert process_noise([p], true, LEAST) is None


def test_a_random_force_shows_the_more_the_larger_it_is() -> None:
    made = [problem(1, rumble=force) for force in (60.0, 120.0)]
    small, large = (process_noise([p], true, LEAST) for p, true in made)
    assert small is not None and large is not None
    # with the square of the force, less what of it is white and counts as noise of the accelerometer
    assert 2.5 < (large - 1.0) / (small - 1.0) < 4.0


def test_without_equal_commands_nothing_is_said() -> None:
    p, true = problem(1, "hold_pulses", rumble=120.0)
    assert process_noise([p], true, LEAST) is None


def test_a_model_without_a_predictor_uses_free_runs_alone() -> None:
    p, true = problem(1, rumble=120.0)
    assert process_noise([RecordingProblem(p.records, MODELS["reduced"])], true, LEAST) is None


def test_both_voices_are_weighed_by_their_independent_samples() -> None:
    p, true = problem(1, rumble=120.0)
    both = FreeAndPredictor(p, 40.0, true)
    free, predictor = np.split(both.residuals(true[None, :])[0], 2)
    assert np.mean(predictor**2) > 2.0 * np.mean(free**2)  # a free run's errors last longer
    assert both.weights[1] > both.weights[0]


def test_the_noise_that_no_command_tells_raises_what_a_model_may_leave() -> None:
    p, _ = problem(1)
    assert p.unpredicted(4.0).noise_cost() == pytest.approx(4.0 * p.noise_cost())
    assert p.noise_cost() == problem(1)[0].noise_cost()
