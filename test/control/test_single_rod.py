"""A table on a cylinder with one rod: feedforward in both directions, model feedforward, and a fit of its areas."""

from __future__ import annotations

import numpy as np
import pytest

from shake_ros.control.closed_loop import Loop, simulate
from shake_ros.control.laws import CONTROLLERS
from shake_ros.control.laws.runner import Controller
from shake_ros.fit.free_parameters import FreeParameter, FreeParameters
from shake_ros.fit.least_squares import fit
from shake_ros.fit.recording_problem import RecordingProblem
from shake_ros.fit.records import Record
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.physics.plant.reduced import closed_form
from shake_ros.physics.plant.simulation import run
from shake_ros.settings import load_table, load_variant

DT, RATIO = 1e-3, 0.6


def single_rod() -> TableParameters:
    volume = (1.0 + RATIO) * load_table("bergamo").body.cylinder_volume / 2.0
    values = {"body.area_ratio": RATIO, "body.volume_share": 1.0 / (1.0 + RATIO), "body.cylinder_volume": volume}
    return load_table("bergamo").with_values(values)


def sine() -> np.ndarray:
    """Position, velocity and acceleration of 20 mm at 2 Hz, begun softly; shape (2000, 3)."""
    t = DT * np.arange(2000)
    w = 4.0 * np.pi
    x = 0.02 * (1.0 - np.exp(-((t / 0.2) ** 3))) * np.sin(w * t)
    v = np.gradient(x, DT)
    return np.column_stack([x, v, np.gradient(v, DT)])


def position_error(controller: Controller) -> float:
    """Root mean square error relative to the reference, with the true states handed to the law [-]."""
    made, samples = simulate(Loop(single_rod(), None, controller, sine()))
    assert samples == 2000
    error = made.truth[500:, 0] - made.reference[500:, 0]
    return float(np.sqrt(np.mean(error**2)) / np.std(made.reference[500:, 0]))


def pi(**changes: float) -> Controller:
    kind, parameters = load_variant("controller", "feedforward_pi", CONTROLLERS)
    found = closed_form(single_rod())
    gains = {"proportional_gain": -3.0, "integral_gain": 0.0, "start_time": 0.0}
    feedforward = -found.beta.beta1 / found.beta.beta3
    return Controller(kind, parameters.replace(feedforward_gain=feedforward, **gains, **changes), DT)


def test_feedforward_that_knows_the_direction_tracks_better() -> None:
    without, known = position_error(pi()), position_error(pi(flow_asymmetry=closed_form(single_rod()).asymmetry))
    assert known < 0.6 * without


def test_equal_areas_leave_the_command_as_it_was() -> None:
    one, other = pi(), pi(flow_asymmetry=1e-300)
    state, reference, estimate = one.initial_state(), (0.01, 0.1, 1.0), (0.011, 0.08, 1.5)
    assert one.step(state, reference, estimate)[1] == other.step(state, reference, estimate)[1]


def test_a_switch_to_a_law_that_knows_the_direction_has_no_bump() -> None:
    law = pi(flow_asymmetry=0.3).parameters.replace(start_time=0.2)
    controller = Controller("feedforward_pi", law, DT)
    for command in (0.3, -0.3):
        _, u = controller.step(controller.initial_state(command), (0.01, 0.1, 1.0), (0.02, 0.0, 0.0))
        assert u == pytest.approx(command, abs=1e-9)


def test_under_a_model_feedforward_the_direction_counts_once() -> None:
    law = pi().parameters.replace(model="given")
    errors = [
        position_error(Controller("feedforward_pi", law.replace(flow_asymmetry=a), DT, single_rod()))
        for a in (0.0, 0.1)
    ]
    assert errors[0] == errors[1] < 0.01


def test_a_fit_finds_the_ratio_of_the_areas_and_the_share_of_the_volumes() -> None:
    hidden, draw = single_rod(), np.random.default_rng(2)
    t = DT * np.arange(3000)
    commands = 0.25 * np.sin(2.0 * np.pi * 3.0 * t) + 0.1 * np.sin(2.0 * np.pi * 9.0 * t) - 0.02
    out = run(hidden, commands, DT)
    measured = out[:, 0] + 8e-6 * draw.standard_normal(3000), out[:, 2] + 0.05 * draw.standard_normal(3000)
    problem = RecordingProblem([Record("run", DT, commands, *measured)])
    free = FreeParameters(
        hidden.with_values({"body.area_ratio": 1.0, "body.volume_share": 0.5}),
        [
            FreeParameter("body.area_ratio", 0.02, 0.1, 10.0, "-"),
            FreeParameter("body.volume_share", 0.02, 0.05, 0.95, "-"),
        ],
    )
    found = free.table(fit(problem, free, free.start()).x)
    assert found.value("body.area_ratio") == pytest.approx(RATIO, rel=0.01)
    assert found.value("body.volume_share") == pytest.approx(1.0 / (1.0 + RATIO), rel=0.03)
